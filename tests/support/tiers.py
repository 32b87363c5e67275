"""What the first tier promises, enforced: no process, no MuJoCo, and no test above a second.

A second is that of the machine on which the limit was chosen: processor time counts in units of a loop whose time is
taken beside the test, so that a slow machine changes no result, and is the longest of three, for a busy one.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

LONGEST = 33.0
"""Processor time of a test of the first tier, in units of :func:`time_of_the_loop`: about a second."""
STARTS = {"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.system"}
"""Events of Python that start a process."""
_watched = False
"""Whether a test of the first tier is going on."""
_shared = 0.0
"""Processor time that tests of this process spent on what others use too, s."""


def in_first_tier(item: pytest.Item) -> bool:
    return not any(item.get_closest_marker(name) for name in ("ci", "nightly"))


def time_of_the_loop() -> float:
    """Processor time of a loop of plain Python, s; the longest of three."""
    times = []
    for _ in range(3):
        start, total = time.process_time(), 0
        for number in range(1_000_000):
            total += number
        times.append(time.process_time() - start)
    return max(times)


@contextmanager
def for_all_tests() -> Iterator[None]:
    """What happens here serves other tests too: its time is not that of the test that is first to need it."""
    global _shared
    start = time.process_time()
    yield
    _shared += time.process_time() - start


def _refuse(event: str, arguments: tuple[object, ...]) -> None:
    if not _watched or arguments[:1] == ("git",):  # which says the commit of a run, once a process
        return
    if event in STARTS or (event == "import" and arguments[0] == "mujoco"):
        what = "MuJoCo" if event == "import" else "a process"
        raise AssertionError(f"needs {what}: mark the test with pytest.mark.ci")


sys.addaudithook(_refuse)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Watch a test of the first tier, without its fixtures, which it may share."""
    global _watched
    if not in_first_tier(item):
        return (yield)
    _watched, start = True, time.process_time() - _shared
    try:
        found = yield
    finally:
        _watched, took = False, time.process_time() - _shared - start
    if took > 0.3 and took > LONGEST * (loop := time_of_the_loop()):
        pytest.fail(f"takes {took / loop:.0f} times the loop, above {LONGEST:g}: mark it with pytest.mark.ci", False)
    return found
