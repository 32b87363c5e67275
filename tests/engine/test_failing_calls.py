"""System calls that fail, or at which a command is killed: places have the earlier result or the new one, whole."""

import subprocess

import pytest
from support.command import INJECTING, python

ERRORS, KILLS = "error=EIO,error=ENOSPC,error=EACCES", "signal=KILL"
BOTH = "error=EIO,signal=KILL,error=ENOSPC,signal=KILL,error=EACCES,signal=KILL"


@pytest.mark.parametrize(
    ("faults", "every", "least"),
    [
        pytest.param(BOTH, 7, 80, marks=pytest.mark.ci, id="a sample"),
        pytest.param(ERRORS, 1, 400, marks=pytest.mark.nightly, id="errors"),
        pytest.param(KILLS, 1, 400, marks=pytest.mark.nightly, id="kills"),
    ],
)
def test_at_whatever_call_a_command_fails_or_is_killed_results_stay_whole(faults, every, least, tmp_path):
    tried = subprocess.run("strace -o /dev/null true", shell=True, capture_output=True, text=True)
    if tried.returncode:
        pytest.skip(f"no system call can be traced: {tried.stderr.strip()}")
    done = python(INJECTING, faults, str(every), str(tmp_path), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert not [line for line in lines if not line.endswith((": fine", ": missed"))]
    assert sum(line.endswith(": fine") for line in lines) >= least
