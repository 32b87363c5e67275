"""Results that appear whole: written to a hidden folder beside their place, and put there by one rename.

Onto an earlier result the two folders are exchanged, so that its place holds a whole result at every moment, whatever
is killed. Nothing is locked: of two writers the last one wins. What a killed writer leaves is its hidden folder,
``.NAME.MACHINE.PROCESS.RANDOM.part``. No reader looks into it, and the next result in the same place removes it.
"""

import ctypes
import errno
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from cmacexp.data import manifest as manifests
from cmacexp.data.files import full_disk_named, name_part, remove_dead_parts, sha256, sync
from cmacexp.data.tables import (
    BODY_FILE,
    BODY_METRICS_FILE,
    MEMORY_FILE,
    METRICS_CSV,
    METRICS_FILE,
    RECORDING_FILE,
    TRACE_FILE,
    WEIGHTS,
)
from cmacexp.errors import BadInput, BadRun, require
from cmacexp.jit.interrupt import interrupt_held_back

HTML, FIGURES = "report.html", "figures"
"""The page of a report, and the folder of its figures."""
TABLE, TABLE_CSV = "sweep.parquet", "sweep.csv"
RUN_KEY, GIVEN_KEY, OUT_KEY = "hydra.run.dir", "DIR", "--out"
"""What names a folder on the command line: of a run, of commands over runs, of a report."""
PARTS = (".*.????????.part", ".cmacexp-*")
"""What killed writers leave, those of earlier versions too."""
OWN = {
    None: (
        manifests.MANIFEST,
        TRACE_FILE,
        BODY_FILE,
        MEMORY_FILE,
        METRICS_FILE,
        METRICS_CSV,
        BODY_METRICS_FILE,
        WEIGHTS,
        manifests.HYDRA_FOLDER,
        RECORDING_FILE,
        "report",
        "stability",
    ),
    manifests.REPORT: (manifests.MANIFEST, HTML, FIGURES, "*.json", "*.yaml", "*.parquet"),
}
"""What a result consists of, its views included, by its kind; a run has no kind. A new result replaces all of it."""
FOREIGN = "holds {}, which is of no earlier result; move it, or choose another folder"
LOGS = "*.log"
"""What Hydra writes into the folder of a run, before and while it runs, if it is asked to."""
RENAME_EXCHANGE, AT_FDCWD = 2, -100
"""Arguments of ``renameat2`` (Linux)."""
CANNOT_EXCHANGE = {errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP}
"""Errors of a system or a file system that cannot exchange two folders."""
OCCUPIED = {errno.ENOTEMPTY, errno.EEXIST}


@dataclass
class ResultWriter:
    """A result while it is written."""

    folder: Path
    """Where it appears."""
    part: Path
    """The hidden folder that its files are written to."""
    overtook: bool = False
    """Whether it replaced a result that was not there when it began."""

    def write_text(self, name: str, text: str) -> None:
        """Write a file of text."""
        path = self.part / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _is_own(name: str, kind: str | None) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in (*OWN[kind], *PARTS))


def _check_kind(folder: Path, key: str, kind: str | None) -> bool:
    """Whether a folder holds a result of a kind; raises BadInput if it holds one of another or a damaged one."""
    if not os.path.lexists(folder / manifests.MANIFEST):
        return False
    try:
        found = manifests.read_file(folder / manifests.MANIFEST).get("kind")
    except BadRun as error:
        raise BadInput(
            key, folder, f"holds another {manifests.MANIFEST} ({error}); remove that file, or choose another folder"
        ) from None
    require(found == kind, key, folder, f"holds a {found or 'run'}; choose another folder")
    return True


def check_place(folder: Path, key: str, kind: str | None = None) -> None:
    """Raise BadInput if a result cannot take the place of ``folder``, which ``key`` names on the command line.

    It may be missing, empty, or an earlier result of the same kind. Hidden files of others and logs stay in it.
    """
    manifests.require_place(key, folder)
    shell = Path(os.environ.get("PWD", os.sep)).resolve()
    require(
        not os.path.ismount(folder) and folder.resolve() != shell,
        key,
        folder,
        "is a mount point or the current folder, which cannot be replaced as a whole; name a folder in it",
    )
    holds_result = _check_kind(folder, key, kind)
    for name in sorted(os.listdir(folder)) if folder.exists() else ():
        is_harmless = name[0] == "." or fnmatchcase(name, LOGS)
        require(is_harmless or (holds_result and _is_own(name, kind)), key, folder, FOREIGN.format(name))


def _identify(folder: Path) -> tuple[int, int] | None:
    """What distinguishes a result from any other in its place; None: there is none."""
    try:
        status = (folder / manifests.MANIFEST).lstat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def _exchange(first: Path, second: Path) -> bool:
    """Exchange two folders in one step; whether the system can. Raises OSError."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    if not rename(AT_FDCWD, os.fsencode(first), AT_FDCWD, os.fsencode(second), RENAME_EXCHANGE):
        return True
    if (number := ctypes.get_errno()) in CANNOT_EXCHANGE:
        return False
    raise OSError(number, os.strerror(number), str(second))


def _put(part: Path, folder: Path) -> Path:
    """Put a whole result in its place; where what was there before is now, if there was anything."""
    old = part
    while True:
        try:
            part.rename(folder)
            return old
        except OSError as error:
            if error.errno not in OCCUPIED:
                raise
        with suppress(FileNotFoundError):  # another writer has just moved it
            if _exchange(part, folder):
                return part
            old = folder.rename(name_part(folder))


def _finish(result: ResultWriter, place: Path, kind: str | None, before: tuple[int, int] | None) -> None:
    """Put a result in its place, with the files of others that were there, and remove the earlier one."""
    is_current = place.exists() and os.path.samefile(place, os.curdir)
    old = _put(result.part, place)
    if is_current:
        os.chdir(place)
    if old.exists():
        result.overtook = _identify(old) not in (None, before)
        for name in os.listdir(old):
            if not _is_own(name, kind):
                (old / name).rename(place / name)
        shutil.rmtree(old, ignore_errors=True)


def _make(folder: Path, given: Path, key: str) -> None:
    """Make a folder, with those that it lies in; raises BadInput for the one ``given`` if that is not allowed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = str(error.strerror or error).lower()
        raise BadInput(key, given, f"cannot be written ({reason}); choose another folder") from error


@contextmanager
def new_result(folder: Path, key: str, kind: str | None = None, durable: bool = True) -> Iterator[ResultWriter]:
    """Write a result, which takes the place of ``folder`` when the block has succeeded; else nothing changes.

    The files are written to ``part``, the manifest too. ``key`` names the folder on the command line. A power
    failure can cut short what is not ``durable``, whose manifest then is none, or has hashes that do not fit. Such a
    result is one of a :func:`collection`, which has removed what was left beside it: to look for that beside each of
    many results takes longer the more there are. Raises BadInput before the block as :func:`check_place`, or if
    nothing can be written beside the folder; OSError if the disk refuses a file.
    """
    check_place(folder, key, kind)
    place = folder.resolve()
    before, result = _identify(place), ResultWriter(folder, name_part(place))
    _make(result.part, folder, key)
    try:
        with full_disk_named(folder):
            yield result
            for path in result.part.rglob("*") if durable else ():
                if path.is_file():
                    sync(path)
            with interrupt_held_back():
                _finish(result, place, kind, before)
                if durable:
                    remove_dead_parts(place.parent, place.name)
    finally:
        shutil.rmtree(result.part, ignore_errors=True)


@contextmanager
def collection(folder: Path, key: str) -> Iterator[Path]:
    """A folder for the results of a sweep, made if missing, and removed if it stays empty.

    What killed sweeps of this machine left in it is removed, and at the end what its ended workers left.

    Raises BadInput if it cannot be written, or if it holds another result, or tables that no sweep wrote.
    """
    made = not folder.exists()
    _make(folder, folder, key)
    is_sweep = _check_kind(folder, key, manifests.SWEEP)
    for name in (TABLE, TABLE_CSV):
        require(is_sweep or not os.path.lexists(folder / name), key, folder, FOREIGN.format(name))
    remove_dead_parts(folder)
    try:
        yield folder
    finally:
        remove_dead_parts(folder)
        if made:
            with suppress(OSError):  # it is not empty
                folder.rmdir()


def update_run(folder: Path, write: Callable[[Path], list[str]], **entries: Any) -> None:
    """Write some files of a run anew, and other entries of its manifest, which follows them.

    ``write`` is called with the folder that they are written to, and returns the names of those with a hash in the
    manifest. Each file is replaced in one step: a kill between two of them leaves hashes that do not fit, until the
    same command has run again. Raises BadRun if there is no run, BadInput if its folder cannot be written.
    """
    manifest = manifests.read(folder)
    part = name_part(folder / "update")
    _make(part, folder, GIVEN_KEY)
    try:
        with full_disk_named(folder):
            names = write(part)
            hashes = {name: sha256(part / name) for name in names}
            for path in part.iterdir():
                sync(path)
                path.replace(folder / path.name)
            manifests.write(folder, {**manifest, **entries, "files": {**manifest["files"], **hashes}})
    finally:
        shutil.rmtree(part, ignore_errors=True)


def require_no_link(folder: Path) -> Path:
    """``folder``, by default inside that of a run; raises BadInput if it is a link, which could lead out."""
    require(not folder.is_symlink(), OUT_KEY, folder, "is a link, which is not followed; name a folder")
    return folder


def choose_page_folder(out: Path | None, default: Path) -> Path:
    """The folder of a page: ``out`` if it is given, else the default one, which is no link.

    Raises BadInput if a page cannot take its place.
    """
    folder = require_no_link(default) if out is None else out
    check_place(folder, OUT_KEY, manifests.REPORT)
    return folder
