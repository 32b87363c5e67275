"""A plugin of pytest: which functions each test calls, and how long it takes.

What a test calls in its call belongs to it alone. What runs in its set-up, or while its file is imported, may serve
the other tests of the file too and belongs to all of them.
"""

import json
import os
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import Phase, settings

LONGEST = 4
"""Tests that take longer, s, are too slow to run against every mutant."""


EXAMPLES = 8


class Unfit(BaseException):
    """A test does not suit; no test and no shrinking of examples catches it."""


def refuse(event, _):
    """Stop a test that starts another process, whose calls are not seen."""
    if event == "subprocess.Popen":
        raise Unfit


def stop(*_):
    """Stop the test that runs."""
    raise Unfit


@contextmanager
def limit(seconds: float) -> Iterator[None]:
    """Stop what computes for longer; time in which others use the processor does not count."""
    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def take_few_examples() -> None:
    """Let tests with examples of hypothesis try few, and not look for the simplest that fails."""
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile("mutants", settings.get_profile("laws"), max_examples=EXAMPLES, phases=phases)
    settings.load_profile("mutants")


class Calls:
    """Records the calls of functions of files below ``package``, and writes them to ``out``."""

    def __init__(self, package: Path, out: Path):
        self.prefix, self.out = f"{package}{os.sep}", out
        self.now = ""
        self.called = defaultdict(set)
        self.seconds, self.failed = defaultdict(float), set()

    def trace(self, frame, event, arg):
        """Called by the interpreter for every call of a Python function, but for none of its lines."""
        code = frame.f_code
        if code.co_filename.startswith(self.prefix):
            self.called[self.now].add((code.co_filename[len(self.prefix) :], code.co_firstlineno))

    def pytest_configure(self):
        take_few_examples()

    def pytest_make_collect_report(self, collector):
        self.now = collector.nodeid

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self, item):
        self.now = item.nodeid.partition("::")[0]
        sys.settrace(self.trace)  # again: it ends where a test is stopped
        with limit(4 * LONGEST):  # it may serve many tests
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        self.now = item.nodeid
        with limit(LONGEST):
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        start = time.process_time()
        result = yield
        self.seconds[item.nodeid] = time.process_time() - start
        return result

    def pytest_runtest_logreport(self, report):
        if not report.passed:
            self.failed.add(report.nodeid)

    def pytest_sessionfinish(self):
        """Write the calls of the tests that passed, and of their files."""
        sys.settrace(None)
        recorded = {
            name: {"seconds": self.seconds[name], "calls": sorted(self.called[name])}
            for name in {*self.called, *self.seconds} - self.failed
        }
        self.out.write_text(json.dumps(recorded))


def main() -> None:
    """``calls.py PACKAGE OUT TEST...``."""
    package, out, *tests = sys.argv[1:]
    sys.addaudithook(refuse)
    calls = Calls(Path(package).resolve(), Path(out).resolve())
    sys.settrace(calls.trace)
    code = pytest.main(["-n0", "-q", "--tb=native", "-p", "no:cacheprovider", *tests], plugins=[calls])
    sys.exit(0 if code in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED) else int(code))


if __name__ == "__main__":
    main()
