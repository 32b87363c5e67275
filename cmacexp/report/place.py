"""Folders whose report may be replaced, and those that hold something else."""

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path, PurePosixPath

from cmacexp.data import manifest as manifests
from cmacexp.data.discovery import is_run
from cmacexp.data.files import alone_in
from cmacexp.data.places import read_earlier
from cmacexp.data.staging import Place, refuse_if_taken, replacing
from cmacexp.errors import BadInput

HTML, FIGURES = "report.html", "figures"
"""The page and its figures in the folder of a report."""
OUT_KEY = "--out"


def _is_own(name: str) -> bool:
    """Whether a file that a report lists is one that it wrote; the others, from which it was made, are elsewhere."""
    return PurePosixPath(name).parent in (PurePosixPath(), PurePosixPath(FIGURES))


def _refuse_others(folder: Path, key: str) -> manifests.Manifest | None:
    """Refuse a folder that holds something other than a report; the manifest of the report, if there is one."""
    manifest = read_earlier(folder, key)
    kind = manifest.get("kind", "run") if manifest is not None else "run" if is_run(folder) else manifests.REPORT
    if kind != manifests.REPORT:
        raise BadInput(key, folder, f"is the folder of a {kind}; choose another")
    return manifest


def _find_report(folder: Path, key: str) -> frozenset[str]:
    manifest = _refuse_others(folder, key)
    earlier = frozenset(filter(_is_own, manifest["files"])) if manifest is not None else frozenset[str]()
    if HTML not in earlier:
        refuse_if_taken(folder, HTML, key)
    return earlier


def report_place(folder: Path, key: str = OUT_KEY) -> AbstractContextManager[Place]:
    """Lock the folder of a report, see :func:`cmacexp.data.staging.replacing`.

    Args:
        folder: made if missing; may hold an earlier report, and other files.
        key: what names it on the command line.

    Raises:
        BadInput: another process writes there, or the report would replace what is not of an earlier report.
        OSError: the folder cannot be written.
    """
    return replacing(folder, key, _find_report)


def picture_place(folder: Path, name: str, is_own: Callable[[Path], bool]) -> AbstractContextManager[None]:
    """Lock a folder in which only a picture is written, beside a report or not.

    Args:
        folder: made if missing.
        name: of the picture.
        is_own: whether a file of this name is an earlier picture.

    Raises:
        BadInput: another process writes there, it is the folder of a run, or another file has the name.
        OSError: the folder cannot be written.
    """
    _refuse_others(folder, OUT_KEY)
    if not is_own(folder / name):
        refuse_if_taken(folder, name, OUT_KEY)
    return alone_in(folder, OUT_KEY)


def relative(path: Path, folder: Path) -> str:
    """``path`` relative to ``folder``."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def name_in(place: Place, path: Path) -> str:
    """The name of a file in the manifest of a report: of a new one where it will be, relative to the report."""
    full, new = path.resolve(), place.new.resolve()
    return full.relative_to(new).as_posix() if full.is_relative_to(new) else relative(path, place.folder)
