"""Compiled kernels: plain Python functions that numba compiles once and keeps for later processes.

With ``NUMBA_DISABLE_JIT=1`` the same functions run as they stand, and give the same bits.
"""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event

from cmacexp.jit.numba_private import blas_left_for_later
from cmacexp.jit.sources import KERNEL_ROOMS, sources_hash

with blas_left_for_later():
    import numba.np.arraymath

numba_config: Any = numba.config
numba_njit: Any = numba.njit
register: Any = event.register
Function = TypeVar("Function", bound=Callable[..., object])


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _cache_folder() -> Path:
    """Where compiled code of these sources is kept: the user's cache, or a new temporary folder.

    numba keys a cached kernel by its own file alone, and would go on using it after an edit of a kernel that it
    calls; a folder per state of the sources is never stale.
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


CACHE_FOLDER = _cache_folder()


def remove_compiled() -> str:
    """Remove compiled code that cannot be read, so that the next run compiles anew; says so."""
    shutil.rmtree(CACHE_FOLDER, ignore_errors=True)
    return f"{CACHE_FOLDER}: compiled code was damaged and is removed; run again"


def _compile(function: Function, inline: bool, within: bool = False) -> Function:
    # Without numba's reference counting, which costs more than the arithmetic does: a kernel works on arrays that
    # its caller holds, and cannot make any.
    before = numba_config.CACHE_DIR
    numba_config.CACHE_DIR = str(CACHE_FOLDER)
    try:
        compiled = numba_njit(
            cache=True,
            error_model="numpy",
            forceinline=inline,
            no_cpython_wrapper=within,
            no_cfunc_wrapper=True,
            _nrt=False,
        )(function)
    finally:
        numba_config.CACHE_DIR = before
    return cast(Function, compiled)


def kernel(function: Function) -> Function:
    """Compile ``function`` on its first call, without fastmath, so that it gives the bits of plain Python.

    It becomes part of every kernel that calls it: passing tuples of arrays costs more than most kernels do.
    """
    return _compile(function, inline=True)


def kernel_apart(function: Function) -> Function:
    """:func:`kernel` for a long function that many runs never call, and that would crowd what they do."""
    return _compile(function, inline=False)


def kernel_within(function: Function) -> Function:
    """:func:`kernel_apart` for a function that only kernels call: it takes large tuples, and unpacking those for
    Python takes longer to compile than the function itself.
    """
    return _compile(function, inline=False, within=True)


class _Announcement(event.Listener):
    """Calls back once, when the first kernel of this process is compiled because none is kept on disk."""

    def __init__(self, call: Callable[[], None]):
        self.call: Callable[[], None] | None = call

    def on_start(self, event: event.Event) -> None:
        """A kernel is about to be compiled."""
        if self.call is not None:
            self.call()
            self.call = None

    def on_end(self, event: event.Event) -> None:
        """A kernel has been compiled."""


def call_before_compiling(call: Callable[[], None]) -> None:
    """Have ``call`` called once if something has to be compiled, before it is."""
    register("numba:compile", _Announcement(call))
