"""Kernels and programs: kernels are plain Python functions; programs are compiled, with the kernels that they call.

Called from Python a kernel runs as it stands. A program is compiled when a run is long enough to repay it, and read
from the cache by later runs of any length; else it runs as plain Python too, as always with ``NUMBA_DISABLE_JIT=1``.
All give the same bits.
"""

import contextlib
import math
import os
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import cast

import numpy as np

from cmacexp.jit.interrupt import raise_if_interrupted
from cmacexp.jit.kernels import Function
from cmacexp.jit.kernels import called_kernel as called_kernel
from cmacexp.jit.kernels import kernel as kernel
from cmacexp.jit.sources import cache_folder
from cmacexp.typing import Array

WORTH_LOADING, WORTH_COMPILING = 4_000, 40_000
"""Steps, times legs, that take as long in plain Python as reading a program from the cache, and as compiling it."""


class _Process:
    """This process, or several that work together."""

    runs = 1.0
    """Number of runs that it makes."""


@dataclass(eq=False)
class _Workload:
    """What is going on: a run of so many steps, times legs."""

    leg_steps: float
    compiling: float = 0.0
    """Seconds that it has taken to compile for it."""

    @property
    def size(self) -> float:
        """Steps, times legs, of all runs."""
        return _Process.runs * self.leg_steps


_UNKNOWN = _Workload(math.inf)
"""Outside of runs: whatever is called is compiled."""
_workload = ContextVar("workload", default=_UNKNOWN)


@contextlib.contextmanager
def workload(leg_steps: float) -> Iterator[None]:
    """A run of so many steps, times legs: programs that are called in it are compiled if that repays it."""
    token = _workload.set(_Workload(leg_steps))
    try:
        yield
    finally:
        _workload.reset(token)


def repays_compiling() -> bool:
    """Whether what is going on is long enough to repay compiling, if anything is compiled."""
    return _workload.get().size >= WORTH_COMPILING and os.environ.get("NUMBA_DISABLE_JIT", "0") == "0"


def expect_runs(runs: float) -> None:
    """Announce that this process, or several together, make so many runs; infinite: many."""
    _Process.runs = runs


def program(function: Function, plain: Callable[..., object] | None = None) -> Function:
    """Compile a kernel as a program, without fastmath, so that it gives the bits of plain Python.

    Where compiling does not pay off, ``plain`` runs, or ``function`` itself; it gives the same bits.
    """
    return cast(Function, _Program(function, plain or function))


@kernel
def copy_array(source: Array, target: Array) -> None:
    """Copy an array to one of its shape and unit; for ``target[...] = source`` numba would allocate a third."""
    np.positive(source, target)


class NotCompiled(Exception):
    """A program would have to be compiled for work that does not repay it."""


class _Program:
    """A function that runs as plain Python, or in a compiled form that is made or read from the cache when needed."""

    def __init__(self, function: Callable[..., object], plain: Callable[..., object]):
        self.function, self.plain = function, plain
        self.chosen = plain
        self.chosen_for: _Workload | None = None
        """What runs, and the workload for which it was chosen."""
        update_wrapper(self, function)

    def __call__(self, *arguments: object) -> object:
        work = _workload.get()
        if self.chosen_for is work:
            return self.chosen(*arguments)
        self.chosen_for = work
        is_long = repays_compiling()
        if is_long or self._is_worth_loading(work):
            with contextlib.suppress(NotCompiled):
                from cmacexp.jit.numba_private import before_compiling

                with before_compiling(_announce if is_long else _refuse, raise_if_interrupted, _note_seconds):
                    self.chosen = self.compiled
                    return self.compiled(*arguments)
        self.chosen = self.plain
        return self.plain(*arguments)

    def _is_worth_loading(self, work: _Workload) -> bool:
        """Whether the cache holds something, and reading it takes less time than it saves."""
        name = f"{self.function.__module__.rpartition('.')[2]}.{self.function.__qualname__}"
        saves = "compiled" in vars(self) or work.size >= WORTH_LOADING
        return saves and any(cache_folder().glob(f"*/{name}-*.nbc"))

    @cached_property
    def compiled(self) -> Callable[..., object]:
        """What numba makes of the function."""
        from cmacexp.jit.numba_private import compiled_program

        return compiled_program(self.function, cache_folder())


def _refuse() -> None:
    raise NotCompiled


_announcers: list[Callable[[], None]] = []


def call_before_compiling(call: Callable[[], None]) -> None:
    """Have ``call`` called once if something has to be compiled, before it is."""
    _announcers[:] = [call]


def _announce() -> None:
    while _announcers:
        _announcers.pop()()


def read_longest_compiling() -> float | None:
    """How long compiling took at most for one run, s; None if that is not known."""
    with contextlib.suppress(OSError, ValueError):
        return float(_seconds_file().read_text())
    return None


def _note_seconds(seconds: float) -> None:
    work = _workload.get()
    work.compiling += seconds
    with contextlib.suppress(OSError):
        _seconds_file().write_text(str(max(work.compiling, read_longest_compiling() or 0.0)))


def _seconds_file() -> Path:
    return cache_folder().parent / "seconds"  # beside the folders of all states of the sources
