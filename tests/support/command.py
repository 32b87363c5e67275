"""Run commands: ``call`` in this process, through their ``main``; the others as a user does, in one of their own."""

import atexit
import contextlib
import importlib
import io
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from unittest.mock import patch

import pandas as pd

from cmacexp.entry_points import list_commands

ROOT = Path(__file__).parents[2]
INJECTING = str(Path(__file__).with_name("injecting.py"))
"""A program that lets system calls of commands fail."""


def environment(**changes: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), **changes}


def call(name: str, *words: object, folder: Path | None = None) -> subprocess.CompletedProcess:
    """A command in this process, ``pipelines``, of an add-on or ``cmacexp.commands.NAME`` (``main`` runs one)."""
    commands = list_commands()
    if name in commands:
        main = commands[name].load()
    else:
        main = importlib.import_module(
            "pipelines.__main__" if name == "pipelines" else f"cmacexp.commands.{name}"
        ).main
    output, errors, code = io.StringIO(), io.StringIO(), 0
    arguments = [f"cmacexp.{name}", *map(str, words)]
    with (
        contextlib.chdir(folder or Path.cwd()),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(errors),
        patch.object(sys, "argv", arguments),
        patch("cmacexp.terminal.output.FIRST_LINE_DELAY", threading.TIMEOUT_MAX),  # a busy machine prints no more
    ):
        try:
            code = main()
        except SystemExit as end:  # of argparse
            code = end.code
    return subprocess.CompletedProcess(arguments, code, output.getvalue(), errors.getvalue())


def sweep(*words: object, folder: Path) -> subprocess.CompletedProcess:
    """The sweep of these words in ``folder / "s"``."""
    return call("main", "-m", *words, "hydra.sweep.dir=s", folder=folder)


def table_of(folder: Path) -> pd.DataFrame:
    """The table of that sweep."""
    return pd.read_parquet(folder / "s" / "sweep.parquet")


@cache
def server() -> subprocess.Popen:
    """The process whose forks are commands; one for all tests of this process."""
    command = [sys.executable, str(Path(__file__).with_name("server.py"))]
    process = subprocess.Popen(command, env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    atexit.register(process.communicate)
    return process


def module(*words: str, folder: Path) -> subprocess.CompletedProcess:
    """``python -m WORDS``, without waiting for imports."""
    with tempfile.NamedTemporaryFile("r") as output, tempfile.NamedTemporaryFile("r") as errors:
        process = server()
        print(json.dumps([str(folder), output.name, errors.name, words]), file=process.stdin, flush=True)
        return subprocess.CompletedProcess(words, int(process.stdout.readline()), output.read(), errors.read())


def python(*arguments: str, folder: Path, **changes: str) -> subprocess.CompletedProcess:
    """The interpreter with these arguments, and changes of the environment; a module runs in a fork of the server."""
    if arguments[0] == "-m" and not changes:
        return module(*arguments[1:], folder=folder)
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=folder, env=environment(**changes), capture_output=True, text=True)


def cmacexp(*overrides: str, folder: Path, **changes: str) -> subprocess.CompletedProcess:
    return python("-m", "cmacexp", *overrides, folder=folder, **changes)


def started(*arguments: str, folder: Path, module: str = "cmacexp") -> subprocess.Popen:
    """A command that runs on; it heeds Ctrl-C and a closed terminal, even where the tests themselves ignore them."""

    def heed():
        for number in (signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)

    return subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed,
    )


def interrupted(
    *arguments: str, folder: Path, once: Callable[[], object], number: int = signal.SIGINT, module: str = "cmacexp"
) -> subprocess.CompletedProcess:
    """A command that gets a signal ``once`` something is there; it ends, without a stack trace."""
    process = started(*arguments, folder=folder, module=module)
    while not once() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(number)
    try:
        output, errors = process.communicate()
    finally:
        process.kill()
    assert "Traceback" not in errors
    return subprocess.CompletedProcess(arguments, process.returncode, output, errors)
