"""Safe file access: only regular files are read, never through a link; files are written atomically."""

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
"""Error numbers for a full disk, an exceeded quota, and an exceeded limit on the file size."""
PART = re.compile(r"\..+\.[0-9a-f]{8}\.(part|new)")
TIME_RESOLUTION = 20_000_000
"""Resolution of file times, ns: two changes of a file within this time may leave it the same times."""


def open_file(path: Path) -> BufferedReader:
    """Open a regular file for reading.

    Raises OSError for anything else: a device or a FIFO could block or be endless, a link could lead anywhere.
    """
    if not stat.S_ISREG(path.lstat().st_mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    safe = os.O_NOFOLLOW | os.O_NONBLOCK  # the file may have been replaced since the check
    return open(path, "rb", opener=lambda name, flags: os.open(name, flags | safe))


def file_signature(path: Path) -> tuple[int, ...]:
    """Return device, inode, size and times of a file, which together differ after every change of the file.

    For a file written within :data:`TIME_RESOLUTION`, whose times could miss another change, the current time is
    added, so that two signatures of it are never equal. Raises OSError if the file is missing.
    """
    status = path.lstat()
    now = time.time_ns()
    times = status.st_mtime_ns, status.st_ctime_ns
    just_written = now - max(times) < TIME_RESOLUTION
    return status.st_dev, status.st_ino, status.st_size, *times, now if just_written else 0


def sha256(path: Path) -> str:
    """Compute the SHA-256 of a file, in hexadecimal; raises OSError as :func:`open_file`."""
    with open_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def full_disk_named(path: Path) -> Iterator[None]:
    """Add ``path`` and a remedy to the error of a full disk; raises OSError."""
    try:
        yield
    except OSError as error:
        if error.errno not in FULL:
            raise
        reason = f"cannot be written: {os.strerror(error.errno).lower()}; make room, or choose another folder"
        raise OSError(f"disk full: {path}: {reason}") from error


def name_part(path: Path) -> Path:
    """Return a new hidden path beside ``path``, for the file or folder that is going to replace it."""
    return path.with_name(f".{path.name[:40]}.{token_hex(4)}.part")


def is_part(name: str) -> bool:
    """Check whether a file name was made by :func:`name_part`; no other program makes such names."""
    return PART.fullmatch(name) is not None


def lock(path: Path) -> int:
    """Open a file, created if missing, lock it, and return its descriptor.

    The lock is released when the descriptor is closed or the process ends. Raises BlockingIOError if another process
    holds the lock, also one on another machine if the file system supports that; OSError if the file cannot be
    opened. On a file system without locks nothing is locked.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise
    except OSError:
        pass
    if not os.fstat(descriptor).st_nlink:  # its last holder has just removed the file
        os.close(descriptor)
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN), str(path))
    return descriptor


def sync(path: Path) -> None:
    """Wait until a file, or the list of names in a folder, is on the disk; raises OSError."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def write_atomically(path: Path, durable: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it to ``path`` when the block succeeds, else remove it.

    With ``durable`` the content is on the disk before the file is renamed: a power failure cannot cut it short.
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
