"""The manifest of a run: config, versions, how it ended, and hashes of its files; written last.

Everything that reads a file of a run asks here first whether that is as the run wrote it. Folders
that hold a run are found by it.
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
from cmacexp.models.robot_file import DISTRIBUTION

MANIFEST = "manifest.json"
MAX_BYTES, MOST_CACHED = 16 << 20, 64 << 10
"""Sizes of the largest manifest that is read, and of the largest one that is kept in memory."""
PACKAGES = ("numpy", "numba", "scipy", "pyarrow", "pandas", "hydra-core", "rerun-sdk", "mujoco", DISTRIBUTION)
"""Packages on whose versions results can depend, those of robots included."""

Manifest = dict[str, Any]
"""Entries by name, those of :class:`cmacexp.data.manifest_fields.RunManifest`, perhaps of a sweep or a report."""


class Environment(NamedTuple):
    """What this process runs, of which results can depend."""

    versions: dict[str, str]
    """Of this package, Python, and everything installed that results can depend on."""
    git_commit: str | None
    """Commit of the checkout that this code runs from; None outside one."""


@cache
def read_environment() -> Environment:
    """Read what this process runs, which does not change."""
    versions = {"cmacexp": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            versions[package] = version(package)
    return Environment(versions, _find_commit())


def _find_commit() -> str | None:
    checkout = Path(__file__).resolve().parents[2]
    if not (checkout / ".git").exists():
        return None
    try:
        answer = subprocess.run(
            ["git", "-C", str(checkout), "rev-parse", "HEAD"], capture_output=True, text=True, timeout=10, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return answer.stdout.strip() if answer.returncode == 0 else None


def make_manifest(config: dict[str, Any], status: str, cause: str, **entries: Any) -> Manifest:
    """The manifest of a run of a plain ``config``; without ``entries`` that of one that took no step."""
    config = json.loads(json.dumps(config))  # keys become text, as they will be read: the hash must be the same
    given: Manifest = {
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
    return vars(RunManifest(**given | entries))


def write(folder: Path, manifest: Manifest, durable: bool = True) -> None:
    """Write the manifest of a result, in one step; one that is not ``durable`` may be lost in a power failure."""
    with write_atomically(folder / MANIFEST, durable) as temporary:
        temporary.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")


def read(folder: Path) -> Manifest:
    """The manifest of a run, checked.

    Raises BadRun if there is none, it cannot be read, it is one of a report or a sweep, or an entry is missing or not
    what it must be.
    """
    manifest = read_file(folder / MANIFEST)
    BadRun.unless(
        "kind" not in manifest, f"{folder}: holds a {manifest.get('kind')}, not a run; give the folder of a run"
    )
    return manifest


def read_file(path: Path) -> Manifest:
    """The manifest in a file, of a run, a report or a sweep; raises BadRun as :func:`read`."""
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
    manifest.pop("checksum", None)  # of earlier versions
    return manifest


@lru_cache(2048)  # whoever looks for runs, or reads a table of one, reads its manifest too
def _read_checked(path: Path, signature: tuple[int, ...]) -> str:
    """A manifest as text, with all its entries, whose file has this signature."""
    with open_file(path) as file:
        BadRun.unless(
            os.fstat(file.fileno()).st_size <= MAX_BYTES,
            f"{path}: larger than {MAX_BYTES >> 20} MB, not the manifest of a run",
        )
        return json.dumps(parse(file.read().decode(), path))


def parse(text: str, path: Path) -> Manifest:
    """Read the text of a manifest, with all its entries; raises BadRun in the name of the file ``path``."""
    try:
        manifest = json.loads(text)
        if "\\ud" in text.lower():  # half of a character, which no file and no terminal takes
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
    """SHA-256 of a file as it is now; computed once while the file does not change."""
    return _cached_hash(path, file_signature(path))


def _read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a run; None while it is written, when it has none yet."""
    path = folder / MANIFEST
    return read_file(path) if os.path.lexists(path) else None


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


def keeps_trace(manifest: Manifest) -> bool:
    """Whether a run stores more than its metrics, as far as is known: one that failed can have any config."""
    record = manifest["config"].get("record")
    return not isinstance(record, dict) or record.get("trace") is not False


def require_intact(path: Path) -> Path:
    """``path``, if this file of a run is as the run wrote it, else raises BadRun.

    The files of a run that is still being written, and those of a report, have nothing that they could be compared
    with.
    """
    manifest = _read_manifest(path.parent)
    if manifest is None or manifest.get("kind") == REPORT:
        return path
    listed = path.name in manifest["files"]
    lean = f"{path}: the run keeps metrics alone (record.trace=false); run it again with record=trace"
    BadRun.unless(listed or keeps_trace(manifest), lean)
    cause = manifest.get("cause")
    why = f"it {manifest['status']}: {cause}" if cause else f"its {MANIFEST} does not list it"
    BadRun.unless(listed, f"{path}: the run did not write this file, {why}")
    fault = check_file(path.parent, path.name, manifest["files"][path.name])
    BadRun.unless(fault is None, f"{path}: {fault}; run it again")
    return path


HYDRA_FOLDER = ".hydra"
RUNS_FILE, JOBS_FOLDER = "runs.parquet", ".jobs"
"""Tables of a sweep: its jobs beside their metrics; and parts of both while it runs."""
JOB_PART = re.compile("[0-9a-f]{8}-[0-9a-f]{64}")


def is_run(folder: Path) -> bool:
    """Whether ``folder`` is the folder of a run, complete or not."""
    try:
        manifest = _read_manifest(folder)
    except BadRun:
        return True
    if manifest is None:
        return os.path.lexists(folder / "trace.parquet")
    return manifest.get("kind") not in (REPORT, SWEEP)


def read_sweep(folder: Path) -> Manifest | None:
    """Read the manifest of the sweep in a folder; None without one. Raises BadRun if it is damaged."""
    manifest = _read_manifest(folder)
    return manifest if manifest is not None and manifest.get("kind") == SWEEP else None


def has_tables(folder: Path) -> bool:
    """Check whether a folder holds the tables of a sweep that has ended, as :func:`read_sweep`."""
    return RUNS_FILE in (read_sweep(folder) or {"files": ()})["files"]


def name_job_part(sweep: str, content: bytes | memoryview) -> str:
    """Name a part of the tables of a running sweep by what it holds, so that a changed one is found."""
    return f"{sweep}-{hashlib.sha256(content).hexdigest()}"


def list_job_parts(folder: Path, sweep: str = "") -> list[Path]:
    """List the parts that the jobs of a sweep have left in its folder, or those of all sweeps; the newest first."""
    named = [path for path in (folder / JOBS_FOLDER).glob(f"{sweep}*") if JOB_PART.fullmatch(path.name)]
    return sorted(named, key=lambda path: path.lstat().st_mtime_ns, reverse=True)


def _holds_jobs(folder: Path) -> bool:
    """Check whether a folder holds what jobs of a sweep left, in tables or parts of them."""
    manifest = read_sweep(folder)
    return manifest is not None and bool(manifest["files"] or list_job_parts(folder))


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
    BadRun.unless(folder.is_dir(), f"{folder}: no such folder")
    if ordered := sorted(paths):
        return ordered
    BadRun.unless(
        not has_tables(folder) and not list_job_parts(folder),
        f"{folder}: its runs keep metrics alone (record=metrics), without folders; use record=trace",
    )
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
    require(nearest.is_dir(), key, folder, f"must be a folder, which is created if missing; {nearest} is a file")
    return folder
