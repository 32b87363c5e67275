"""What the first tier promises, enforced: no process and no MuJoCo.

No time is judged, so that a busy machine changes no result.
"""

import sys

import pytest

STARTS = {"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.system"}
"""Events of Python that start a process."""
_watched = False
"""Whether a test of the first tier is going on."""


def in_first_tier(item: pytest.Item) -> bool:
    return not any(item.get_closest_marker(name) for name in ("ci", "nightly"))


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
    _watched = in_first_tier(item)
    try:
        return (yield)
    finally:
        _watched = False
