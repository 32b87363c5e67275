"""Provenance of the values of a study: digests of code, models, versions, and two runs to repeat as a check.

A run to repeat is called a witness. The digest of a source file ignores docstrings, which change no value, and does
not depend on the version of Python.
"""

import ast
import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml

from cmacexp.addons.study.results import Results, RunRow
from cmacexp.addons.study.study_file import find_module
from cmacexp.config.component import config_folder, find_sources
from cmacexp.data.manifest import read_environment
from cmacexp.data.run import Run
from cmacexp.data.version import __version__
from cmacexp.jit.sources import PACKAGE, RESULT_ROOMS

PROVENANCE = "provenance.json"
"""Name of the provenance file beside the page of a study."""
STATISTICS = tuple(
    f"addons/study/{name}.py"
    for name in ("comparison", "declaration", "interval", "results", "samples", "statements")
)
"""Files of this add-on that compute values from runs."""
DIGITS = 12


def digest_source(path: Path) -> str:
    """Compute the digest of a source file: Python without docstrings and blank lines, YAML by its parsed content."""
    text = path.read_text(encoding="utf-8")
    if path.suffix in (".yaml", ".yml"):
        text = json.dumps(yaml.safe_load(text), sort_keys=True, default=str)
    elif path.suffix == ".py":
        text = _strip(text)
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def _strip(text: str) -> str:
    """Remove docstrings and blank lines from Python source."""
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            continue
        if isinstance(node.value.value, str) and not lines[node.lineno - 1][: node.col_offset].strip():
            lines[node.lineno - 1 : node.end_lineno] = [""] * ((node.end_lineno or node.lineno) - node.lineno + 1)
    return "\n".join(line.rstrip() for line in lines if line.strip())


def digest_package() -> dict[str, str]:
    """Compute the digest of every file of the package and of ``conf`` that can change values of a study, by path.

    This takes about 1 s.
    """
    rooms = [PACKAGE / room for room in (*RESULT_ROOMS, *STATISTICS)]
    files = {f for room in rooms for f in (room.rglob("*.py") if room.is_dir() else [room])}
    conf = config_folder()
    digests = digest_files(files, PACKAGE.parent) | digest_files(conf.rglob("*.yaml"), conf.parent)
    return dict(sorted(digests.items()))


def digest_study(path: Path) -> dict[str, str]:
    """Compute digests, by path, of the file of an imported study and of the files beside it that it imports."""
    root, name = find_module(path)
    return digest_files(find_sources(name), root)


def digest_files(files: Iterable[Path], root: Path) -> dict[str, str]:
    """Compute the digests of files, by path relative to ``root``."""
    return {file.relative_to(root).as_posix(): digest_source(file) for file in files}


def list_changed(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """List files whose digests differ, and files that were added or removed."""
    return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))


def _rank_by_cost(row: RunRow) -> tuple[float, str]:
    """Return a sort key: cost of a run in samples times legs, then its settings, so that the order is unique."""
    config = row.run.settings
    steps = row.run.cycles_done * config["gait.cycle_time"] / config["sampling_period"]
    return steps * row.run.legs, repr(sorted(config.items(), key=str))


def choose_witnesses(results: Results, overrides: Mapping[Path, Sequence[str]]) -> list[dict[str, Any]]:
    """Choose the two cheapest runs, with different feedforwards if possible; returns overrides and final metrics.

    ``overrides`` holds the overrides, by folder, of the runs that do not start from the weights of another run.
    """
    rows = [row for row in results.rows if row.run.folder in overrides and row.run.completed]
    rows.sort(key=_rank_by_cost)
    kinds = [row.settings.get("feedforward") for row in rows]
    second = next((index for index, kind in enumerate(kinds) if kind != kinds[0]), 1)
    chosen = rows[:1] + rows[second : second + 1]
    return [make_witness(overrides[row.run.folder], row.run) for row in chosen]


def make_witness(overrides: Sequence[str], run: Run) -> dict[str, Any]:
    """Make the entry of a run: overrides, and every metric of its last whole cycle, None where undefined."""
    final = {name: run.final(name) for name in run.pooled}
    metrics = {name: value if math.isfinite(value) else None for name, value in final.items()}
    return {"overrides": list(overrides), "metrics": metrics}


def make_provenance(
    study_digests: Mapping[str, str], results: Results, witnesses: Sequence[Mapping[str, Any]], seeds: int
) -> dict[str, Any]:
    """Make the provenance of a full study: date, versions, digests of code and models, and witnesses.

    ``study_digests`` are the digests of the files of the study, ``seeds`` the number of seeds of each run that
    depends on its seed.
    """
    manifests = [run.manifest for run in results.runs]
    models = {m["config"]["machine"]["model"]: m["model_hash"] for m in manifests if m["model_hash"]}
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "version": __version__,
        "git_commit": read_environment().git_commit,
        "versions": manifests[-1]["versions"] if manifests else read_environment().versions,
        "seeds": seeds,
        "runs": len(results),
        "models": dict(sorted(models.items())),
        "code": digest_package(),
        "own": dict(study_digests),
        "witnesses": list(witnesses),
    }
