"""Sessions of pytest whose tests are collected once, and processes of their own."""

import os
import resource
import signal
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest

from benchmarks.mutants.calls import LONGEST, Calls, limit, take_few_examples

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


class Chosen:
    """A plugin of pytest that runs the tests with these names, in this order, until one fails or is too slow."""

    def __init__(self, tests: list[str]):
        self.tests, self.failed = tests, ""

    def pytest_configure(self):
        take_few_examples()

    def pytest_collection_modifyitems(self, items):
        named = {item.nodeid: item for item in items}
        items[:] = [named[test] for test in self.tests if test in named]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        with limit(SLOWEST):
            return (yield)

    def pytest_runtest_logreport(self, report):
        if report.failed and not self.failed:
            self.failed = report.nodeid


def run_until_failure(tests: list[str], tier: str) -> str:
    """Run tests of a tier by their names; the first that fails, nothing, or how pytest ends without running them."""
    chosen, files = Chosen(tests), dict.fromkeys(test.partition("::")[0] for test in tests)
    code = pytest.main([*OPTIONS, "-x", "-m", TIERS[tier], *files], plugins=[chosen])
    ran = code in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED, pytest.ExitCode.NO_TESTS_COLLECTED)
    return chosen.failed if ran else f"pytest ends with {code}"


def record_calls(tier: str, part: int, parts: int) -> dict[str, Any]:
    """Run a share of a tier's test files once without a fault; what :mod:`benchmarks.mutants.calls` records."""
    calls = Calls(ROOT / "cmacexp", part, parts)
    pytest.main([*OPTIONS, "-m", TIERS[tier]], plugins=[calls])
    return calls.record
