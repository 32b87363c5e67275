"""Files that appear under their final name only when they are whole."""

import errno
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

REFUSED = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM}
"""What a disk says that is full, or not ours to write on."""


@contextmanager
def write_atomically(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``; rename it to ``path`` when the block ends well, else remove it.

    Raises:
        OSError: the disk does not take it; says which file.
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
    """Wait until no other process holds ``folder`` by this, and hold it; an ended process holds nothing."""
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
    """Remove what processes that were killed left of files in ``folder``; not what a living one is writing."""
    for part in folder.glob(".*.part"):
        process = part.suffixes[-2].removeprefix(".") if len(part.suffixes) > 1 else ""
        if process == str(os.getpid()) or not (process.isdecimal() and is_alive(int(process))):
            part.unlink(missing_ok=True)


def is_alive(process: int) -> bool:
    """Whether a process of this number runs."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # not ours to signal, so there is one
        return True
    return True
