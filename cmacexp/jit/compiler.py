"""Kernels and programs: kernels are plain Python functions; programs are compiled, with the kernels that they call.

Called from Python, a kernel runs uncompiled. A program is compiled if the run is long enough to repay the time of
compiling; later runs of any length read the machine code from the cache. Otherwise, and always with
``NUMBA_DISABLE_JIT=1``, a program runs as plain Python. Compiled and plain code give the same bits.
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

WORTH_LOADING = 4_000
"""Workload, steps times legs, that takes as long in plain Python as reading a program from the cache."""
WORTH_COMPILING = 40_000
"""Workload, steps times legs, that takes as long in plain Python as compiling a program."""


@dataclass(eq=False)
class _Workload:
    """Workload of the current run, which decides if compiling pays off."""

    size: float
    """Steps times legs, summed over all runs of the same kind."""
    compiling: float = 0.0
    """Time spent compiling for this workload so far, s."""


_runs = ContextVar("runs", default=1.0)
"""Number of runs that this process makes, or that several processes make together."""
_UNKNOWN = _Workload(math.inf)
"""Workload outside of runs: infinite, so that every program called is compiled."""
_workload = ContextVar("workload", default=_UNKNOWN)


@contextlib.contextmanager
def workload(leg_steps: float) -> Iterator[None]:
    """Declare a run of ``leg_steps`` (steps times legs) for the enclosed block.

    Programs called in the block are compiled if the workload repays the time of compiling.
    """
    token = _workload.set(_Workload(_runs.get() * leg_steps))
    try:
        yield
    finally:
        _workload.reset(token)


def repays_compiling() -> bool:
    """Return True if the current workload repays compiling, and compiling is not disabled."""
    return _workload.get().size >= WORTH_COMPILING and _is_allowed()


def _is_allowed() -> bool:
    return os.environ.get("NUMBA_DISABLE_JIT", "0") == "0"


def expect_runs(runs: float) -> None:
    """Declare the number of ``runs`` of this process, or of several processes together.

    It multiplies the workload of each run; ``math.inf`` stands for an unknown large number.
    """
    _runs.set(runs)


def program(function: Function, plain: Callable[..., object] | None = None, is_timed: bool = False) -> Function:
    """Make a program of a kernel, compiled without fastmath so that it gives the same bits as plain Python.

    Args:
        function: the kernel to compile.
        plain: uncompiled implementation with the same bits, for runs that do not repay compiling; None: ``function``.
        is_timed: compile for any length of run, since real time matters (a machine that is not simulated).
    """
    return cast(Function, _Program(function, plain or function, is_timed))


@kernel
def copy_array(source: Array, target: Array) -> None:
    """Copy ``source`` to ``target``, which has the same shape and unit.

    For ``target[...] = source`` numba would allocate a temporary array.
    """
    np.positive(source, target)


class _Choice(NamedTuple):
    """A function that runs for arguments of some classes, and the workload for which it was chosen."""

    chosen: Callable[..., object]
    classes: list[type]
    work: _Workload | None


_one_at_a_time = RLock()


class _Program:
    """A function that runs as plain Python or in a compiled form, made or read from the cache on demand."""

    def __init__(self, function: Callable[..., object], plain: Callable[..., object], is_timed: bool):
        self.function, self.plain, self.is_timed = function, plain, is_timed
        self.name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        self.forms: dict[tuple[object, ...], Callable[..., object]] = {}
        """Compiled forms, by numba types of their arguments."""
        self.last = _Choice(plain, [], None)
        """The last choice; one object, so that threads see a whole one."""
        update_wrapper(self, function)

    def __call__(self, *arguments: object) -> object:
        last, work, classes = self.last, _workload.get(), [*map(type, arguments)]
        is_outdated = last.chosen is self.plain and last.work is not work
        if is_outdated or last.classes != classes:  # numba would silently convert numbers
            self.last = last = _Choice(self._choose(work, arguments), classes, work)
        try:
            return last.chosen(*arguments)
        except TypeError:  # a compiled form rejects other types before it runs any of its code
            if last.chosen is self.plain:
                raise
            self.last = last = _Choice(self._choose(work, arguments), classes, work)
            return last.chosen(*arguments)

    @property
    def chosen(self) -> Callable[..., object]:
        """The function that ran last, or would run."""
        return self.last.chosen

    def _choose(self, work: _Workload, arguments: tuple[object, ...]) -> Callable[..., object]:
        """Return the compiled form for ``arguments`` if it is stored or worth compiling, else plain Python."""
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
        """Return True if the cache holds forms of this program and reading one saves time for this workload."""
        saves = bool(self.forms) or (work.size >= WORTH_LOADING and _is_allowed())
        return saves and (cache_folder() / self.name).is_dir()


_announcers: list[Callable[[], None]] = []


def call_before_compiling(call: Callable[[], None]) -> None:
    """Register ``call``, which is called once, before the first compilation of this process."""
    _announcers[:] = [call]


def _announce() -> None:
    while _announcers:
        _announcers.pop()()


def read_longest_compiling() -> float | None:
    """Read the longest time that compiling took for one run, s; None if none is recorded."""
    with contextlib.suppress(OSError, ValueError):
        return float(_seconds_file().read_text())
    return None


def _note_seconds(seconds: float) -> None:
    work = _workload.get()
    work.compiling += seconds
    with contextlib.suppress(OSError):
        _seconds_file().write_text(str(max(work.compiling, read_longest_compiling() or 0.0)))


def _seconds_file() -> Path:
    return cache_folder().parent / "seconds"  # beside the folders per state of the sources: it outlives edits
