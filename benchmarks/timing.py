"""Interleaved timing and tables of ratios, for all benchmarks.

Machines are noisy and change their clock while they run. So programs that are compared take turns in the same rounds.
A disturbance only makes a measurement longer: a time is the best of its rounds, a ratio is that of two best times.
"""

import ctypes
import math
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from cmacexp.config import Config
from cmacexp.config.compose import compose_config

ROOT = Path(__file__).parents[1]
Times = dict[str, list[float]]
"""Seconds of every round by name."""


class Row(NamedTuple):
    """One comparison."""

    what: str
    time: str
    against: str
    """What it is compared with, and the time of that."""
    ratio: float | None
    target: str
    limit: float = math.inf
    """A ratio above it fails the benchmark."""


class Table(NamedTuple):
    """What one benchmark found."""

    title: str
    rows: list[Row]
    note: str = ""


def in_turn(workers: dict[str, Callable[[], float]], rounds: int) -> Times:
    """Let every worker give its seconds once a round, after one round that is not counted."""
    times: Times = {name: [] for name in workers}
    for counted in [False] + [True] * rounds:
        for name, work in workers.items():
            seconds = work()
            if counted:
                times[name].append(seconds)
    return times


def ratio(times: Times, name: str, base: str) -> float:
    """The best time of ``name`` over that of ``base``."""
    return min(times[name]) / min(times[base])


def format_time(seconds: float) -> str:
    """Seconds with a fitting unit and three digits."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def compared(
    times: Times, what: str, name: str, base: str, against: str, target: str = "", limit: float = math.inf
) -> Row:
    """The row that sets ``name`` against ``base``; the ratio is not to be above ``limit``."""
    other = f"{against}: {format_time(min(times[base]))}"
    return Row(what, format_time(min(times[name])), other, ratio(times, name, base), target, limit)


def stopwatch(work: Callable[[], object]) -> Callable[[], float]:
    """A worker that does ``work`` and gives the seconds it took."""

    def timed() -> float:
        began = time.perf_counter()
        work()
        return time.perf_counter() - began

    return timed


ADOPT_ORPHANS = 36
"""Of Linux's ``prctl``, PR_SET_CHILD_SUBREAPER: processes whose parent has ended become children of this one."""


def processor_time(work: Callable[[], object]) -> Callable[[], float]:
    """A worker that does ``work`` and gives the processor time of all processes that this starts, s."""
    ctypes.CDLL(None).prctl(ADOPT_ORPHANS, 1, 0, 0, 0)

    def used() -> float:
        with suppress(ChildProcessError):
            while True:
                os.waitpid(-1, 0)
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    def timed() -> float:
        before = used()
        work()
        return used() - before

    return timed


def python(*arguments: str, folder: Path, **environment: str) -> None:
    """Run a Python process to its end, with this project on its path, and more variables of its ``environment``.

    Raises:
        CalledProcessError: it failed; its last words are shown.
    """
    command = [sys.executable, *arguments]
    variables = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True)
    if done.returncode:
        print(done.stderr[-2000:], file=sys.stderr)
        done.check_returncode()


def make_config(*overrides: str) -> Config:
    """The checked config of a command line."""
    return compose_config(overrides)


def markdown(table: Table) -> str:
    """A table for reading, on a screen or in a page."""
    head = ["", "time", "compared with", "ratio", "target"]
    lines = [f"### {table.title}", "", "| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for row in table.rows:
        shown = "" if row.ratio is None else f"{row.ratio:.3g}"
        lines.append(f"| {row.what} | {row.time} | {row.against} | {shown} | {row.target} |")
    return "\n".join(lines + (["", table.note] if table.note else []))
