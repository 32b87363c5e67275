"""Kernels and programs: kernels are plain Python functions; programs are compiled, with the kernels that they call.

Called from Python a kernel runs as it stands. A program is compiled when a run is long enough to repay it, and read
from the cache by later runs of any length; else it runs as plain Python too, as always with ``NUMBA_DISABLE_JIT=1``.
All give the same bits.
"""

import contextlib
import math
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from typing import cast

from cmacexp.jit.kernels import Function, kernel, kernel_apart
from cmacexp.jit.sources import KERNEL_ROOMS, sources_hash

__all__ = [
    "cache_folder",
    "call_before_compiling",
    "expect_runs",
    "expect_steps",
    "kernel",
    "kernel_apart",
    "program",
    "remove_compiled",
]

WORTH_COMPILING = 40_000
"""Steps, times legs, that take as long in plain Python as compiling does, some 12 s."""


@dataclass
class _Work:
    """What this process is about to do."""

    runs: float = 1.0
    leg_steps: float = math.inf
    """Of one run."""
    count: int = 0
    """How often this has been announced."""

    @property
    def is_long(self) -> bool:
        """Whether it repays compiling."""
        return self.runs * self.leg_steps >= WORTH_COMPILING


_work = _Work()


def expect_steps(leg_steps: float) -> None:
    """Announce a run of so many steps, times legs: its programs are compiled if it is long, or cached already."""
    _work.leg_steps = leg_steps
    _work.count += 1


def expect_runs(runs: float) -> None:
    """Announce that this process, or several together, make so many runs; infinite: many, or much beside them."""
    _work.runs = runs
    _work.count += 1


def program(function: Function) -> Function:
    """Compile a kernel as a program, without fastmath, so that it gives the bits of plain Python."""
    return cast(Function, _Program(function))


class _Program:
    """A function that runs as plain Python, or in a compiled form that is made or read from the cache when needed."""

    def __init__(self, function: Callable[..., object]):
        self.function = function
        self.decided = -1
        """The announcement, by its count, for which :attr:`chosen` was chosen."""
        update_wrapper(self, function)

    def __call__(self, *arguments: object) -> object:
        if self.decided != _work.count:
            self.chosen = self._run_compiled if _work.is_long or self._is_cached(arguments) else self.function
            self.decided = _work.count
        return self.chosen(*arguments)

    def _run_compiled(self, *arguments: object) -> object:
        from cmacexp.jit.numba_private import quick_compilation

        with quick_compilation():
            return self.compiled(*arguments)

    def _is_cached(self, arguments: tuple[object, ...]) -> bool:
        """Whether the compiled form for such arguments need not be made; importing numba to tell takes a while."""
        name = f"{self.function.__module__.rpartition('.')[2]}.{self.function.__qualname__}"
        if not any(cache_folder().glob(f"*/{name}-*.nbi")):
            return False
        from cmacexp.jit.numba_private import is_cached

        return is_cached(self.compiled, arguments)

    @cached_property
    def compiled(self) -> Callable[..., object]:
        """What numba makes of the function."""
        from cmacexp.jit.numba_private import compiled_program

        return compiled_program(self.function, cache_folder())


def call_before_compiling(call: Callable[[], None]) -> None:
    """Have ``call`` called once if something has to be compiled, before it is."""
    from cmacexp.jit.numba_private import announce

    announce(call)


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@cache
def cache_folder() -> Path:
    """Folder for compiled code of these sources: in the user's cache, else a temporary folder.

    numba keys a cached program by its own file alone, and would still use it after an edit of a kernel that it calls;
    a folder per state of the sources is never stale.
    """
    root = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    folder = Path(root) / "cmacexp" / sources_hash(KERNEL_ROOMS)
    return folder if _writable(folder) else _temporary_folder(folder.name)


def _temporary_folder(name: str) -> Path:
    """A temporary folder that lasts; a new one if others could have put code there."""
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"cmacexp-{user}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.stat()
        if status.st_uid == user and not status.st_mode & 0o077:
            return folder / name
    return Path(tempfile.mkdtemp(prefix="cmacexp-"))


def remove_compiled() -> str:
    """Remove compiled code that cannot be read, so that the next run compiles it again; returns a message."""
    folder = cache_folder()
    shutil.rmtree(folder, ignore_errors=True)
    return f"{folder}: compiled code was damaged and has been removed; run again"
