"""Result folders that appear complete: written to a hidden folder beside the target, then renamed to it.

A file that this project did not write is never moved or removed: a target folder that contains one is refused, with
the name of that file, before anything is simulated; only files that a result of this project has are removed. An
earlier result is renamed to ``NAME.earlier``, the new one to ``NAME``, then the earlier one is removed: if the
process is killed in between, it stays there, complete. A result that may not replace the earlier one is stored beside
it: a failed run as ``NAME.failed`` beside a run with a result.
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
"""Files of a sweep: its table, its config, and the optimum found by Hydra's sweeper (extra ``optuna``)."""
RUN_KEY = "hydra.run.dir"
"""Override that sets the folder of a run."""
RUN_ARGUMENT = "DIR"
"""Argument of the commands that read a run: its folder."""
OUT_KEY = "--out"
"""Option that sets the folder of a report."""
SWEEP_FILES = (TABLE, TABLE_CSV, SETTINGS, SEARCH, manifests.RUNS_FILE, METRICS_FILE, manifests.JOBS_FOLDER)
"""Files and folders of a sweep besides its manifest."""
LOCK_FILE = ".cmacexp.lock"
"""Name of the file in the folder of a sweep that the sweep keeps locked while it runs."""
LOCK, RESULT, EARLIER = "lock", "result", "earlier"
"""Names in the hidden folder of a result that is being written: the file that its writer keeps locked, the new
result, and the result that it has replaced."""
OTHERS = "holds {}, which is of no earlier result; move it, or choose another folder"
OCCUPIED = {errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR}


@dataclass
class ResultWriter:
    """A result that is being written."""

    folder: Path
    """Target folder; after the writing the actual folder, which differs if the target must not be replaced."""
    part: Path
    """Hidden folder that the files are written to."""
    status: str = Status.COMPLETED
    """How the run ended; a failed or interrupted one never replaces a completed, fallen or diverged one."""
    overtook: bool = False
    """True if it replaced a result that another process had written since the start."""

    def write_text(self, name: str, text: str) -> None:
        """Write a text file to ``name``, a path relative to the result folder."""
        path = self.part / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")

    def list_files(self) -> list[str]:
        """List all files written so far, as paths relative to the result folder, sorted."""
        return sorted(path.relative_to(self.part).as_posix() for path in self.part.rglob("*") if path.is_file())


def _find_kind(folder: Path, key: str) -> str | None:
    """Return the kind of the result in a folder: ``run``, ``report`` or ``sweep``; None without a result.

    Raises BadInput, naming ``key``, if the manifest is damaged or was written by another program.
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
    """Raise BadInput if ``folder`` cannot be replaced by a result of a kind (None: a run).

    It can be if it is missing, is empty, or contains an earlier result of the same kind and nothing else. ``key`` is
    the option or override that named the folder on the command line.
    """
    manifests.require_place(key, folder)
    shell = Path(os.environ.get("PWD", os.sep)).resolve()
    require(
        not os.path.ismount(folder) and folder.resolve() != shell,
        key,
        folder,
        "is a mount point or the current folder, which cannot be replaced as a whole; name a folder in it",
    )
    present_kind = _find_kind(folder, key)
    require(present_kind in (None, kind or "run"), key, folder, f"holds a {present_kind}; choose another folder")
    for name in find_others(folder.resolve(), kind):
        raise BadInput(key, folder, OTHERS.format(name))


def _identify(folder: Path) -> tuple[int, int] | None:
    """Return inode and time of the manifest in ``folder``, which identify a result; None without one."""
    try:
        status = (folder / manifests.MANIFEST).lstat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def _may_replace(folder: Path, kind: str | None, status: str) -> bool:
    """Check whether a folder contains only a result of this kind, which a result of this status may replace."""
    try:
        earlier = manifests.read_file(folder / manifests.MANIFEST)
    except BadRun:
        return False
    is_worse = status not in RESULTS and earlier.get("status") in RESULTS
    return not is_worse and not find_others(folder, kind)


def _number(folder: Path, word: str) -> Iterator[Path]:
    """Yield the paths NAME.word, NAME.word.2, NAME.word.3, ... beside the folder NAME."""
    yield folder.with_name(f"{folder.name}.{word}")
    yield from (folder.with_name(f"{folder.name}.{word}.{number}") for number in count(2))


def _list_targets(folder: Path, status: str) -> Iterator[Path]:
    """Yield the folders to which a result of this status may be moved, in order of preference."""
    yield folder
    yield from _number(folder, status)


def _put(written: Path, folder: Path, kind: str | None, status: str) -> tuple[Path, Path | None]:
    """Move a complete result to ``folder``, or beside it if the content of the folder must not be replaced.

    Returns the new folder of the result, and the folder to which a replaced result was moved, or None. Raises
    OSError.
    """
    for target in _list_targets(folder, status):
        earlier = None
        if os.path.lexists(target) and (target.is_symlink() or not target.is_dir() or any(target.iterdir())):
            if not _may_replace(target, kind, status):
                continue
            earlier = next(path for path in _number(target, EARLIER) if not os.path.lexists(path))
            target.rename(earlier)
        try:
            written.rename(target)
            return target, earlier
        except OSError as error:
            if earlier is not None and not os.path.lexists(target):
                earlier.rename(target)
            if error.errno not in OCCUPIED:  # else another process has just written to the target
                raise
    raise AssertionError("there is always another name")


def _finish(
    result: ResultWriter, hidden: Path, target: Path, kind: str | None, before: tuple[int, int] | None
) -> None:
    """Move a result from its ``hidden`` folder to ``target``, and remove the earlier result of that folder.

    ``before`` is what :func:`_identify` returned for the target when the writing began.
    """
    is_current = target.exists() and os.path.samefile(target, os.curdir)
    folder, earlier = _put(result.part, target, kind, result.status)
    if folder != target:
        text = f"warning: {result.folder} stays as it was; the {result.status} result is in {folder}"
        print(in_one_line(text), file=sys.stderr)
        result.folder = folder if result.folder.is_symlink() else result.folder.with_name(folder.name)
    elif is_current:
        os.chdir(target)
    if earlier is not None:
        result.overtook = _identify(earlier) not in (None, before)
        with suppress(OSError):
            if not find_others(earlier, kind):
                earlier.rename(hidden / EARLIER)  # so that no partly removed result is visible
                return
        print(in_one_line(f"warning: the earlier result of {result.folder} stays in {earlier}"), file=sys.stderr)


def _as_input(error: OSError, folder: Path, key: str) -> BadInput:
    """Return a system error as the input error that ``folder``, named by ``key``, cannot be written."""
    reason = str(error.strerror or error).lower()
    return BadInput(key, folder, f"cannot be written ({reason}); choose another folder")


@contextmanager
def _make_part(target: Path, kind: str | None) -> Iterator[Path]:
    """Make a hidden folder beside ``target`` for the result that will replace it; remove its remains at the end.

    A file in it stays locked while this process lives, so that no other process takes the folder for abandoned.
    """
    hidden = name_part(target)
    unlocked = hidden.with_suffix(".new")  # not locked yet: under this name no process takes it for abandoned
    unlocked.mkdir(parents=True)
    try:
        descriptor = lock(unlocked / LOCK)
        try:
            unlocked.rename(hidden)
            yield hidden
        finally:
            os.close(descriptor)
    finally:
        for folder in (unlocked, hidden):
            _clear_part(folder, kind)


def _clear_part(hidden: Path, kind: str | None) -> None:
    """Remove the hidden folder of a result that nothing writes any more, except for files of other programs in it."""
    shutil.rmtree(hidden / RESULT, ignore_errors=True)  # only its writer writes under this name
    with suppress(OSError):
        remove_own(hidden / EARLIER, kind)
        (hidden / LOCK).unlink(missing_ok=True)
        hidden.rmdir()


def remove_dead_parts(folder: Path, kind: str | None, name: str | None = None) -> None:
    """Remove the hidden folders that killed processes left in ``folder`` while they wrote results of a kind.

    With ``name`` only those of the result of this name. A hidden folder without a lock file, or on a file system
    where locks cannot be tested, stays: it may belong to a running process.
    """
    result_name = "*" if name is None else escape(name[:40])
    for hidden in folder.glob(f".{result_name}.????????.part"):
        with suppress(OSError), open(hidden / LOCK, "rb+") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _clear_part(hidden, kind)


@contextmanager
def new_result(folder: Path, key: str, kind: str | None = None, durable: bool = True) -> Iterator[ResultWriter]:
    """Yield the writer of a result that replaces ``folder`` when the block succeeds; else nothing changes.

    The block writes all files, the manifest included, to :attr:`ResultWriter.part`. ``key`` is the option or override
    that named the folder. If the result may not replace the folder (its status is worse than that of the result
    there, or other files have been written to the folder meanwhile), it is stored beside it under a name that
    contains its status. A power failure can cut short a result that is not ``durable``: its manifest is then missing
    or has wrong hashes. Such results are written into a :func:`collection`, which removes hidden folders itself: to
    search for them beside each of n results would take time of order n^2.

    Raises BadInput before the block as :func:`check_place`, or if nothing can be written beside the folder; OSError
    if a file cannot be written.
    """
    check_place(folder, key, kind)
    target = folder.resolve()
    before = _identify(target)
    with full_disk_named(folder), ExitStack() as stack:
        try:
            hidden = stack.enter_context(_make_part(target, kind))
            result = ResultWriter(folder, hidden / RESULT)
            result.part.mkdir()
        except OSError as error:
            raise _as_input(error, folder, key) from error
        yield result
        for path in (*result.part.rglob("*"), result.part) if durable else ():
            sync(path)
        with interrupt_held_back():
            _finish(result, hidden, target, kind, before)
            if durable:
                sync(target.parent)
                remove_dead_parts(target.parent, kind, target.name)


@contextmanager
def collection(folder: Path, key: str) -> Iterator[Path]:
    """Yield the folder of a sweep, created if missing, and removed at the end if no result was written to it.

    The folder is locked against other sweeps. Hidden folders that killed sweeps left in it are removed at the start,
    those that killed workers left at the end. Its manifest, which marks it as that of a sweep, is written first.

    Raises BadInput if the folder cannot be written, if another sweep uses it, or if it contains another result or,
    without being that of a sweep, a file with the name of one of :data:`SWEEP_FILES`.
    """
    is_new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _as_input(error, folder, key) from error
    kind = _find_kind(folder, key)
    require(kind in (None, manifests.SWEEP), key, folder, f"holds a {kind}; choose another folder")
    for name in SWEEP_FILES:
        require(kind or not os.path.lexists(folder / name), key, folder, OTHERS.format(name))
    with _lock_folder(folder, key):
        if kind is None:
            manifests.write(folder, make_sweep_manifest(Status.UNFINISHED))
        remove_dead_parts(folder, None)
        try:
            yield folder
        finally:
            remove_dead_parts(folder, None)
            is_empty = is_new and set(os.listdir(folder)) == {manifests.MANIFEST, LOCK_FILE}
            if is_empty:
                (folder / manifests.MANIFEST).unlink()
    if is_empty:
        folder.rmdir()


@contextmanager
def _lock_folder(folder: Path, key: str) -> Iterator[None]:
    """Keep the folder of a sweep locked during the block; raises BadInput if another process has locked it."""
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
        if not os.fstat(descriptor).st_size:  # else another program has written to the file
            path.unlink(missing_ok=True)
        os.close(descriptor)


def make_sweep_manifest(
    status: str, files: Mapping[str, str] | None = None, is_lean: bool = False, sweeps: Sequence[str] = ()
) -> dict[str, Any]:
    """Make the manifest of a sweep.

    Args:
        status: Status of the sweep.
        files: SHA-256 of its tables, by file name.
        is_lean: True if some of its jobs have no folders of their own, so that they keep metrics only.
        sweeps: Names of the sweep and of those that it resumes; readers take their parts while it runs.
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
    """Replace some files of a stored run, then update its manifest with their hashes and with ``entries``.

    ``write`` is called with a temporary folder to which it writes the files; it returns the names of those whose
    hashes belong in the manifest. Each file is replaced atomically: after a kill between two replacements hashes are
    wrong until the same command runs again. Raises BadRun without a run, BadInput if its folder cannot be written.
    """
    manifest = manifests.read(folder)
    temporary = name_part(folder / "update")
    try:
        temporary.mkdir()
    except OSError as error:
        raise _as_input(error, folder, RUN_ARGUMENT) from error
    try:
        with full_disk_named(folder):
            hashes = {name: sha256(temporary / name) for name in write(temporary)}
            for path in temporary.iterdir():
                sync(path)
                path.replace(folder / path.name)
            manifests.write(folder, {**manifest, **entries, "files": {**manifest["files"], **hashes}})
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def require_no_link(folder: Path) -> Path:
    """Return ``folder``, the default output folder inside a run; raises BadInput if it is a symbolic link."""
    require(not folder.is_symlink(), OUT_KEY, folder, "is a link, which is not followed; name a folder")
    return folder


def choose_page_folder(out: Path | None, default: Path) -> Path:
    """Return the folder of a report page: ``out`` unless None, else ``default``.

    Raises BadInput if the folder cannot be replaced, see :func:`check_place`, or if ``default`` is a symbolic link.
    """
    folder = require_no_link(default) if out is None else out
    check_place(folder, OUT_KEY, manifests.REPORT)
    return folder
