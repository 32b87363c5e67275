"""What the values of a study depend on: files of code, models and versions; and two witnesses of its runs.

A digest of a source leaves out docstrings, which change no value, and does not depend on the version of Python.
"""

import ast
import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
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
"""File beside the page of a study."""
STATISTICS = tuple(
    f"addons/study/{name}.py"
    for name in ("comparison", "declaration", "interval", "results", "samples", "statements")
)
"""Files that make values of runs."""
DIGITS = 12


def digest_source(path: Path) -> str:
    """Digest of a source: of Python without docstrings, of YAML of what it says."""
    text = path.read_text(encoding="utf-8")
    if path.suffix in (".yaml", ".yml"):
        text = json.dumps(yaml.safe_load(text), sort_keys=True, default=str)
    elif path.suffix == ".py":
        text = _strip(text)
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def _strip(text: str) -> str:
    """Python without docstrings and blank lines."""
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            continue
        if isinstance(node.value.value, str) and not lines[node.lineno - 1][: node.col_offset].strip():
            lines[node.lineno - 1 : node.end_lineno] = [""] * ((node.end_lineno or node.lineno) - node.lineno + 1)
    return "\n".join(line.rstrip() for line in lines if line.strip())


@cache
def digest_package() -> dict[str, str]:
    """Digest every file of the package and of ``conf`` that can change a value of any study, by its path.

    It takes about 1 s, and the state of each study asks for it: it is computed once in a process.
    """
    rooms = [PACKAGE / room for room in (*RESULT_ROOMS, *STATISTICS)]
    files = {f for room in rooms for f in (room.rglob("*.py") if room.is_dir() else [room])}
    conf = config_folder()
    found = digest_files(files, PACKAGE.parent) | digest_files(conf.rglob("*.yaml"), conf.parent)
    return dict(sorted(found.items()))


def digest_study(path: Path) -> dict[str, str]:
    """Digest of the file of an imported study and of those beside it that it imports, by their paths."""
    root, name = find_module(path)
    return digest_files(find_sources(name), root)


def digest_files(files: Iterable[Path], root: Path) -> dict[str, str]:
    """Digests of files by their paths below ``root``."""
    return {file.relative_to(root).as_posix(): digest_source(file) for file in files}


def list_changed(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Files that differ, have come or have gone."""
    return sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))


def _hardly_costs(row: RunRow) -> tuple[float, str]:
    """Order runs by cost, samples of legs; then by settings, so that the choice is always the same."""
    config = row.run.settings
    steps = row.run.cycles_done * config["gait.cycle_time"] / config["sampling_period"]
    return steps * row.run.legs, repr(sorted(config.items(), key=str))


def choose_witnesses(results: Results, overrides: Mapping[Path, Sequence[str]]) -> list[dict[str, Any]]:
    """Two runs that hardly cost anything, of different feedforwards if there are: overrides, and final metrics.

    ``overrides`` are those of runs that start from nothing, by folder.
    """
    rows = [row for row in results.rows if row.run.folder in overrides and row.run.completed]
    rows.sort(key=_hardly_costs)
    kinds = [row.settings.get("feedforward") for row in rows]
    others = [index for index, kind in enumerate(kinds) if kind != kinds[0]] or [1]
    chosen = rows[:1] + rows[others[0] : others[0] + 1]
    return [make_witness(overrides[row.run.folder], row.run) for row in chosen]


def make_witness(overrides: Sequence[str], run: Run) -> dict[str, Any]:
    """An entry: overrides, and every metric of the last whole cycle, null where it is undefined."""
    final = {name: run.final(name) for name in run.pooled}
    metrics = {name: value if math.isfinite(value) else None for name, value in final.items()}
    return {"overrides": list(overrides), "metrics": metrics}


def make_provenance(
    own: Mapping[str, str], results: Results, witnesses: Sequence[Mapping[str, Any]], seeds: int
) -> dict[str, Any]:
    """What stands beside the page of a full study: its date, code, models, versions and witnesses.

    ``own`` are digests of its files, ``seeds`` how often it repeated what depends on a seed.
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
        "own": dict(own),
        "witnesses": list(witnesses),
    }
