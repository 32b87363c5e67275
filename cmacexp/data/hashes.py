"""Whether a file of a run is as the run wrote it: everything that reads one asks here first."""

import os
from functools import lru_cache
from pathlib import Path

from cmacexp.data import manifest as manifests
from cmacexp.data.files import file_signature, sha256
from cmacexp.errors import BadRun


@lru_cache(4096)
def _cached_hash(path: Path, signature: tuple[int, ...]) -> str:
    return sha256(path)


def current_hash(path: Path) -> str:
    """SHA-256 of a file as it is now; computed once while the file does not change."""
    return _cached_hash(path, file_signature(path))


def _read_manifest(folder: Path) -> manifests.Manifest | None:
    """The manifest of a run; None while it is written, when it has none yet."""
    path = folder / manifests.MANIFEST
    return manifests.read_file(path) if os.path.lexists(path) else None


def check_file(folder: Path, name: str, expected: str) -> str | None:
    """Why the file ``name`` of a folder is not the one with the hash ``expected``; None: it is."""
    try:
        return None if current_hash(folder / name) == expected else "changed since it was written"
    except (FileNotFoundError, NotADirectoryError):
        return "missing"
    except OSError as error:
        return f"cannot be read ({error.strerror or error})"


def was_written(path: Path) -> bool:
    """Whether the run in whose folder ``path`` lies wrote that file; raises BadRun if its manifest is damaged."""
    manifest = _read_manifest(path.parent)
    return path.is_file() if manifest is None else path.name in manifest["files"]


def require_intact(path: Path) -> Path:
    """``path``, if this file of a run is as the run wrote it, else raises BadRun.

    The files of a run that is still being written, and those of a report, have nothing that they could be compared
    with.
    """
    manifest = _read_manifest(path.parent)
    if manifest is None or manifest.get("kind") == manifests.REPORT:
        return path
    if path.name not in manifest["files"]:
        if manifest["config"].get("record", {}).get("trace") is False:
            raise BadRun(f"{path}: the run keeps metrics alone (record.trace=false); run it again with record=trace")
        raise BadRun(f"{path}: the run did not write this file, its {manifests.MANIFEST} does not list it")
    if fault := check_file(path.parent, path.name, manifest["files"][path.name]):
        raise BadRun(f"{path}: {fault}; run it again")
    return path
