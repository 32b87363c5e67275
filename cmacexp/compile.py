"""Compiled kernels: plain Python functions that numba compiles once and keeps for later processes.

With ``NUMBA_DISABLE_JIT=1`` the same functions run as they stand, and give the same bits.
"""

import getpass
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

numba_config: Any = numba.config
numba_njit: Any = numba.njit
Function = TypeVar("Function", bound=Callable[..., object])

ROOMS = ("compile.py", "models", "cmac", "control", "planning", "plants", "rollout")
"""Where kernels, and constants that kernels use, may stand; their text keys the cache."""


def _sources_hash() -> str:
    """Hash of every file whose text can change compiled code.

    numba keys a cached kernel by its own file alone, and would go on using it after an edit of a kernel
    that it calls; a folder per state of the sources is never stale.
    """
    package = Path(__file__).parent
    files = [file for room in ROOMS for file in sorted((package / room).rglob("*.py"))] + [Path(__file__)]
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _cache_folder() -> Path:
    """Where compiled code of these sources is kept: the user's cache, or a temporary folder if that is read-only."""
    root = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(root) / "cmacexp" / _sources_hash()
    return folder if _writable(folder) else Path(tempfile.gettempdir()) / f"cmacexp-{getpass.getuser()}" / folder.name


CACHE_FOLDER = _cache_folder()


def _compile(function: Function, inline: bool) -> Function:
    # Without numba's reference counting, which costs more than the arithmetic does: a kernel works on arrays that
    # its caller holds, and cannot make any.
    before = numba_config.CACHE_DIR
    numba_config.CACHE_DIR = str(CACHE_FOLDER)
    try:
        compiled = numba_njit(cache=True, error_model="numpy", forceinline=inline, _nrt=False)(function)
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


def is_compiled(name: str) -> bool:
    """Whether compiled code of the kernel ``name`` is on disk, or none is needed."""
    return bool(numba_config.DISABLE_JIT) or any(CACHE_FOLDER.rglob(f"*.{name}-*.nbi"))
