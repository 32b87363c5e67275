"""Writing a result into its folder: locked against other writers, and replaced as a whole.

Files are written to a hidden folder in that of the result, the new manifest last. From then on they take the place of
the earlier ones, again the manifest last: until then the hashes in the earlier one no longer fit. If a kill
interrupts this, the next writer of the same folder completes it; readers only name it.
"""

import errno
import fcntl
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import HYDRA_FOLDER
from cmacexp.data.files import FAILED, NEW, is_behind_link
from cmacexp.data.tables import (
    BODY_FILE,
    BODY_METRICS_FILE,
    MEMORY_FILE,
    METRICS_CSV,
    METRICS_FILE,
    RECORDING_FILE,
    TRACE_FILE,
)
from cmacexp.data.weights import WEIGHTS
from cmacexp.errors import BadInput, BadRun

LOCK = ".cmacexp-lock"
HTML, FIGURES = "report.html", "figures"
"""The page of a report, and the folder of its figures."""
TABLE, TABLE_CSV = "sweep.parquet", "sweep.csv"
FILES = {
    None: (
        TRACE_FILE,
        BODY_FILE,
        MEMORY_FILE,
        METRICS_FILE,
        METRICS_CSV,
        BODY_METRICS_FILE,
        RECORDING_FILE,
        WEIGHTS,
        f"{HYDRA_FOLDER}/*.yaml",
    ),
    manifests.REPORT: (HTML, "*.json", "*.parquet", f"{FIGURES}/*.svg", f"{FIGURES}/*.png"),
    manifests.SWEEP: (TABLE, TABLE_CSV),
}
"""Files that a writer replaces and removes, besides the manifest, by the kind of the result; a run has no kind."""
RUN_KEY, GIVEN_KEY, OUT_KEY = "hydra.run.dir", "DIR", "--out"
"""What names a folder on the command line: of a run, of commands over runs, of a report."""
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
"""Errors of a disk without room, of a quota, and of a limit on the size of files."""
MAX_ATTEMPTS = 1000
"""Attempts to lock a folder whose lock other processes remove when they end."""
LOCKLESS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}
"""Errors of a file system without locks."""


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


@contextmanager
def write_atomically(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it to ``path`` when the block succeeds, else remove it."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    with full_disk_named(path):
        temporary.unlink(missing_ok=True)
        temporary.touch(exist_ok=False)  # never through a link
        try:
            yield temporary
            _sync(temporary)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)


def _sync(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


@contextmanager
def locked(folder: Path, key: str, wait: bool = False) -> Iterator[None]:
    """Lock ``folder``, which is made if missing, against other processes; the lock ends with the process.

    On a file system without locks nothing is locked. Raises BadInput if it cannot be written, or another process has
    locked it, and this one is not to ``wait``.
    """
    path = folder / LOCK
    try:
        handle = _take_lock(path, folder, key, wait)
    except OSError as error:
        reason = str(error.strerror or error).lower()
        raise BadInput(key, folder, f"cannot be written ({reason}); choose another folder") from error
    try:
        if os.fstat(handle).st_nlink == 1:  # not one that is also a file elsewhere
            os.ftruncate(handle, 0)
            os.write(handle, str(os.getpid()).encode())
        yield
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(handle)


def _take_lock(path: Path, folder: Path, key: str, wait: bool) -> int:
    for _ in range(MAX_ATTEMPTS):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
        except FileNotFoundError:  # the process before removed an empty folder
            continue
        try:
            _acquire(handle, folder, key, wait)
            if path.exists() and os.path.samestat(path.stat(), os.fstat(handle)):
                return handle  # else the process before has removed its lock
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)
    raise OSError(errno.ENOLCK, "no file can be made in it")


def _acquire(handle: int, folder: Path, key: str, wait: bool) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        holder = os.pread(handle, 16, 0)
        process = f"process {holder.decode()}" if holder.isdigit() else "another process"
        raise BadInput(key, folder, f"{process} writes here; wait until it has ended, or choose another") from None
    except OSError as error:
        if error.errno not in LOCKLESS:
            raise


def _is_own(kind: str | None, name: str) -> bool:
    """Whether a writer may replace and remove a file of this name."""
    patterns = (pattern for pattern in FILES[kind] if pattern.count("/") == name.count("/"))
    return name != manifests.MANIFEST and any(fnmatchcase(name, pattern) for pattern in patterns)


@dataclass(frozen=True)
class Place:
    """A locked folder whose result this process replaces."""

    folder: Path
    key: str
    """What names the folder on the command line."""
    kind: str | None
    """Of the result; a run has none."""
    earlier: frozenset[str]
    """Names of the files in the folder that belong to the earlier result."""

    @property
    def new(self) -> Path:
        """Where files are written: below the folder itself, so that they are renamed within one file system."""
        return self.folder / NEW

    def write_text(self, name: str, text: str) -> None:
        """Write a file of text."""
        path = self.new / name
        if not path.parent.exists():
            path.parent.mkdir()
        path.write_text(text, encoding="utf-8")

    def commit(self, manifest: dict[str, Any], sync: bool = True) -> None:
        """Replace the earlier result; files of it that the manifest lists stay.

        Without ``sync`` only the manifest is sure to be on the disk then: a file that a power failure cuts short no
        longer has the hash that the manifest lists. Raises BadInput, and replaces nothing, if the folder holds a file
        of the same name that is not of the earlier result; OSError if the disk refuses a file.
        """
        for name in _list_files(self.new):
            if name in manifest["files"] and name not in self.earlier:
                _refuse_if_taken(self.folder, name, self.key)
            if sync:
                _sync(self.new / name)
        manifests.write(self.new, manifest)
        _sync(self.new / manifests.MANIFEST)
        _replace(self, manifest)


def _list_files(new: Path) -> list[str]:
    files = (path for path in new.rglob("*") if stat.S_ISREG(path.lstat().st_mode))
    return sorted(path.relative_to(new).as_posix() for path in files)


def _replace(place: Place, manifest: dict[str, Any]) -> None:
    """Move what has been written to its place; begun anew after a kill, it comes to the same end."""
    folder, new = place.folder, place.new
    for name in filter(partial(_is_own, place.kind), _list_files(new)):
        if name in manifest["files"] or name.startswith(f"{HYDRA_FOLDER}/"):  # else it did not become whole
            if not (folder / name).parent.exists():
                (folder / name).parent.mkdir()
            (new / name).replace(folder / name)
    for name in place.earlier - manifest["files"].keys():
        (folder / name).unlink(missing_ok=True)
    (new / manifests.MANIFEST).replace(folder / manifests.MANIFEST)
    _remove(new)


def _remove(new: Path) -> None:
    """Remove a folder with all that it holds, or what has its name."""
    if new.is_dir() and not new.is_symlink():
        shutil.rmtree(new, ignore_errors=True)
    else:
        new.unlink(missing_ok=True)


def _refuse_if_taken(folder: Path, name: str, key: str) -> None:
    """Refuse to write a file where something else has its name, a broken link included."""
    if os.path.lexists(folder / name):
        reason = f"holds {name}, which is not listed in the {manifests.MANIFEST} of an earlier result"
        raise BadInput(key, folder, f"{reason}; move it, or choose another folder")


def _open_place(folder: Path, key: str, kind: str | None) -> Place:
    """The place of a result in a locked folder; completes or discards what an interrupted writer of it left."""
    for pattern in FILES[kind]:
        if is_behind_link(folder, pattern):
            raise BadInput(key, folder, f"holds a link in place of a folder with {pattern}; remove it")
    place = Place(folder, key, kind, frozenset(_list_earlier(folder, key, kind)))
    if not place.new.is_symlink():
        with suppress(BadRun):  # it is not whole, so it is discarded
            manifest = manifests.read_file(place.new / manifests.MANIFEST)
            _require_kind(manifest, folder, key, kind)
            _replace(place, manifest)
            place = Place(folder, key, kind, frozenset(_list_earlier(folder, key, kind)))
    _remove(place.new)
    fixed = [name for name in FILES[kind] if "*" not in name]
    foreign = [] if kind or os.path.lexists(folder / manifests.MANIFEST) else [HYDRA_FOLDER]  # of another program
    for name in [*fixed, *foreign]:
        if name not in place.earlier:
            _refuse_if_taken(folder, name, key)
    return place


def _list_earlier(folder: Path, key: str, kind: str | None) -> list[str]:
    """Files of the earlier result that a writer may replace; refuses a manifest of something else."""
    if not os.path.lexists(folder / manifests.MANIFEST):
        return []
    try:
        manifest = manifests.read_file(folder / manifests.MANIFEST)
    except BadRun as error:
        reason = f"holds another {manifests.MANIFEST} ({error}); remove that file, or choose another folder"
        raise BadInput(key, folder, reason) from None
    _require_kind(manifest, folder, key, kind)
    return [name for name in manifest["files"] if _is_own(kind, name)]


def _require_kind(manifest: dict[str, Any], folder: Path, key: str, kind: str | None) -> None:
    if manifest.get("kind") != kind:
        raise BadInput(key, folder, f"holds a {manifest.get('kind', 'run')}; choose another folder")


@contextmanager
def replacing(folder: Path, key: str, kind: str | None = None, wait: bool = False) -> Iterator[Place]:
    """Lock a folder to replace its result; what is not committed in the block is removed at its end.

    The folder is made if missing, and removed if it stays empty. It may hold an earlier result of the same kind, and
    files of other names. ``key`` is what names it on the command line. With ``wait`` another writer ends first.
    Raises BadInput if another process writes there, or something would be replaced that is not of an earlier result.
    """
    made = not folder.exists()
    try:
        with locked(folder, key, wait), full_disk_named(folder):
            place = _open_place(folder, key, kind)
            (folder / FAILED).unlink(missing_ok=True)
            place.new.mkdir()
            try:
                yield place
            finally:
                if not (place.new / manifests.MANIFEST).exists():
                    _remove(place.new)
    finally:
        if made:
            with suppress(OSError):  # it is not empty
                folder.rmdir()


def updating(folder: Path) -> AbstractContextManager[Place]:
    """Lock the folder of a run in which only some files are written anew, see :func:`replacing`; raises BadRun."""
    manifests.read_file(folder / manifests.MANIFEST)
    return replacing(folder, GIVEN_KEY)


def require_no_link(folder: Path) -> Path:
    """``folder``, by default inside that of a run; raises BadInput if it is a link, which could lead out."""
    if folder.is_symlink():
        raise BadInput(OUT_KEY, folder, "is a link, which is not followed; name a folder")
    return folder
