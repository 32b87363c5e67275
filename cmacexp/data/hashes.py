"""Whether a file of a run is as the run wrote it: everything that reads one asks here first."""

import os
import time
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from cmacexp.data import manifest as manifests
from cmacexp.data.files import is_behind_link, sha256
from cmacexp.errors import BadRun

TIME_RESOLUTION = 20_000_000
"""Two changes of a file within so many nanoseconds may leave it the same times."""
MAX_CACHED_FILES = 4096
"""Files whose hash is kept."""


@lru_cache(MAX_CACHED_FILES)
def _cached_hash(path: Path, stamp: tuple[int, ...]) -> str:
    return sha256(path)


def current_hash(path: Path) -> str:
    """SHA-256 of a file as it is now; computed once while its size, inode and times do not change."""
    status = path.lstat()
    stamp = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
    just_written = time.time_ns() - max(stamp[-2:]) < TIME_RESOLUTION
    return sha256(path) if just_written else _cached_hash(path, stamp)


def _listed(folder: Path) -> Mapping[str, str] | None:
    """Files of a run and their hashes; None while it is written, when it has no manifest yet."""
    path = folder / manifests.NAME
    return manifests.read_file(path)["files"] if os.path.lexists(path) else None


def find_fault(folder: Path, name: str, expected: str) -> str | None:
    """Why the file ``name`` of a folder is not the one with the hash ``expected``; None: it is."""
    try:
        if is_behind_link(folder, name):
            return "behind a link, which is not followed"
        return None if current_hash(folder / name) == expected else "changed since it was written"
    except (FileNotFoundError, NotADirectoryError):
        return "missing"
    except OSError as error:
        return f"cannot be read ({error.strerror or error})"


def was_written(path: Path) -> bool:
    """Whether the run in whose folder ``path`` lies wrote that file.

    Raises:
        BadRun: the manifest of the run is damaged.
    """
    listed = _listed(path.parent)
    return path.is_file() if listed is None else path.name in listed


def require_intact(path: Path) -> Path:
    """``path``, if this file of a run is as the run wrote it.

    The files of a run that is still being written have nothing yet that they could be compared with.

    Raises:
        BadRun: it is missing, has changed, cannot be read, or the manifest of the run is damaged or does not list it.
    """
    listed = _listed(path.parent)
    if listed is None:
        return path
    if path.name not in listed:
        raise BadRun(f"{path}: the run did not write this file, its {manifests.NAME} does not list it")
    if fault := find_fault(path.parent, path.name, listed[path.name]):
        raise BadRun(f"{path}: {fault}; run it again")
    return path
