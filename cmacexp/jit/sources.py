"""Hashes of the sources, which identify their state; and the folder for compiled code of that state."""

import contextlib
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
    "jit", "data/signals.py", "models", "cmac", "planning", "plants", "sensors", "feedforward", "control", "loop",
)  # fmt: skip
"""Rooms and files with kernels, and with constants that kernels use."""
RESULT_ROOMS = (*KERNEL_ROOMS, "typing.py", "config", "data", "metrics", "experiment/run.py")
"""Rooms that can change the result of a run; not those that only read it."""
PRIVATE = 0o700


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
    folder = Path(root) / "cmacexp" / sources_hash(KERNEL_ROOMS)
    has_root = not root.startswith("~")  # in a container a user may have no home folder
    if not (has_root and _make(folder)):
        return _temporary_folder(folder.name)
    folder = folder.resolve()
    if reason := find_other_writers(folder):
        temporary = _temporary_folder(folder.name)
        print(f"compiled code is kept in {temporary}, not in {folder}: {reason}", file=sys.stderr)
        return temporary
    with contextlib.suppress(OSError):
        folder.chmod(PRIVATE)  # numba makes folders in it that anybody may write to if the umask says so
    return folder


def _make(folder: Path) -> bool:
    """Make a folder with what is missing above it, private; whether it can be written to."""
    try:
        for each in (*reversed(folder.parents), folder):
            each.mkdir(PRIVATE, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def find_other_writers(folder: Path) -> str:
    """Why another user can write to a folder, or replace it, and how to change that; empty if nobody can.

    ``folder`` must be without symbolic links.
    """
    user = os.getuid()
    for each in (folder, *folder.parents):
        status = each.stat()
        if status.st_uid not in (user, 0):
            return f"{each} belongs to another user; NUMBA_CACHE_DIR can name a folder of your own"
        has_own_group = status.st_gid == status.st_uid == user != 0  # many systems give every user a group
        others = stat.S_IWOTH if has_own_group else stat.S_IWOTH | stat.S_IWGRP
        protects = each != folder and status.st_mode & stat.S_ISVTX  # as /tmp: others cannot replace what is in it
        if status.st_mode & others and not protects:
            return f"others can write to {each}; chmod go-w prevents that"
    return ""


def _temporary_folder(name: str) -> Path:
    """A temporary folder that lasts; a new one if others could have put code there."""
    user = os.getuid()
    folder = Path(tempfile.gettempdir()).resolve() / f"cmacexp-{user}"
    with contextlib.suppress(OSError):
        folder.mkdir(PRIVATE, exist_ok=True)
        status = folder.lstat()
        if stat.S_ISDIR(status.st_mode) and status.st_uid == user and not status.st_mode & 0o077:
            return folder / name
    return Path(tempfile.mkdtemp(prefix="cmacexp-"))
