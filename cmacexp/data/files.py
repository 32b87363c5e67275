"""Reading files that others may have made: regular ones alone, and never through a link."""

import errno
import hashlib
import os
import stat
import time
from io import BufferedReader
from pathlib import Path, PurePosixPath

NEW, FAILED = ".cmacexp-new", ".cmacexp-failed.json"
"""In the folder of a result: the next one while it is written, and the record of an attempt that failed."""
TIME_RESOLUTION = 20_000_000
"""Two changes of a file within so many nanoseconds may leave it the same times."""


def open_file(path: Path) -> BufferedReader:
    """Open a regular file for reading; raises OSError.

    A device or a FIFO could block or be endless; a link could lead anywhere.
    """
    if not stat.S_ISREG(path.lstat().st_mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    safe = os.O_NOFOLLOW | os.O_NONBLOCK  # it may have been replaced since
    return open(path, "rb", opener=lambda name, flags: os.open(name, flags | safe))


def file_signature(path: Path) -> tuple[int, ...]:
    """What changes whenever a file changes, unless it has just been written: device, inode, size and times.

    Of one that has just been written it is never the same twice. Raises OSError if there is none.
    """
    status, now = path.lstat(), time.time_ns()
    times = status.st_mtime_ns, status.st_ctime_ns
    just_written = now - max(times) < TIME_RESOLUTION
    return status.st_dev, status.st_ino, status.st_size, *times, now if just_written else 0


def is_behind_link(folder: Path, name: str) -> bool:
    """Whether the way from ``folder`` to the file ``name`` leads through a link."""
    parts = PurePosixPath(name).parts
    return any(folder.joinpath(*parts[:count]).is_symlink() for count in range(1, len(parts)))


def sha256(path: Path) -> str:
    """SHA-256 of a file; raises OSError as :func:`open_file`."""
    with open_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
