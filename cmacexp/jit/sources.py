"""Hashes of the sources, which identify their state; and the folder for compiled code of that state."""

import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
KERNEL_ROOMS = (
    "jit", "data/signals.py", "models", "cmac", "planning", "protocols.py", "plants", "sensors", "feedforward",
    "control", "loop",
)  # fmt: skip
"""Rooms and files with kernels, and with constants that kernels use."""
RESULT_ROOMS = (*KERNEL_ROOMS, "typing.py", "config", "data", "metrics", "engine/run.py")
"""Rooms that can change the result of a run; not those that only read it."""
PRIVATE, OTHERS_WRITE = 0o700, stat.S_IWGRP | stat.S_IWOTH


def sources_hash(rooms: Sequence[str]) -> str:
    """Hash of every Python file of ``rooms`` (folders or files of the package), 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for room in rooms:
        path = PACKAGE / room
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def code_hash() -> str:
    """Hash of all code that can change the result of a run of built-in components."""
    return sources_hash(RESULT_ROOMS)


@cache
def cache_folder() -> Path:
    """Folder for compiled code of these sources: in the user's cache, else a temporary folder.

    numba keys a cached program by its own file alone, and would still use it after an edit of a kernel that it calls;
    a folder per state of the sources is never stale.
    """
    root = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    temporary = Path(tempfile.gettempdir()) / f"cmacexp-{os.getuid()}"
    places = (
        [Path(root).resolve() / "cmacexp", temporary] if not root.startswith("~") else [temporary]
    )  # no home folder
    place = next(filter(is_private, places), None) or Path(tempfile.mkdtemp(prefix="cmacexp-"))
    return place / sources_hash(KERNEL_ROOMS)


def _can_be_replaced(folder: Path) -> bool:
    """Check whether somebody else than the user and root can rename what a folder holds."""
    status = folder.stat()
    is_sticky = status.st_mode & stat.S_ISVTX  # as /tmp: only the owner of what is in it renames that
    return status.st_uid not in (0, os.getuid()) or bool(status.st_mode & OTHERS_WRITE and not is_sticky)


def is_private(folder: Path) -> bool:
    """Make a folder if it is absent; check whether its user alone can write to it: what is in it will be run."""
    try:
        folder.mkdir(PRIVATE, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            status = folder.lstat()
        is_own = status.st_uid == os.getuid() and stat.S_ISDIR(status.st_mode) and not status.st_mode & OTHERS_WRITE
        if is_own and not any(map(_can_be_replaced, folder.resolve().parents)):
            folder.chmod(PRIVATE)  # numba makes folders in it that anybody may write to if the umask says so
            return True
    except OSError:
        return False
    print(
        f"{folder} is not used for compiled code: it must be your own, and others must not write to it or above it",
        file=sys.stderr,
    )
    return False
