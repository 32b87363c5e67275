"""The manifest of a run: config, versions, outcome, and hashes of its files; written last.

All code that reads a file of a run first checks here that the file is unchanged. The folders of runs are found by
their manifests.
"""

import hashlib
import json
import os
import platform
import re
import subprocess
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from cmacexp.config import config_hash
from cmacexp.data.files import file_signature, open_file, sha256, write_atomically
from cmacexp.data.manifest_fields import REPORT as REPORT
from cmacexp.data.manifest_fields import SWEEP as SWEEP
from cmacexp.data.manifest_fields import RunManifest, complete
from cmacexp.data.version import __version__
from cmacexp.errors import BadInput, BadRun, require
from cmacexp.jit.sources import RESULT_ROOMS, sources_hash
from cmacexp.models.robot_file import DISTRIBUTION

MANIFEST = "manifest.json"
MAX_BYTES = 16 << 20
"""Size of the largest manifest that is read, B."""
MOST_CACHED = 64 << 10
"""Size of the largest manifest that is cached, B."""
PACKAGES = ("numpy", "numba", "scipy", "pyarrow", "pandas", "hydra-core", "rerun-sdk", "mujoco", DISTRIBUTION)
"""Packages on whose versions results can depend; the last one contains the models of robots."""

Manifest = dict[str, Any]
"""Entries by name: those of :class:`cmacexp.data.manifest_fields.RunManifest`, or those of a sweep or a report."""


class Environment(NamedTuple):
    """Versions of the software of this process, on which results can depend."""

    versions: dict[str, str]
    """Versions of this package, of Python, and of the installed :data:`PACKAGES`, by name."""
    git_commit: str | None
    """Commit of the Git checkout that contains this code; None if it is installed."""
    code_hash: str
    """Hash of all code of this package that can change the result of a run."""


@cache
def read_environment() -> Environment:
    """Read the versions of the software of this process, once."""
    versions = {"cmacexp": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            versions[package] = version(package)
    return Environment(versions, _find_commit(), sources_hash(RESULT_ROOMS))


def _find_commit() -> str | None:
    checkout = Path(__file__).resolve().parents[2]
    if not (checkout / ".git").exists():
        return None
    try:
        git = subprocess.run(
            ["git", "-C", str(checkout), "rev-parse", "HEAD"], capture_output=True, text=True, timeout=10, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return git.stdout.strip() if git.returncode == 0 else None


def make_manifest(config: dict[str, Any], status: str, cause: str, **entries: Any) -> Manifest:
    """Make the manifest of a run.

    Args:
        config: Config as plain dictionaries.
        status: Outcome of the run.
        cause: Why it did not complete; empty if it did.
        entries: Other entries; without them those of a run that took no step.
    """
    config = json.loads(json.dumps(config))  # keys become text, as when the file is read: the hash must be the same
    manifest: Manifest = {
        "status": str(status),
        "cause": cause,
        "seed": config.get("seed"),
        "config": config,
        "config_hash": config_hash(config),
        "versions": read_environment().versions,
        "git_commit": read_environment().git_commit,
        "steps": 0,
        "rollout_seconds": 0.0,
        "wall_seconds": 0.0,
        "files": {},
    }
    return vars(RunManifest(**manifest | entries))


def write(folder: Path, manifest: Manifest, durable: bool = True) -> None:
    """Write the manifest of a result atomically; without ``durable`` a power failure may lose it."""
    with write_atomically(folder / MANIFEST, durable) as temporary:
        temporary.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")


def read(folder: Path) -> Manifest:
    """Read and check the manifest of the run in ``folder``.

    Raises BadRun if it is missing, cannot be read or belongs to a report or a sweep, or if an entry is missing or
    invalid.
    """
    manifest = read_file(folder / MANIFEST)
    BadRun.unless(
        "kind" not in manifest, f"{folder}: holds a {manifest.get('kind')}, not a run; give the folder of a run"
    )
    return manifest


def read_file(path: Path) -> Manifest:
    """Read the manifest of a run, a report or a sweep from a file; raises BadRun as :func:`read`."""
    try:
        signature = file_signature(path)
        read = _read_checked if signature[2] <= MOST_CACHED else _read_checked.__wrapped__
        manifest: Manifest = json.loads(read(path, signature))
    except (FileNotFoundError, NotADirectoryError):
        reason = f"no {path.name}: not the folder of a run, or the run was killed before its end"
        raise BadRun(f"{path.parent}: {reason}") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise BadRun(f"{path}: cannot be read ({reason.splitlines()[0]})") from None
    manifest.pop("checksum", None)  # written by earlier versions
    return manifest


@lru_cache(2048)  # the search for runs and every access to a table read the manifest too
def _read_checked(path: Path, signature: tuple[int, ...]) -> str:
    """Read a manifest, completed with default entries, as JSON text; ``signature`` of the file is the cache key."""
    with open_file(path) as file:
        BadRun.unless(
            os.fstat(file.fileno()).st_size <= MAX_BYTES,
            f"{path}: larger than {MAX_BYTES >> 20} MB, not the manifest of a run",
        )
        return json.dumps(parse(file.read().decode(), path))


def parse(text: str, path: Path) -> Manifest:
    """Parse and check the text of a manifest and add default entries; raises BadRun, which names ``path``."""
    try:
        manifest = json.loads(text)
        if "\\ud" in text.lower():  # a lone surrogate, which cannot be encoded for files and terminals
            json.dumps(manifest, ensure_ascii=False).encode()
        return complete(manifest)
    except BadInput as error:
        raise BadRun(f"{path}: not the manifest of a run: {error}; run it again") from None
    except (ValueError, RecursionError) as error:
        reason = str(error) or type(error).__name__
        raise BadRun(f"{path}: cannot be read ({reason.splitlines()[0]})") from None


@lru_cache(4096)
def _cached_hash(path: Path, signature: tuple[int, ...]) -> str:
    return sha256(path)


def current_hash(path: Path) -> str:
    """Compute the SHA-256 of a file; cached until the file changes."""
    return _cached_hash(path, file_signature(path))


def _read_manifest(folder: Path) -> Manifest | None:
    """Read the manifest in ``folder``; None if it is missing, as while a run is being written."""
    path = folder / MANIFEST
    return read_file(path) if os.path.lexists(path) else None


def check_file(folder: Path, name: str, expected: str) -> str | None:
    """Explain why the file ``name`` in ``folder`` does not have the SHA-256 ``expected``; None if it has."""
    try:
        return None if current_hash(folder / name) == expected else "changed since it was written"
    except (FileNotFoundError, NotADirectoryError):
        return "missing"
    except OSError as error:
        return f"cannot be read ({error.strerror or error})"


def was_written(path: Path) -> bool:
    """Check whether the run in the folder of ``path`` wrote that file; raises BadRun if its manifest is damaged."""
    manifest = _read_manifest(path.parent)
    return path.is_file() if manifest is None else path.name in manifest["files"]


def keeps_trace(manifest: Manifest) -> bool:
    """Check whether a run stores traces; True if its config does not say, as that of a failed run may."""
    record = manifest["config"].get("record")
    return not isinstance(record, dict) or record.get("trace") is not False


def require_intact(path: Path) -> Path:
    """Return ``path`` if this file of a run has not changed since it was written; raises BadRun otherwise.

    Files of a run that is still being written, and those of a report, are not checked: no hash of them is stored.
    """
    manifest = _read_manifest(path.parent)
    if manifest is None or manifest.get("kind") == REPORT:
        return path
    listed = path.name in manifest["files"]
    lean = f"{path}: the run keeps metrics only (record.trace=false); run it again with record=trace"
    BadRun.unless(listed or keeps_trace(manifest), lean)
    cause = manifest.get("cause")
    why = f"it {manifest['status']}: {cause}" if cause else f"its {MANIFEST} does not list it"
    BadRun.unless(listed, f"{path}: the run did not write this file, {why}")
    fault = check_file(path.parent, path.name, manifest["files"][path.name])
    BadRun.unless(fault is None, f"{path}: {fault}; run it again")
    return path


HYDRA_FOLDER = ".hydra"
RUNS_FILE, JOBS_FOLDER = "runs.parquet", ".jobs"
"""Table of the jobs of a sweep, and the hidden folder for parts of its tables while it runs."""
JOB_PART = re.compile("[0-9a-f]{8}-[0-9a-f]{64}")


def is_run(folder: Path) -> bool:
    """Check whether ``folder`` is the folder of a run, complete or not."""
    try:
        manifest = _read_manifest(folder)
    except BadRun:
        return True
    if manifest is None:
        return os.path.lexists(folder / "trace.parquet")
    return manifest.get("kind") not in (REPORT, SWEEP)


def read_sweep(folder: Path) -> Manifest | None:
    """Read the manifest of the sweep in ``folder``; None if there is no sweep. Raises BadRun if it is damaged."""
    manifest = _read_manifest(folder)
    return manifest if manifest is not None and manifest.get("kind") == SWEEP else None


def has_tables(folder: Path) -> bool:
    """Check whether ``folder`` contains the tables of a finished sweep; raises BadRun as :func:`read_sweep`."""
    return RUNS_FILE in (read_sweep(folder) or {"files": ()})["files"]


def name_job_part(sweep: str, content: bytes | memoryview) -> str:
    """Return the file name of a table part of a running sweep, which contains the hash of its content."""
    return f"{sweep}-{hashlib.sha256(content).hexdigest()}"


def list_job_parts(folder: Path, sweep: str = "") -> list[Path]:
    """List the table parts in the folder of a sweep, newest first; with ``sweep`` only those with this prefix."""
    named = [path for path in (folder / JOBS_FOLDER).glob(f"{sweep}*") if JOB_PART.fullmatch(path.name)]
    return sorted(named, key=lambda path: path.lstat().st_mtime_ns, reverse=True)


def _holds_jobs(folder: Path) -> bool:
    """Check whether ``folder`` contains results of the jobs of a sweep, as tables or as parts of them."""
    manifest = read_sweep(folder)
    return manifest is not None and bool(manifest["files"] or list_job_parts(folder))


def walk(folder: Path, skipped: Callable[[OSError], None] | None = None) -> Iterator[Path]:
    """Yield ``folder`` and all folders below it except hidden ones, in order; links are not followed.

    ``skipped`` is called with the error of every folder that cannot be read.
    """
    for path, names, _ in os.walk(folder, onerror=skipped):
        names[:] = sorted(name for name in names if name[0] != ".")
        yield Path(path)


def name_of(folder: Path) -> str:
    """Return the name of the folder of a run, for a job of a sweep as SWEEP_JOB."""
    path = folder.resolve()
    return f"{path.parent.name}_{path.name}" if path.name.isdecimal() else path.name


def _require_some(folder: Path, paths: Iterable[Path]) -> list[Path]:
    BadRun.unless(folder.is_dir(), f"{folder}: no such folder")
    if ordered := sorted(paths):
        return ordered
    BadRun.unless(
        not has_tables(folder) and not list_job_parts(folder),
        f"{folder}: its runs keep metrics only (record=metrics), without folders; use record=trace",
    )
    raise BadRun(f"{folder}: contains no run; use the folder that a run printed at its end")


def _refuse(error: OSError) -> None:
    raise BadRun(f"{error.filename}: cannot be read ({error.strerror})")


def runs_below(folder: Path) -> list[Path]:
    """List the runs below ``folder``, sorted, or only ``folder`` if it is a run; raises BadRun if there is none."""
    if not folder.is_dir() or is_run(folder):
        return _require_some(folder, [folder])
    return _require_some(folder, filter(is_run, walk(folder, _refuse)))


def everything_below(folder: Path) -> list[Path]:
    """List all folders at and below ``folder`` that can be verified, sorted: runs, also inside runs, and sweeps.

    Folders that cannot be read are included, so that they are reported. Raises BadRun if there is none.
    """
    unreadable: list[OSError] = []
    runs = {path for path in walk(folder, unreadable.append) if is_run(path) or _holds_jobs(path)}
    return _require_some(folder, runs.union(Path(error.filename) for error in unreadable))


def require_place(key: str, folder: Path) -> Path:
    """Return ``folder`` if it is a folder or can be created; raises BadInput if it or a parent is a file."""
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    require(nearest.is_dir(), key, folder, f"must be a folder, which is created if missing; {nearest} is a file")
    return folder
