"""One mutant: the tests that it has to pass, and the process in which they run."""

import importlib
import os
import signal
import sys
import time
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

from tests.mutants.calls import LONGEST, limit, take_few_examples
from tests.mutants.mutations import Mutant

FIGURES = "tests/laws/test_golden.py"
"""Figures of an earlier version: they find almost every fault and explain none, so they run last."""
BUDGET = 30.0
"""Time of the tests of a mutant, s, before the figures: the quickest of them that fit are run."""
SLOWEST = 10 * LONGEST
"""A test that computes for longer, s, fails."""
HANGING = 180.0
"""A mutant whose tests last longer, s, waits for something: it is killed."""
CANNOT_START = 77
WARM = (
    "numpy", "numpy.polynomial", "scipy.linalg", "scipy.signal", "scipy.optimize", "scipy.spatial", "scipy.stats",
    "pandas", "pyarrow.parquet", "numba", "hydra", "hypothesis", "yaml", "rich", "sklearn.neural_network",
)  # fmt: skip
"""Libraries that are imported once for all mutants."""
KILLED, SURVIVED, FIGURES_ONLY, INVALID = "killed", "survived", "killed by figures only", "invalid"


def warm_up() -> None:
    """Import libraries, but nothing of the project, before processes are forked."""
    os.environ.update(NUMBA_DISABLE_JIT="1", PYTHONDONTWRITEBYTECODE="1")
    for name in WARM:
        importlib.import_module(name)
    if "cmacexp" in sys.modules:
        raise RuntimeError("the project is imported already: its mutants would not be")


class Copy:
    """The copy of the project of a worker."""

    root = Path()

    @classmethod
    def take(cls, free: Any) -> None:
        """Take one of the ``free`` copies."""
        cls.root = free.get()


def choose_tests(mutant: Mutant, record: dict[str, Any]) -> list[str]:
    """Tests that call the function of the mutant, those of the quickest file first.

    A mutant outside of functions has the tests of all functions of its file, or of its room if there is none.
    """
    name = mutant.path.removeprefix("cmacexp/")
    room = name.partition("/")[0]
    of_file = any(path == name for calls in record.values() for path, _ in calls["calls"])

    def calls(test: str) -> bool:
        called = record.get(test, {"calls": ()})["calls"]
        if mutant.function:
            return [name, mutant.function] in called
        return any(path == name if of_file else path.startswith(f"{room}/") for path, _ in called)

    chosen: dict[str, list[str]] = {}
    for test in record:
        file, inside, _ = test.partition("::")
        if inside and (calls(test) or calls(file)):
            chosen.setdefault(file, []).append(test)
    seconds = {test: record[test]["seconds"] for tests in chosen.values() for test in tests}
    ordered, spent = [], 0.0
    for file in sorted(chosen, key=lambda file: (file == FIGURES, sum(seconds[test] for test in chosen[file]))):
        for test in sorted(chosen[file], key=seconds.__getitem__):
            if spent + seconds[test] < BUDGET or file == FIGURES:
                spent += seconds[test]
                ordered.append(test)
    return ordered


class Chosen:
    """A plugin of pytest: the chosen tests in their order, and the first that fails."""

    def __init__(self, tests: list[str]):
        self.order = {test: number for number, test in enumerate(tests)}
        self.failed = ""

    def pytest_configure(self):
        take_few_examples()

    def pytest_collection_modifyitems(self, items):
        items[:] = sorted((item for item in items if item.nodeid in self.order), key=lambda i: self.order[i.nodeid])

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        with limit(SLOWEST):
            return (yield)

    def pytest_runtest_logreport(self, report):
        if report.failed and not self.failed:
            self.failed = report.nodeid

    pytest_collectreport = pytest_runtest_logreport


def run_tests(root: Path, module: str, tests: list[str]) -> None:
    """Run ``tests`` in the copy at ``root``; ends the process."""
    os.setsid()
    os.chdir(root)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    os.environ["PYTHONPATH"] = str(root)
    sys.path[:0] = [str(root)]
    try:
        importlib.import_module(module)
    except BaseException:
        os._exit(CANNOT_START)
    code = 0
    for file, chosen in groupby(tests, lambda test: test.partition("::")[0]):  # collect no file in vain
        plugin = Chosen(list(chosen))
        code = pytest.main(["-n0", "-q", "-x", "--tb=native", "-p", "no:cacheprovider", file], plugins=[plugin])
        if code:
            (root / "failed.txt").write_text(plugin.failed)
            break
    os._exit(code)


def wait(process: int) -> int | None:
    """Exit code of a process, negative if a signal ended it; None if it hangs."""
    until = time.monotonic() + HANGING
    while time.monotonic() < until:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return None


def try_mutant(record: dict[str, Any], mutant: Mutant) -> dict[str, Any]:
    """Make the fault in the copy, run its tests, and undo it."""
    tests = choose_tests(mutant, record)
    path, found = Copy.root / mutant.path, Copy.root / "failed.txt"
    source = path.read_bytes()
    found.unlink(missing_ok=True)
    path.write_bytes(mutant.apply(source))
    try:
        process = os.fork()
        if not process:
            run_tests(Copy.root, mutant.path.removesuffix(".py").replace("/", "."), tests)
        code = wait(process)
    finally:
        path.write_bytes(source)
    by = found.read_text() if found.exists() else f"ended with {code}"
    match code:
        case 0:
            result = SURVIVED
        case _ if code == CANNOT_START:
            result = INVALID
        case 1 | 2 if by.startswith(FIGURES):
            result = FIGURES_ONLY
        case 1 | 2 if by:
            result = KILLED
        case None:
            result = KILLED
        case _ if code < 0:
            result = KILLED
        case _:
            raise RuntimeError(f"the tests end with {code} for {mutant}")
    return {"mutant": list(mutant), "result": result, "by": by, "tests": len(tests)}
