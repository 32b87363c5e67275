"""The manifest of a run: config, versions, how it ended, and hashes of its files and of itself; written last."""

import json
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from cmacexp.config import config_hash
from cmacexp.data.files import write_atomically
from cmacexp.data.manifest_fields import LATER, find_wrong
from cmacexp.data.manifest_fields import REPORT as REPORT
from cmacexp.data.manifest_fields import SWEEP as SWEEP
from cmacexp.data.manifest_text import CHECKSUM, dump
from cmacexp.data.manifest_text import NAME as NAME
from cmacexp.data.staging import finish_replacement
from cmacexp.data.version import __version__
from cmacexp.errors import BadRun

PACKAGES = ("numpy", "numba", "scipy", "pyarrow", "pandas", "hydra-core", "rerun-sdk")

Manifest = dict[str, Any]


@cache
def versions() -> dict[str, str]:
    """Versions of everything that results can depend on."""
    found = {"cmacexp": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


@cache
def git_commit() -> str | None:
    """Commit of the checkout that this code runs from; None outside one."""
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
    """The manifest of a run of a plain ``config``; the defaults are those of a run that took no step."""
    config = json.loads(json.dumps(config))  # keys become text, as they will be read: the hash must be the same
    return {
        "status": status,
        "cause": cause,
        "seed": config.get("seed"),
        "config": config,
        "config_hash": config_hash(config),
        "versions": versions(),
        "git_commit": git_commit(),
        "steps": 0,
        "rollout_seconds": 0.0,
        "wall_seconds": 0.0,
        "files": {},
        **entries,
    }


def write(folder: Path, manifest: Manifest) -> None:
    """Write the manifest of ``folder`` with its checksum, whole or not at all."""
    with write_atomically(folder / NAME) as temporary:
        temporary.write_text(dump(manifest), encoding="utf-8")


def read(folder: Path) -> Manifest:
    """The manifest of a run, a report or a sweep, checked; without its checksum.

    One that has a checksum is accepted as it was written, to the last blank. One without, of an earlier version, must
    have known entries alone.

    Raises:
        BadRun: there is none, it cannot be read, it has changed, or an entry is missing or not what it must be.
    """
    path = folder / NAME
    if not path.exists():
        finish_replacement(folder)
    try:
        text = path.read_bytes().decode()
        found = json.loads(text)
        has_checksum = isinstance(found, dict) and CHECKSUM in found
        changed = has_checksum and dump(found) != text
    except (FileNotFoundError, NotADirectoryError):
        raise BadRun(f"{folder}: no {NAME}: not the folder of a run, or the run was killed before its end") from None
    except (ValueError, OSError, RecursionError) as error:
        raise BadRun(f"{path}: cannot be read ({_describe(error)})") from None
    if changed:
        raise BadRun(f"{path}: changed since it was written; run it again")
    if has_checksum:
        del found[CHECKSUM]
    if wrong := find_wrong(found, complete=has_checksum):
        raise BadRun(f"{path}: not the manifest of a run: {wrong}; run it again")
    manifest: Manifest = found
    return manifest if "kind" in manifest else {**LATER, **manifest}


def _describe(error: Exception) -> str:
    """Why a manifest cannot be read, in one line."""
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return (reason or type(error).__name__).splitlines()[0]


def lists_no_run(folder: Path) -> bool:
    """Whether ``folder`` holds a report or the table of a sweep, not a run."""
    try:
        return "kind" in read(folder)
    except BadRun:
        return False
