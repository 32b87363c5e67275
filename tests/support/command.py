"""Run the command line as a user does, in a process of its own."""

import os
import signal
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def python(*arguments: str, folder: Path, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        text=True,
    )


def cmacexp(*overrides: str, folder: Path, **environment: str) -> subprocess.CompletedProcess:
    return python("-m", "cmacexp", *overrides, folder=folder, **environment)


def started(*overrides: str, folder: Path) -> subprocess.Popen:
    """A command that runs on; it heeds Ctrl-C as in a terminal, even where the tests themselves ignore it."""
    return subprocess.Popen(
        [sys.executable, "-m", "cmacexp", *overrides],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
