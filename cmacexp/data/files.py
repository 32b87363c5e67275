"""Writing files atomically, and hashing them."""

import errno
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

REFUSED = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM}
"""Errors of a disk that is full or not writable."""


@contextmanager
def write_atomically(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it to ``path`` when the block succeeds, else remove it.

    Raises:
        OSError: the file cannot be written; the message names it.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        if error.errno not in REFUSED:
            raise
        reason = os.strerror(error.errno).lower()
        raise OSError(f"{path}: cannot be written: {reason}; make room, or choose another folder") from error
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Lock ``folder`` against other processes that lock it; the lock ends with the process."""
    import fcntl

    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def sha256(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of ended processes in ``folder``; not those that a running process writes."""
    for part in folder.glob(".*.part"):
        process = part.suffixes[-2].removeprefix(".") if len(part.suffixes) > 1 else ""
        if process == str(os.getpid()) or not (process.isdecimal() and is_alive(int(process))):
            part.unlink(missing_ok=True)


def is_alive(process: int) -> bool:
    """Whether a process with this number runs."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # it exists, but belongs to another user
        return True
    return True
