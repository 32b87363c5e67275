"""Kernels and programs: kernels are plain Python functions; programs are compiled, with the kernels that they call.

Called from Python a kernel runs as it stands. A program is compiled when a run is long enough to repay it, and read
from the cache by later runs of any length; else it runs as plain Python too, as always with ``NUMBA_DISABLE_JIT=1``.
All give the same bits.
"""

import contextlib
import math
import os
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass
from functools import update_wrapper
from pathlib import Path
from threading import RLock
from typing import NamedTuple, cast

import numpy as np

from cmacexp.jit.kernels import Function
from cmacexp.jit.kernels import called_kernel as called_kernel
from cmacexp.jit.kernels import kernel as kernel
from cmacexp.jit.sources import cache_folder
from cmacexp.typing import Array

WORTH_LOADING, WORTH_COMPILING = 4_000, 40_000
"""Steps, times legs, that take as long in plain Python as reading a program from the cache, and as compiling it."""


@dataclass(eq=False)
class _Workload:
    """What is going on: a run."""

    size: float
    """Steps, times legs, of all runs that are like it."""
    compiling: float = 0.0
    """Seconds that it has taken to compile for it."""


_runs = ContextVar("runs", default=1.0)
"""Number of runs that this process makes, or several together."""
_UNKNOWN = _Workload(math.inf)
"""Outside of runs: whatever is called is compiled."""
_workload = ContextVar("workload", default=_UNKNOWN)


@contextlib.contextmanager
def workload(leg_steps: float) -> Iterator[None]:
    """A run of so many steps, times legs: programs that are called in it are compiled if that repays it."""
    token = _workload.set(_Workload(_runs.get() * leg_steps))
    try:
        yield
    finally:
        _workload.reset(token)


def repays_compiling() -> bool:
    """Whether what is going on is long enough to repay compiling, if anything is compiled."""
    return _workload.get().size >= WORTH_COMPILING and _is_allowed()


def _is_allowed() -> bool:
    return os.environ.get("NUMBA_DISABLE_JIT", "0") == "0"


def expect_runs(runs: float) -> None:
    """Announce that this process, or several together, make so many runs; infinite: many."""
    _runs.set(runs)


def program(function: Function, plain: Callable[..., object] | None = None, is_timed: bool = False) -> Function:
    """Compile a kernel as a program, without fastmath, so that it gives the bits of plain Python.

    Where compiling does not pay off, ``plain`` runs, or ``function`` itself; it gives the same bits. One that
    ``is_timed`` is compiled however short the run is, as it must be for a machine that is not simulated.
    """
    return cast(Function, _Program(function, plain or function, is_timed))


@kernel
def copy_array(source: Array, target: Array) -> None:
    """Copy an array to one of its shape and unit; for ``target[...] = source`` numba would allocate a third."""
    np.positive(source, target)


class _Choice(NamedTuple):
    """A function that runs for arguments of some classes, and the workload for which it was chosen."""

    chosen: Callable[..., object]
    classes: list[type]
    work: _Workload | None


_one_at_a_time = RLock()


class _Program:
    """A function that runs as plain Python, or in a compiled form that is made or read from the cache when needed."""

    def __init__(self, function: Callable[..., object], plain: Callable[..., object], is_timed: bool):
        self.function, self.plain, self.is_timed = function, plain, is_timed
        self.name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        self.forms: dict[tuple[object, ...], Callable[..., object]] = {}
        """Compiled forms by the types of their arguments."""
        self.last = _Choice(plain, [], None)
        """The last choice; one object, so that threads see a whole one."""
        update_wrapper(self, function)

    def __call__(self, *arguments: object) -> object:
        last, work, classes = self.last, _workload.get(), [*map(type, arguments)]
        is_outdated = last.chosen is self.plain and last.work is not work
        if is_outdated or last.classes != classes:  # numba would convert a number to the type that the form takes
            self.last = last = _Choice(self._choose(work, arguments), classes, work)
        try:
            return last.chosen(*arguments)
        except TypeError:  # of a compiled form, before it does anything: it is for other types
            if last.chosen is self.plain:
                raise
            self.last = last = _Choice(self._choose(work, arguments), classes, work)
            return last.chosen(*arguments)

    @property
    def chosen(self) -> Callable[..., object]:
        """The function that ran last, or would run."""
        return self.last.chosen

    def _choose(self, work: _Workload, arguments: tuple[object, ...]) -> Callable[..., object]:
        """Return the form for these arguments if it is stored, or if compiling it is repaid; else what is plain."""
        is_long = repays_compiling() or (self.is_timed and _is_allowed())
        if not is_long and not self._is_worth_loading(work):
            return self.plain
        from cmacexp.jit.forms import Form, find_types

        types = find_types(arguments)
        with _one_at_a_time:  # numba takes its folder from a variable of the process
            if types not in self.forms:
                form = Form(self.function, types, cache_folder() / self.name)
                if (compiled := form.load()) is None:
                    if not is_long:
                        return self.plain
                    _announce()
                    began = time.perf_counter()
                    compiled = form.compile()
                    _note_seconds(time.perf_counter() - began)
                self.forms[types] = compiled
            return self.forms[types]

    def _is_worth_loading(self, work: _Workload) -> bool:
        """Whether the cache holds a form, and reading it takes less time than it saves."""
        saves = bool(self.forms) or (work.size >= WORTH_LOADING and _is_allowed())
        return saves and (cache_folder() / self.name).is_dir()


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
