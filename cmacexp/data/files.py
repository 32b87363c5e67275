"""Reading files that others may have made: regular ones alone, and never through a link."""

import errno
import hashlib
import os
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from glob import escape
from io import BufferedReader
from pathlib import Path
from secrets import token_hex

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
"""Errors of a disk without room, of a quota, and of a limit on the size of files."""
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
    """A new hidden name beside ``path``, for what is going to take its place; it says whose it is."""
    return path.with_name(f".{path.name[:40]}.{os.uname().nodename}.{os.getpid()}.{token_hex(4)}.part")


def remove_dead_parts(folder: Path, name: str | None = None) -> None:
    """Remove what killed processes of this machine left in a folder, beside the result ``name`` or beside any.

    Those of other machines may be alive.
    """
    beside = "*" if name is None else escape(name[:40])
    for part in folder.glob(f".{beside}.{escape(os.uname().nodename)}.*.????????.part"):
        process = part.name.split(".")[-3]
        if process.isdecimal() and not _is_alive(int(process)):
            shutil.rmtree(part, ignore_errors=True)


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True


def sync(path: Path) -> None:
    """Wait until a file is on the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


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
        finally:
            temporary.unlink(missing_ok=True)
