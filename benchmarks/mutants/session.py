"""Sessions of pytest whose tests are collected once, and processes of their own."""

import os
import resource
import signal
import sys
from collections.abc import Callable
from itertools import pairwise
from multiprocessing import forkserver, get_context
from pathlib import Path
from typing import Any

import pytest

from benchmarks.mutants.calls import LONGEST, Calls, limit, refuse, refuse_workers, take_few_examples

ROOT = Path(__file__).parents[2]
TIERS = {"first": "not ci and not nightly", "ci": "not nightly"}
"""Which tests find faults, as markers of pytest: the first tier alone, or all that CI runs."""
OPTIONS = ("-n0", "-q", "-s", "--tb=no", "-p", "no:cacheprovider", "-p", "no:tiers")
SLOWEST = 5 * LONGEST
"""A test that computes for longer, s, fails."""
HANGING = 1800.0
"""A process with a limit that needs longer, s, waits for something, however busy the computer is."""
MOST_MEMORY = 6 * 2**30
"""Of a process, with what it shares, B."""


def call_apart(function: Callable[..., Any], *arguments: Any, most: int = resource.RLIM_INFINITY) -> Any:
    """What ``function`` returns in a process of its own, a copy of this one; None if that ends otherwise.

    It ends if it computes for longer than ``most`` s, or waits for something until it took :data:`HANGING`.
    """
    receive, send = get_context("fork").Pipe(duplex=False)

    def call() -> None:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (most, most))
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        try:
            send.send(function(*arguments))
        except BaseException as error:
            send.send(RuntimeError(f"{arguments[:1]}: {error!r}"))

    process = get_context("fork").Process(target=call)
    process.start()
    send.close()
    try:
        result = receive.recv() if most < 0 or receive.poll(HANGING) else None
    except EOFError:
        result = None
    if process.is_alive() and process.pid:
        os.killpg(process.pid, signal.SIGKILL)
    process.join()
    if isinstance(result, RuntimeError):
        raise result
    return result


class Collected:
    """A plugin of pytest that calls ``use`` with the collected tests, by their names, instead of running them."""

    def __init__(self, use: Callable[[dict[str, pytest.Item]], None]):
        self.use = use

    def pytest_configure(self):
        take_few_examples()

    def pytest_runtestloop(self, session):
        self.use({item.nodeid: item for item in session.items})
        return True


class FirstFailure:
    """A plugin of pytest: the first test that fails, or is too slow."""

    def __init__(self):
        self.failed = ""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        with limit(SLOWEST):
            return (yield)

    def pytest_runtest_logreport(self, report):
        if report.failed and not self.failed:
            self.failed = report.nodeid


def run_until_failure(items: list[pytest.Item]) -> str:
    """Run collected tests; the name of the first that fails, or nothing."""
    first = FirstFailure()
    for item in items[:1]:
        item.config.pluginmanager.register(first)
    for item, following in pairwise([*items, None]):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if first.failed:
            break
    return first.failed


def record_calls(tier: str, part: int, parts: int) -> dict[str, Any]:
    """Run a share of a tier's test files once without a fault; what :mod:`benchmarks.mutants.calls` records."""
    calls = Calls(ROOT / "cmacexp")

    def run(items: dict[str, pytest.Item]) -> None:
        files = list(dict.fromkeys(name.partition("::")[0] for name in items))
        own = [item for name, item in items.items() if name.partition("::")[0] in files[part::parts]]
        own[0].config.pluginmanager.register(calls)
        sys.addaudithook(refuse)
        forkserver.ensure_running = refuse_workers  # which no audit hook sees
        for item, following in pairwise([*own, None]):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)

    pytest.main([*OPTIONS, "-m", TIERS[tier]], plugins=[Collected(run)])
    return calls.record
