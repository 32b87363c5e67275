"""The files that belong to a result; no other file in its folder is ever moved or removed."""

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

HTML = "report.html"
"""Page of a report."""
FIGURES = "figures"
"""Folder of the figures of a report."""
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
"""All files that a run can have, besides the reports in :data:`REPORT_FOLDERS`."""
REPORT_FOLDERS = ("report", "stability")
"""Folders of reports in the folder of a run; a new run replaces them too."""
UNLISTED = (f"{FIGURES}/*.svg", "*.json", "*.yaml", "*.parquet")
"""Patterns for the files of a report of an earlier version, whose manifest, written last, does not list them."""


def list_own(folder: Path, kind: str | None) -> set[str]:
    """List the files of the result of a kind (None: a run) in ``folder``, relative to it; empty without one."""
    with suppress(BadRun):
        manifest = manifests.read_file(folder / manifests.MANIFEST)
        if manifest.get("kind") != kind:
            return set()
        if kind is None:
            return set(RUN_FILES).union(
                *({f"{name}/{file}" for file in list_own(folder / name, manifests.REPORT)} for name in REPORT_FOLDERS)
            )
        return {manifests.MANIFEST, HTML, *(manifest.get("files") or _list_unlisted(folder))}
    return set()


def _list_unlisted(report: Path) -> Iterator[str]:
    """Yield the files of a report of an earlier version: those of :data:`UNLISTED` written before its manifest."""
    written = (report / manifests.MANIFEST).lstat().st_mtime_ns
    for pattern in UNLISTED:
        for path in report.glob(pattern):
            if path.lstat().st_mtime_ns <= written:
                yield path.relative_to(report).as_posix()


def find_others(folder: Path, kind: str | None) -> list[str]:
    """List the files, links and folders in ``folder`` that belong to no result of a kind, relative to it, sorted.

    A folder that cannot be read is listed too.
    """
    result_files = list_own(folder, kind)
    result_paths = result_files | {str(parent) for name in result_files for parent in PurePosixPath(name).parents}
    foreign_paths: list[str] = []
    errors: list[OSError] = []

    def is_foreign(path: Path) -> bool:
        return path.is_symlink() or path.relative_to(folder).as_posix() not in result_paths

    for parent, folders, files in os.walk(folder, onerror=errors.append):
        paths = [Path(parent, name) for name in (*folders, *files) if not is_part(name)]
        foreign_paths += [path.relative_to(folder).as_posix() for path in paths if is_foreign(path)]
        folders[:] = [path.name for path in paths if path.name in folders and not is_foreign(path)]
    foreign_paths += [str(error.filename) for error in errors if not isinstance(error, FileNotFoundError)]
    return sorted(foreign_paths)


def require_own_file(path: Path, mark: bytes, key: str) -> None:
    """Require that the file ``path`` can be replaced: it is missing or, as it contains ``mark``, of this project.

    Raises BadInput, naming ``key``. A file that the user names is replaced without this check.
    """
    if os.path.lexists(path):
        with suppress(OSError), open_file(path) as file:
            if mark in file.read():
                return
        raise BadInput(key, path.parent, f"has a {path.name} that is not of this export; choose another folder")


def remove_own(folder: Path, kind: str | None) -> None:
    """Remove the files of a result of a kind, the manifest last, then the folders that are empty.

    Only files found in the folder are removed: a name in a forged manifest could lead out of it.
    """
    result_files = list_own(folder, kind)
    paths = [Path(parent, name).relative_to(folder) for parent, _, files in os.walk(folder) for name in files]
    for path in sorted(paths, key=lambda path: path.as_posix() == manifests.MANIFEST):
        if path.as_posix() in result_files or any(map(is_part, path.parts)):  # or left by a killed command
            (folder / path).unlink(missing_ok=True)
    for parent, _, _ in os.walk(folder, topdown=False):
        with suppress(OSError):  # the folder is not empty
            os.rmdir(parent)
