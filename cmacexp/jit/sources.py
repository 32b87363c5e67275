"""Hashes that identify the state of the sources, and the cache folder for machine code of that state."""

import hashlib
import os
import stat
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
KERNEL_ROOMS = (
    "jit", "data/signals.py", "models", "cmac", "planning", "protocols.py", "plants", "sensors", "feedforward",
    "control", "loop",
)  # fmt: skip
"""Folders and files of the package with kernels, or with constants that kernels use."""
RESULT_ROOMS = (*KERNEL_ROOMS, "typing.py", "config", "data", "metrics", "engine/run.py")
"""Folders and files of the package that can change the result of a run."""
PRIVATE = 0o700
"""Mode of a folder that only its owner can access."""
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
"""Mode bits that let other users write."""


def sources_hash(rooms: Sequence[str]) -> str:
    """Return the hash of all Python files of ``rooms`` (folders or files of the package), 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for room in rooms:
        path = PACKAGE / room
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def cache_folder() -> Path:
    """Return the folder for machine code of the present sources: in the user's cache, else a temporary folder.

    numba identifies a cached program only by the file that defines it, and would still use it after an edit of a
    kernel that it calls; a folder per state of the sources is never stale.
    """
    folder = next(filter(is_private, _list_cache_roots()), None) or Path(tempfile.mkdtemp(prefix="cmacexp-"))
    return folder / sources_hash(KERNEL_ROOMS)


def _list_cache_roots() -> list[Path]:
    """List folders that may hold compiled code: in the user's cache, then temporary ones that others may own."""
    root = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    base = Path(tempfile.gettempdir()) / f"cmacexp-{os.getuid()}"
    temporary = [base, *(base.with_name(f"{base.name}-{number}") for number in range(1, 4))]
    # Without a home folder expanduser returns the path unchanged.
    return temporary if root.startswith("~") else [Path(root).resolve() / "cmacexp", *temporary]


def find_refused_cache() -> Path | None:
    """Find a folder that would hold compiled code if others could not write to it; None: there is none."""
    first = next((root for root in _list_cache_roots() if is_private(root) or os.path.lexists(root)), None)
    return None if first is None or is_private(first) else first


def _can_be_replaced(folder: Path) -> bool:
    """Return True if a user other than the present one and root can rename entries of ``folder``."""
    status = folder.stat()
    is_sticky = status.st_mode & stat.S_ISVTX  # like /tmp: only the owner of an entry can rename it
    return status.st_uid not in (0, os.getuid()) or bool(status.st_mode & OTHERS_WRITE and not is_sticky)


def is_private(folder: Path) -> bool:
    """Create ``folder`` if it is absent; return True if only the present user can write to it.

    Its files will be executed.
    """
    try:
        folder.mkdir(PRIVATE, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            status = folder.lstat()
        is_own = status.st_uid == os.getuid() and stat.S_ISDIR(status.st_mode) and not status.st_mode & OTHERS_WRITE
        if is_own and not any(map(_can_be_replaced, folder.resolve().parents)):
            folder.chmod(PRIVATE)  # with a lax umask numba makes subfolders that others can write to
            return True
    except OSError:
        pass
    return False
