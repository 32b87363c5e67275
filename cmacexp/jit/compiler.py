"""Kernels and programs: kernels are plain Python functions; programs are compiled, with the kernels that they call.

Called from Python a kernel runs as it stands. A program is compiled when it is first called, and read from the cache
in later processes. With ``NUMBA_DISABLE_JIT=1`` programs run as plain Python too; all give the same bits.
"""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from typing import cast

from cmacexp.jit.kernels import Function, kernel, kernel_apart
from cmacexp.jit.sources import KERNEL_ROOMS, sources_hash

__all__ = ["cache_folder", "call_before_compiling", "kernel", "kernel_apart", "program", "remove_compiled"]


def program(function: Function) -> Function:
    """Compile a kernel as a program, without fastmath, so that it gives the bits of plain Python."""
    return cast(Function, _Program(function))


class _Program:
    """A function whose compiled form is made, or read from the cache, when it is first called."""

    def __init__(self, function: Callable[..., object]):
        self.function = function
        update_wrapper(self, function)

    def __call__(self, *arguments: object) -> object:
        from cmacexp.jit.numba_private import quick_compilation

        with quick_compilation():
            return self.compiled(*arguments)

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
