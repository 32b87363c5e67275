"""Files that others may have made are read with care: only regular ones, never through a link; ours appear whole."""

import errno
import fcntl
import hashlib
import os
import re
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from secrets import token_hex

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
"""Errors of a disk without room, of a quota, and of a limit on the size of files."""
PART = re.compile(r"\..+\.[0-9a-f]{8}\.(part|new)")
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


def sha256(path: Path) -> str:
    """SHA-256 of a file; raises OSError as :func:`open_file`."""
    with open_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def full_disk_named(path: Path) -> Iterator[None]:
    """Name what is written in the error of a full disk, and say what helps; raises OSError."""
    try:
        yield
    except OSError as error:
        if error.errno not in FULL:
            raise
        reason = f"cannot be written: {os.strerror(error.errno).lower()}; make room, or choose another folder"
        raise OSError(f"disk full: {path}: {reason}") from error


def name_part(path: Path) -> Path:
    """Return a new hidden name beside ``path``, for what is going to take its place."""
    return path.with_name(f".{path.name[:40]}.{token_hex(4)}.part")


def is_part(name: str) -> bool:
    """Check whether a name is one of :func:`name_part`; no other program makes such names."""
    return PART.fullmatch(name) is not None


def lock(path: Path) -> int:
    """Open a file, made if missing, and hold its lock; the lock ends with the process, or when the file is closed.

    Returns its descriptor. Raises BlockingIOError if another process holds the lock, on any machine if the file
    system passes locks on; OSError if the file cannot be opened. A file system without locks holds nothing.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise
    except OSError:
        pass
    if not os.fstat(descriptor).st_nlink:  # who held it has just removed the file
        os.close(descriptor)
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN), str(path))
    return descriptor


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk; raises OSError."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def write_atomically(path: Path, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it to ``path`` when the block succeeds, else remove it.

    A ``durable`` file is on the disk before it has its name.
    """
    temporary = name_part(path)
    with full_disk_named(path):
        temporary.touch(exist_ok=False)  # never through a link
        try:
            yield temporary
            if durable:
                sync(temporary)
            temporary.replace(path)
            if durable:
                sync(path.parent)
        finally:
            temporary.unlink(missing_ok=True)
