"""Which files of a folder are a result's own: nothing else in it is ever moved or removed."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from cmacexp.data import manifest as manifests
from cmacexp.data.files import is_part, open_file
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
from cmacexp.errors import BadInput, BadRun

HTML, FIGURES = "report.html", "figures"
"""The page of a report, and the folder of its figures."""
RUN_FILES = (
    manifests.MANIFEST,
    TRACE_FILE,
    BODY_FILE,
    MEMORY_FILE,
    METRICS_FILE,
    METRICS_CSV,
    BODY_METRICS_FILE,
    WEIGHTS,
    RECORDING_FILE,
    *(f"{manifests.HYDRA_FOLDER}/{name}.yaml" for name in ("config", "hydra", "overrides")),
)
"""All files that a run can consist of, besides the reports in :data:`VIEWS`."""
VIEWS = ("report", "stability")
"""Folders of reports in that of a run; a new run replaces them too."""
UNLISTED = (f"{FIGURES}/*.svg", "*.json", "*.yaml", "*.parquet")
"""Files of a report of earlier versions, whose manifest does not list them; they are older than it."""


def list_own(folder: Path, kind: str | None) -> set[str]:
    """List the files that a result of a kind (None: a run) consists of, relative to its folder; none without one."""
    with suppress(BadRun):
        manifest = manifests.read_file(folder / manifests.MANIFEST)
        if manifest.get("kind") != kind:
            return set()
        if kind is None:
            views = {f"{view}/{name}" for view in VIEWS for name in list_own(folder / view, manifests.REPORT)}
            return {*RUN_FILES, *views}
        return {manifests.MANIFEST, HTML, *(manifest.get("files") or _list_unlisted(folder))}
    return set()


def _list_unlisted(report: Path) -> Iterator[str]:
    """List the files of a report of an earlier version: what is older than its manifest and has such a name."""
    written = (report / manifests.MANIFEST).lstat().st_mtime_ns
    for pattern in UNLISTED:
        for path in report.glob(pattern):
            if path.lstat().st_mtime_ns <= written:
                yield path.relative_to(report).as_posix()


def find_others(folder: Path, kind: str | None) -> list[str]:
    """List what is in a folder but of no result of this kind: files, links and folders, relative to it.

    A folder that cannot be read is listed too.
    """
    own, others, unread = list_own(folder, kind), list[str](), list[OSError]()
    known = own | {parent.as_posix() for name in own for parent in PurePosixPath(name).parents}

    def name_of(path: Path) -> str:
        return path.relative_to(folder).as_posix()

    for place, folders, files in os.walk(folder, onerror=unread.append):
        paths = [Path(place, name) for name in (*folders, *files) if not is_part(name)]
        others += [name_of(path) for path in paths if path.is_symlink() or name_of(path) not in known]
        folders[:] = [path.name for path in paths if path.name in folders and name_of(path) not in others]
    others += [str(error.filename) for error in unread if not isinstance(error, FileNotFoundError)]
    return sorted(others)


def require_own_file(path: Path, mark: bytes, key: str) -> None:
    """Require that a file which is going to be replaced is missing, or of this project, since it contains ``mark``.

    Raises BadInput in the name of ``key``. A file that the user names is replaced without this.
    """
    if os.path.lexists(path):
        with suppress(OSError), open_file(path) as file:
            if mark in file.read():
                return
        raise BadInput(key, path.parent, f"has a {path.name} that is not of this export; choose another folder")


def remove_own(folder: Path, kind: str | None) -> None:
    """Remove a result by the names of its files, the manifest last, and the folders that are empty then.

    A name counts only if the folder holds it: that of a stranger could lead out.
    """
    own = list_own(folder, kind)
    held = [Path(place, name).relative_to(folder) for place, _, files in os.walk(folder) for name in files]
    for path in sorted(held, key=lambda path: path.as_posix() == manifests.MANIFEST):
        if path.as_posix() in own or any(map(is_part, path.parts)):  # or of a command that was killed
            (folder / path).unlink(missing_ok=True)
    for place, _, _ in os.walk(folder, topdown=False):
        with suppress(OSError):  # it is not empty
            os.rmdir(place)
