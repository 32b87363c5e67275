"""Interleaved timing and tables of ratios, for all benchmarks.

Computers are noisy and change their clock rate. So programs that are compared take turns in the same rounds. A
disturbance only makes a measurement longer: a time is the minimum over the rounds, a ratio is that of two minima.
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

from cmacexp.loop import run_cycles
from cmacexp.loop.scenario import Scenario

ROOT = Path(__file__).parents[1]
Times = dict[str, list[float]]
"""Times of all rounds by the worker's name, s."""


class Row(NamedTuple):
    """One comparison."""

    what: str
    time: str
    against: str
    """The reference and its time."""
    ratio: float | None
    target: str
    limit: float = math.inf
    """Largest ratio with which the benchmark passes."""


class Table(NamedTuple):
    """The results of one benchmark."""

    title: str
    rows: list[Row]
    note: str = ""


def in_turn(workers: dict[str, Callable[[], float]], rounds: int) -> Times:
    """Call every worker once per round and collect its times, s; a first round is not counted."""
    first, *counted = [{name: work() for name, work in workers.items()} for _ in range(rounds + 1)]
    return {name: [times[name] for times in counted] for name in first}


def ratio(times: Times, name: str, base: str) -> float:
    """Return the minimum time of ``name`` divided by that of ``base``."""
    return min(times[name]) / min(times[base])


def format_time(seconds: float) -> str:
    """Format a time given in seconds with three digits and a unit of s, ms, us or ns."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def compared(
    times: Times, what: str, name: str, base: str, against: str, target: str = "", limit: float = math.inf
) -> Row:
    """Return the row that compares ``name`` with ``base``; the benchmark fails if the ratio exceeds ``limit``."""
    other = f"{against}: {format_time(min(times[base]))}"
    return Row(what, format_time(min(times[name])), other, ratio(times, name, base), target, limit)


def time_step(scenario: Scenario) -> float:
    """Run ``scenario`` in memory and return the time of the loop per step, s."""
    steps = sum(len(trace.table) for trace in run_cycles(scenario)) // scenario.setup.config.legs
    return scenario.end.rollout_seconds / steps


def stopwatch(work: Callable[[], object]) -> Callable[[], float]:
    """Return a worker that does ``work`` and returns its elapsed time, s."""

    def timed() -> float:
        began = time.perf_counter()
        work()
        return time.perf_counter() - began

    return timed


ADOPT_ORPHANS = 36
"""PR_SET_CHILD_SUBREAPER of Linux's ``prctl``: orphaned descendants become children of this process."""


def processor_time(work: Callable[[], object]) -> Callable[[], float]:
    """Return a worker that does ``work`` and returns the processor time of all processes that it starts, s."""
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
    """Run a Python process in ``folder`` and wait for it; this project is importable there.

    ``environment`` holds additional environment variables.

    Raises:
        CalledProcessError: the process failed; the end of its standard error is printed.
    """
    variables = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run([sys.executable, *arguments], cwd=folder, env=variables, capture_output=True, text=True)
    if done.returncode:
        print(done.stderr[-2000:], file=sys.stderr)
        done.check_returncode()


def markdown(table: Table) -> str:
    """Format a table as Markdown."""
    head = ["", "time", "compared with", "ratio", "target"]
    lines = [f"### {table.title}", "", "| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for row in table.rows:
        ratio_text = "" if row.ratio is None else f"{row.ratio:.3g}"
        lines.append(f"| {row.what} | {row.time} | {row.against} | {ratio_text} | {row.target} |")
    return "\n".join(lines + (["", table.note] if table.note else []))
