"""Finding the runs below a folder."""

from pathlib import Path

from cmacexp.data import manifest as manifests
from cmacexp.data.files import NEW, place_of
from cmacexp.errors import BadInput, BadRun

HYDRA = ".hydra"
"""Folder of Hydra's own record, in that of a run."""


def is_run(folder: Path) -> bool:
    """Whether ``folder`` is the folder of a run, complete or not."""
    named = any((folder / name).exists() for name in (manifests.NAME, "trace.parquet", HYDRA, NEW))
    return named and not manifests.is_report(folder)


def runs_below(folder: Path, reports: bool = False) -> list[Path]:
    """``folder`` if it is a run, else all runs below it, in order.

    Args:
        folder: where to look.
        reports: include folders of reports.

    Raises:
        BadRun: the folder does not exist or holds no run.
    """
    if not folder.is_dir():
        raise BadRun(f"{folder}: no such folder")
    if is_run(folder) or (reports and manifests.is_report(folder)):
        return [folder]
    found = sorted({place_of(path.parent) for path in folder.rglob("*") if path.name in (manifests.NAME, HYDRA)})
    found = [path for path in found if reports or is_run(path)]
    if not found:
        raise BadRun(f"{folder}: contains no run; use the folder that a run printed at its end")
    return found


def require_place(key: str, folder: Path) -> Path:
    """``folder`` if it is a folder or can be created.

    Raises:
        BadInput: a file has this path, or that of a parent.
    """
    for path in (folder, *folder.parents):
        if path.exists():
            if not path.is_dir():
                raise BadInput(key, folder, f"must be a folder, which is created if missing; {path} is a file")
            break
    return folder
