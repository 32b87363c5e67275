"""Results that appear whole: written to a hidden folder beside their place, and put there by one rename.

A file that this project did not write is never moved or removed: a folder that holds one is refused by name before
anything is simulated, and what is removed is removed by its own names. An earlier result is renamed to
``NAME.earlier``, the new one takes its place, then the earlier one goes: a kill in between leaves it there, whole.
What may not take its place stands beside it: a run that failed as ``NAME.failed`` beside one with a result.
"""

import errno
import fcntl
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from glob import escape
from itertools import count
from pathlib import Path
from typing import Any

from cmacexp.data import manifest as manifests
from cmacexp.data.files import full_disk_named, lock, name_part, sha256, sync
from cmacexp.data.own_files import find_others, remove_own
from cmacexp.data.tables import METRICS_FILE
from cmacexp.errors import BadInput, BadRun, in_one_line, require
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.typing import RESULTS, Status

TABLE, TABLE_CSV, SETTINGS, SEARCH = "sweep.parquet", "sweep.csv", "multirun.yaml", "optimization_results.yaml"
"""What a sweep writes: its table, its config, and what Hydra's sweeper of the extra ``optuna`` found."""
RUN_KEY, GIVEN_KEY, OUT_KEY = "hydra.run.dir", "DIR", "--out"
"""What names a folder on the command line: of a run, of commands over runs, of a report."""
SWEEP_FILES = (TABLE, TABLE_CSV, SETTINGS, SEARCH, manifests.RUNS_FILE, METRICS_FILE, manifests.JOBS_FOLDER)
"""What a sweep writes into its folder besides its manifest."""
LOCK_FILE = ".cmacexp.lock"
"""The file in the folder of a sweep whose lock the sweep holds while it runs."""
LOCK, RESULT, EARLIER = "lock", "result", "earlier"
"""In the hidden folder of a result that is written: the file whose lock its writer holds, the new result, and the one
that it has replaced."""
OTHERS = "holds {}, which is of no earlier result; move it, or choose another folder"
OCCUPIED = {errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR}


@dataclass
class ResultWriter:
    """A result while it is written."""

    folder: Path
    """Where it appears; at the end where it stands, which is beside that if it may not take its place."""
    part: Path
    """The hidden folder that its files are written to."""
    status: str = Status.COMPLETED
    """How it ended; one that failed or was interrupted does not replace one that did not."""
    overtook: bool = False
    """Whether it replaced a result that was not there when it began."""

    def write_text(self, name: str, text: str) -> None:
        """Write a file of text."""
        path = self.part / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def list_files(self) -> list[str]:
        """List all files written so far, relative to the folder."""
        return sorted(path.relative_to(self.part).as_posix() for path in self.part.rglob("*") if path.is_file())


def _find_kind(folder: Path, key: str) -> str | None:
    """Return the kind of the result in a folder, ``run`` if it has none, None without a result.

    Raises BadInput, in the name of ``key``, if its manifest is damaged or of another program.
    """
    if not os.path.lexists(folder / manifests.MANIFEST):
        return None
    try:
        return manifests.read_file(folder / manifests.MANIFEST).get("kind") or "run"
    except BadRun as error:
        raise BadInput(
            key, folder, f"holds another {manifests.MANIFEST} ({error}); remove that file, or choose another folder"
        ) from None


def check_place(folder: Path, key: str, kind: str | None = None) -> None:
    """Raise BadInput if a result cannot take the place of ``folder``, which ``key`` names on the command line.

    It may be missing, empty, or hold an earlier result of the same kind and nothing else.
    """
    manifests.require_place(key, folder)
    shell = Path(os.environ.get("PWD", os.sep)).resolve()
    require(
        not os.path.ismount(folder) and folder.resolve() != shell,
        key,
        folder,
        "is a mount point or the current folder, which cannot be replaced as a whole; name a folder in it",
    )
    found, wanted = _find_kind(folder, key), kind or "run"
    require(found in (None, wanted), key, folder, f"holds a {found}; choose another folder")
    for name in find_others(folder.resolve(), kind):
        raise BadInput(key, folder, OTHERS.format(name))


def _identify(folder: Path) -> tuple[int, int] | None:
    """Return what distinguishes a result from any other in its place; None without one."""
    try:
        status = (folder / manifests.MANIFEST).lstat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def _may_replace(folder: Path, kind: str | None, status: str) -> bool:
    """Check whether a folder holds a result of this kind, nothing else, and none better than one of this status."""
    try:
        earlier = manifests.read_file(folder / manifests.MANIFEST)
    except BadRun:
        return False
    is_worse = status not in RESULTS and earlier.get("status") in RESULTS
    return not is_worse and not find_others(folder, kind)


def _number(folder: Path, word: str) -> Iterator[Path]:
    """Yield the names beside ``folder`` that add ``word`` to its own: NAME.word, NAME.word.2, ..."""
    yield folder.with_name(f"{folder.name}.{word}")
    yield from (folder.with_name(f"{folder.name}.{word}.{number}") for number in count(2))


def _list_places(folder: Path, status: str) -> Iterator[Path]:
    """Yield the places in which a result of this status may stand, the best one first."""
    yield folder
    yield from _number(folder, status)


def _put(written: Path, folder: Path, kind: str | None, status: str) -> tuple[Path, Path | None]:
    """Put a whole result in its place, or beside it if something there must stay; raises OSError.

    Returns where it stands, and where the result stands that it replaced, if any.
    """
    for place in _list_places(folder, status):
        earlier = None
        if os.path.lexists(place) and (place.is_symlink() or not place.is_dir() or any(place.iterdir())):
            if not _may_replace(place, kind, status):
                continue
            earlier = next(path for path in _number(place, EARLIER) if not os.path.lexists(path))
            place.rename(earlier)
        try:
            written.rename(place)
            return place, earlier
        except OSError as error:
            if earlier is not None and not os.path.lexists(place):
                earlier.rename(place)
            if error.errno not in OCCUPIED:  # else another writer was there first
                raise
    raise AssertionError("there is always another name")


def _finish(result: ResultWriter, part: Path, place: Path, kind: str | None, before: tuple[int, int] | None) -> None:
    """Put a result in its place, and remove the earlier one there."""
    is_current = place.exists() and os.path.samefile(place, os.curdir)
    stands, earlier = _put(result.part, place, kind, result.status)
    if stands != place:
        text = f"warning: {result.folder} stays as it was; the {result.status} result is in {stands}"
        print(in_one_line(text), file=sys.stderr)
        result.folder = stands if result.folder.is_symlink() else result.folder.with_name(stands.name)
    elif is_current:
        os.chdir(place)
    if earlier is not None:
        result.overtook = _identify(earlier) not in (None, before)
        with suppress(OSError):
            if not find_others(earlier, kind):
                earlier.rename(part / EARLIER)  # where nobody looks: a kill leaves no half of a result
                return
        print(in_one_line(f"warning: the earlier result of {result.folder} stays in {earlier}"), file=sys.stderr)


def _as_input(error: OSError, given: Path, key: str) -> BadInput:
    """Return an error of the system as one of the folder ``given``, which cannot be written."""
    reason = str(error.strerror or error).lower()
    return BadInput(key, given, f"cannot be written ({reason}); choose another folder")


@contextmanager
def _make_part(place: Path, kind: str | None) -> Iterator[Path]:
    """Make a hidden folder beside ``place`` for what is going to take its place; remove what is left at the end.

    While this process lives it holds the lock of a file in it, so that no other takes it for abandoned.
    """
    part = name_part(place)
    unlocked = part.with_suffix(".new")  # nobody looks for this name: the folder has no lock yet
    unlocked.mkdir(parents=True)
    try:
        descriptor = lock(unlocked / LOCK)
        try:
            unlocked.rename(part)
            yield part
        finally:
            os.close(descriptor)
    finally:
        for folder in (unlocked, part):
            _clear_part(folder, kind)


def _clear_part(part: Path, kind: str | None) -> None:
    """Remove the hidden folder of a result that is not written any more; nothing of others, if anything is there."""
    shutil.rmtree(part / RESULT, ignore_errors=True)  # a name that only its writer knows
    with suppress(OSError):
        remove_own(part / EARLIER, kind)
        (part / LOCK).unlink(missing_ok=True)
        part.rmdir()


def remove_dead_parts(folder: Path, kind: str | None, name: str | None = None) -> None:
    """Remove what killed writers of results of a kind left in a folder, beside the result ``name`` or beside any.

    What has no lock, or one that cannot be tried here, may belong to a process that lives, and stays.
    """
    beside = "*" if name is None else escape(name[:40])
    for part in folder.glob(f".{beside}.????????.part"):
        with suppress(OSError), open(part / LOCK, "rb+") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _clear_part(part, kind)


@contextmanager
def new_result(folder: Path, key: str, kind: str | None = None, durable: bool = True) -> Iterator[ResultWriter]:
    """Write a result, which takes the place of ``folder`` when the block has succeeded; else nothing changes.

    The files are written to ``part``, the manifest too. ``key`` names the folder on the command line. Where the
    result may not take its place (it is worse than the one there, or others have written to the folder meanwhile) it
    stands beside it, by a name that says how it ended. A power failure can cut short what is not ``durable``, whose
    manifest then is none, or has hashes that do not fit. Such a result is one of a :func:`collection`, which has
    removed what was left beside it: to look for that beside each of many results takes longer the more there are.
    Raises BadInput before the block as :func:`check_place`, or if nothing can be written beside the folder; OSError
    if the disk refuses a file.
    """
    check_place(folder, key, kind)
    place = folder.resolve()
    before = _identify(place)
    with full_disk_named(folder), ExitStack() as stack:
        try:
            part = stack.enter_context(_make_part(place, kind))
            result = ResultWriter(folder, part / RESULT)
            result.part.mkdir()
        except OSError as error:
            raise _as_input(error, folder, key) from error
        yield result
        for path in (*result.part.rglob("*"), result.part) if durable else ():
            sync(path)
        with interrupt_held_back():
            _finish(result, part, place, kind, before)
            if durable:
                sync(place.parent)
                remove_dead_parts(place.parent, kind, place.name)


@contextmanager
def collection(folder: Path, key: str) -> Iterator[Path]:
    """Yield a folder for the results of a sweep, made if missing, and removed if it stays empty.

    No other sweep can use it meanwhile. What killed sweeps left in it is removed, and at the end what killed workers
    left. A manifest marks it as the folder of a sweep before anything else is written.

    Raises BadInput if it cannot be written, another sweep runs there, or it holds another result, or files with the
    names of a sweep's that none wrote.
    """
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _as_input(error, folder, key) from error
    found = _find_kind(folder, key)
    require(found in (None, manifests.SWEEP), key, folder, f"holds a {found}; choose another folder")
    for name in SWEEP_FILES:
        require(found or not os.path.lexists(folder / name), key, folder, OTHERS.format(name))
    with _lock_folder(folder, key):
        if found is None:
            manifests.write(folder, make_sweep_manifest(Status.UNFINISHED))
        remove_dead_parts(folder, None)
        try:
            yield folder
        finally:
            remove_dead_parts(folder, None)
            is_empty = made and set(os.listdir(folder)) == {manifests.MANIFEST, LOCK_FILE}
            if is_empty:
                (folder / manifests.MANIFEST).unlink()
    if made and is_empty:
        folder.rmdir()


@contextmanager
def _lock_folder(folder: Path, key: str) -> Iterator[None]:
    """Hold the lock of a file in the folder of a sweep; raises BadInput if another process holds it."""
    path = folder / LOCK_FILE
    try:
        descriptor = lock(path)
    except BlockingIOError:
        raise BadInput(key, folder, "another sweep runs there; wait for its end, or choose another folder") from None
    except OSError as error:
        raise _as_input(error, folder, key) from error
    try:
        yield
    finally:
        if not os.fstat(descriptor).st_size:  # else somebody has written into it
            path.unlink(missing_ok=True)
        os.close(descriptor)


def make_sweep_manifest(
    status: str, files: Mapping[str, str] | None = None, is_lean: bool = False, sweeps: Sequence[str] = ()
) -> dict[str, Any]:
    """Make the manifest of a sweep, with the hashes of its tables; lean if some of its jobs have no folders.

    ``sweeps`` are the names of the sweep and of those that it resumes, whose parts of tables count while it runs.
    """
    return {
        "kind": manifests.SWEEP,
        "status": status,
        "versions": manifests.read_environment().versions,
        "files": dict(files or {}),
        "config": {"record": {"trace": False}} if is_lean else {},
        "sweeps": list(sweeps),
    }


def update_run(folder: Path, write: Callable[[Path], list[str]], **entries: Any) -> None:
    """Write some files of a run anew, and other entries of its manifest, which follows them.

    ``write`` is called with the folder that they are written to, and returns the names of those with a hash in the
    manifest. Each file is replaced in one step: a kill between two of them leaves hashes that do not fit, until the
    same command has run again. Raises BadRun if there is no run, BadInput if its folder cannot be written.
    """
    manifest = manifests.read(folder)
    part = name_part(folder / "update")
    try:
        part.mkdir()
    except OSError as error:
        raise _as_input(error, folder, GIVEN_KEY) from error
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
