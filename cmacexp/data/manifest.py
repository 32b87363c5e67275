"""The manifest of a run: config, versions, how it ended, and hashes of its files; written last."""

import json
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from cmacexp.config import config_hash
from cmacexp.data.files import sha256, write_atomically
from cmacexp.data.staging import LAST, finish_replacement
from cmacexp.data.version import __version__
from cmacexp.errors import BadRun

NAME = LAST
REPORT = "report"
"""Kind of a manifest that lists a report and the runs of its numbers, not a run."""
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
    """Write the manifest of ``folder``, whole or not at all."""
    with write_atomically(folder / NAME) as temporary:
        temporary.write_text(json.dumps(manifest, indent=2) + "\n")


def read(folder: Path) -> Manifest:
    """The manifest of a run.

    Raises:
        BadRun: there is none, or it cannot be read.
    """
    path = folder / NAME
    if not path.exists():
        finish_replacement(folder)
    try:
        manifest: Manifest = json.loads(path.read_text())
    except FileNotFoundError:
        raise BadRun(f"{folder}: no {NAME}: not the folder of a run, or the run was killed before its end") from None
    except (json.JSONDecodeError, UnicodeDecodeError, OSError) as error:
        raise BadRun(f"{path}: cannot be read ({error})") from None
    missing = [key for key in ("status", "config", "files") if not isinstance(manifest, dict) or key not in manifest]
    if missing:
        raise BadRun(f"{path}: not the manifest of a run: it has no {', '.join(missing)}")
    return manifest


def is_report(folder: Path) -> bool:
    """Whether ``folder`` holds a report, not a run."""
    try:
        return read(folder).get("kind") == REPORT
    except BadRun:
        return False


def update_files(folder: Path, names: list[str], **entries: Any) -> None:
    """Put the present hash of rewritten files, and other new entries, into the manifest of ``folder``."""
    manifest = {**read(folder), **entries}
    manifest["files"].update({name: sha256(folder / name) for name in names})
    write(folder, manifest)
