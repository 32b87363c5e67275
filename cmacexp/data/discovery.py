"""Finding the runs below a folder."""

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from cmacexp.data import manifest as manifests
from cmacexp.errors import BadInput, BadRun

HYDRA_FOLDER = ".hydra"
RUNS_FILE, JOBS_FOLDER = "runs.parquet", ".jobs"
"""Of a sweep: its jobs beside their metrics; parts of both while it runs."""


def is_run(folder: Path) -> bool:
    """Whether ``folder`` is the folder of a run, complete or not."""
    if os.path.lexists(folder / manifests.MANIFEST):
        try:
            found = manifests.read_file(folder / manifests.MANIFEST).get("kind")
            return found not in (manifests.REPORT, manifests.SWEEP)
        except BadRun:
            return True
    return os.path.lexists(folder / "trace.parquet")


def _holds_jobs(folder: Path) -> bool:
    """Whether the manifest of a sweep lists tables of its jobs, which have no folders."""
    manifest = manifests.read_file(path) if os.path.lexists(path := folder / manifests.MANIFEST) else {}
    return manifest.get("kind") == manifests.SWEEP and bool(manifest["files"])


def walk(folder: Path, skipped: Callable[[OSError], None] | None = None) -> Iterator[Path]:
    """``folder`` and all folders below it, but for hidden ones; links are not followed.

    ``skipped`` is called with the error of a folder that cannot be read.
    """
    for place, inside, _ in os.walk(folder, onerror=skipped):
        inside[:] = sorted(name for name in inside if name[0] != ".")
        yield Path(place)


def name_of(folder: Path) -> str:
    """The name of the folder of a run; that of a job of a sweep includes the name of the sweep."""
    path = folder.resolve()
    return f"{path.parent.name}_{path.name}" if path.name.isdecimal() else path.name


def _require_some(folder: Path, paths: Iterable[Path]) -> list[Path]:
    if not folder.is_dir():
        raise BadRun(f"{folder}: no such folder")
    if ordered := sorted(paths):
        return ordered
    if (folder / RUNS_FILE).exists() or (folder / JOBS_FOLDER).exists():
        raise BadRun(f"{folder}: its runs keep metrics alone (record=metrics), without folders; use record=trace")
    raise BadRun(f"{folder}: contains no run; use the folder that a run printed at its end")


def _refuse(error: OSError) -> None:
    raise BadRun(f"{error.filename}: cannot be read ({error.strerror})")


def runs_below(folder: Path) -> list[Path]:
    """``folder`` if it is a run, else all runs below it, in order; raises BadRun if there is none to be read."""
    if not folder.is_dir() or is_run(folder):
        return _require_some(folder, [folder])
    return _require_some(folder, filter(is_run, walk(folder, _refuse)))


def everything_below(folder: Path) -> list[Path]:
    """All that can be verified: runs from ``folder`` on, inside of runs too, in order.

    A folder that cannot be read is one of them. Raises BadRun if there is nothing.
    """
    unreadable: list[OSError] = []
    runs = {place for place in walk(folder, unreadable.append) if is_run(place) or _holds_jobs(place)}
    return _require_some(folder, runs.union(Path(error.filename) for error in unreadable))


def require_place(key: str, folder: Path) -> Path:
    """``folder`` if it is a folder or can be created; raises BadInput if it or a parent is a file."""
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    if not nearest.is_dir():
        raise BadInput(key, folder, f"must be a folder, which is created if missing; {nearest} is a file")
    return folder
