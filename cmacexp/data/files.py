"""Writing files atomically, locking a folder, and hashing files."""

import errno
import fcntl
import hashlib
import os
import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cmacexp.errors import BadInput

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
"""Errors of a disk without room, of a quota, and of a limit on the size of files."""
REFUSED = {*FULL, errno.EROFS, errno.EACCES, errno.EPERM}
"""Errors of a disk that is full or not writable."""
LOCKLESS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}
"""Errors of a file system without locks."""
NEW, FAILED, LOCK = ".cmacexp-new", ".cmacexp-failed", ".cmacexp-lock"
"""In the folder of a result: what is being written, the record of an attempt that failed, and the lock."""


class DiskFull(OSError):
    """There is no room for a file; the message names it."""


def place_of(folder: Path) -> Path:
    """The folder of a result, given that folder or the one in it where the next result is being written."""
    return folder.parent if folder.name in (NEW, FAILED) else folder


def name_refusal(path: Path, error: OSError) -> OSError:
    """What to raise when the disk refused to write ``path``; ``error`` itself for other errors."""
    if error.errno not in REFUSED:
        return error
    kind, what = (DiskFull, "disk full: ") if error.errno in FULL else (OSError, "")
    shown, reason = Path(*(part for part in path.parts if part != NEW)), os.strerror(error.errno).lower()
    return kind(f"{what}{shown}: cannot be written: {reason}; make room, or choose another folder")


@contextmanager
def write_atomically(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it to ``path`` when the block succeeds, else remove it.

    Raises:
        DiskFull: there is no room for the file; the message names it.
        OSError: the file cannot be written; likewise.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield temporary
        with temporary.open("rb+") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        refusal = name_refusal(path, error)
        if refusal is error:
            raise
        raise refusal from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def allocate(path: Path, size: int, final: Path) -> None:
    """Take space on disk for a file, so that writing it cannot fail for want of it.

    On a file system that cannot do that nothing happens.

    Args:
        path: where it is written, made if missing; becomes that large, but stays as it is if there is no room.
        size: in bytes.
        final: the path that the message names.

    Raises:
        DiskFull: there is no room.
    """
    with path.open("ab") as file:
        before = os.fstat(file.fileno()).st_size
        try:
            os.posix_fallocate(file.fileno(), 0, size)
        except OSError as error:
            if error.errno in FULL:
                os.ftruncate(file.fileno(), before)
                raise name_refusal(final, error) from error


@contextmanager
def alone_in(folder: Path, key: str, wait: bool = False) -> Iterator[None]:
    """Lock ``folder``, which is made if missing, against other processes; the lock ends with the process.

    On a file system without locks nothing is locked.

    Args:
        folder: to lock.
        key: what names the folder on the command line, for the message.
        wait: until another process unlocks it.

    Raises:
        BadInput: another process has locked it, and this one is not to wait; the folder cannot be made or written.
    """
    path = folder / LOCK
    try:
        handle = _lock(path, folder, key, wait)
    except OSError as error:
        raise BadInput(key, folder, f"cannot be written: {error.strerror}; choose another folder") from error
    while not _is_file(path, handle):  # the process before removed the file between the two calls
        os.close(handle)
        handle = _lock(path, folder, key, wait)
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(handle)


def _lock(path: Path, folder: Path, key: str, wait: bool) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    try:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except FileNotFoundError:  # the process before removed an empty folder
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        os.pwrite(handle, f"{os.getpid():<20}".encode(), 0)
    except BlockingIOError:
        process = os.pread(handle, 20, 0).decode().strip()
        os.close(handle)
        reason = f"process {process} writes here; wait until it has ended, or choose another folder"
        raise BadInput(key, folder, reason) from None
    except OSError as error:
        if error.errno not in LOCKLESS:
            os.close(handle)
            raise
    return handle


def _is_file(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.stat(path), os.fstat(handle))
    except FileNotFoundError:
        return False


def sha256(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def remove_leftovers(folder: Path, names: Collection[str]) -> None:
    """Remove what killed processes left of writing the files ``names``; ``folder`` is locked."""
    for part in folder.glob(".*.part"):
        found = re.fullmatch(r"\.(.+)\.\d+\.part", part.name)
        if found and found[1] in names:
            part.unlink(missing_ok=True)
