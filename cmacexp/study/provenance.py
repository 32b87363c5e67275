"""What the values of a study depend on: which of its stages must be made again, and two witnesses of its runs.

The stages are runs, measures, claims and page. A stage is made again if what it is made from has changed: runs (by
``cmacexp.data.integrity``) with their requests and the code of the simulation; measures of each run with the run and
the files of the measures; claims with the measures and the files of the study; the page with the claims and its text.
Measures are kept beside the runs, so that a study that is ended in the middle goes on where it was; what the other
stages were made from stands beside the page, and there too code, models, versions, and two runs to be made again.

A digest of a source leaves out docstrings, which change no value, and does not depend on the version of Python.
"""

import ast
import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache, partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import yaml

from cmacexp.config.component import config_folder, find_sources
from cmacexp.data.files import write_atomically
from cmacexp.data.manifest import read_environment
from cmacexp.data.run import Run
from cmacexp.data.tables import read_table, write_table
from cmacexp.data.version import __version__
from cmacexp.errors import BadRun
from cmacexp.jit.sources import PACKAGE, RESULT_ROOMS, code_hash
from cmacexp.study.results import Results, RunRow
from cmacexp.study.study import Request
from cmacexp.study.study_file import StudyFile, find_module, load_study
from cmacexp.typing import RESULTS

PROVENANCE = "provenance.json"
"""File beside the page of a study."""
STATISTICS = tuple(
    f"study/{name}.py" for name in ("comparison", "declaration", "interval", "quantity", "results", "statements")
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
    """Digest of every file of the package and of ``conf`` that can change a value of any study, by its path."""
    rooms = [PACKAGE / room for room in (*RESULT_ROOMS, *STATISTICS)]
    files = {f for room in rooms for f in (room.rglob("*.py") if room.is_dir() else [room])}
    conf = config_folder()
    found = digest_files(files, PACKAGE.parent) | digest_files(conf.rglob("*.yaml"), conf.parent)
    return dict(sorted(found.items()))


def digest_study(path: Path) -> dict[str, str]:
    """Digest of the file of an imported study and of those beside it that it imports, by their paths."""
    root, name = find_module(path)
    return digest_files(find_sources(name) if path.suffix == ".py" else [path], root)


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


STAGES = ("runs", "measures", "claims", "page")
STAGES_FILE, MEASURES = "stages.json", "measures"
"""File beside the page; the folder of the measures of every study, beside that of the runs."""
MADE_FROM = ("runs", "results", "measures", "claims")
"""Entries of the file that claims depend on."""
TOGETHER = 100
"""Measured runs after which measures are written."""
IDENTITY = ("config_hash", "code_hash", "custom_code", "model_hash", "start_weights", "status")
"""Entries of a manifest that say which result a folder holds."""
WRITERS = ("study/page.py", "study/views.py")
"""Files that make pages."""
Measured = Mapping[Path, Mapping[str, float]]


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, default=str).encode()).hexdigest()[:DIGITS]


def _identify(folder: Path) -> list[Any]:
    """Which result a folder holds."""
    return [folder.name, *map(Run(folder).manifest.get, IDENTITY)]


def digest_measures(file: StudyFile) -> dict[str, str]:
    """Digests of the files of a study's measures and of those that they import beside it."""
    functions = [each.func if isinstance(each, partial) else each for each in file.study.measures.values()]
    modules = {function.__module__ for function in functions}
    root = find_module(file.path)[0]
    paths = {path for name in modules for path in find_sources(name) if path.is_relative_to(root)}
    return digest_files(sorted(paths), root)


def measure_run(path: Path, folder: Path) -> tuple[Path, dict[str, float]]:
    """Folder and measures of one run of a study, by name; NaN of a run that failed."""
    run, measures = Run(folder), load_study(path).study.measures
    failed = run.status not in RESULTS
    return folder, {name: math.nan if failed else float(measure(run)) for name, measure in measures.items()}


def measure_runs(file: StudyFile, folders: Sequence[Path], table: Path, parallel_map: Callable[..., Any]) -> Measured:
    """The measures of each run of a study; those in ``table`` that are of the same run and source are kept."""
    if not file.study.measures:
        return {folder: {} for folder in folders}
    source, known = digest_measures(file), {}
    keys = {folder: _digest([_identify(folder), source]) for folder in folders}
    if table.is_file():
        before = read_table(table, texts=True)
        BadRun.unless("key" in before.column_names, f"{table}: not the measures of a study; move it")
        known = {row.pop("key"): row for row in before.to_pylist()}
    found = {folder: known[key] for folder, key in keys.items() if key in known}

    def write() -> None:
        table.parent.mkdir(parents=True, exist_ok=True)
        rows = [{"key": keys[folder], **values} for folder, values in found.items()]
        with write_atomically(table) as new:
            write_table(pa.Table.from_pylist(rows), new)

    missing = [(file.path, folder) for folder in folders if folder not in found]
    if missing:
        for folder, values in parallel_map("measuring", measure_run, missing):
            found[folder] = values
            if len(found) % TOGETHER == 0:
                write()
        write()
    return found


def describe_stages(file: StudyFile, requests: Sequence[Request], rows: Sequence[Any] = ()) -> dict[str, Any]:
    """What every stage of a study is made from now.

    Args:
        file: of the study.
        requests: of one seed each.
        rows: folder and labels of each run; its results are part of what claims are made from.
    """
    asked = [[r.overrides, r.labels, r.starts_from and r.starts_from.overrides] for r in requests]
    code, shown = (
        digest_files([PACKAGE / name for name in names], PACKAGE.parent) for names in (STATISTICS, WRITERS)
    )
    return {
        "runs": {"requests": _digest(asked), "code": code_hash()},
        "results": _digest([[_identify(folder), labels] for folder, labels in rows]),
        "measures": digest_measures(file),
        "claims": {**digest_study(file.path), **code},
        "page": {file.page.name: _digest(file.text), **shown},
    }


def read_stages(folder: Path) -> dict[str, Any]:
    """What the stages of the report in ``folder`` were made from; empty if there is none."""
    path = folder / STAGES_FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def list_stages(file: StudyFile, requests: Sequence[Request], folder: Path) -> list[tuple[str, str]]:
    """The state of each stage of a study whose report is in ``folder``: ``current``, ``stale`` or ``missing``."""
    before = read_stages(folder)
    if not before:
        return [(stage, "missing") for stage in STAGES]
    now, changed, found = describe_stages(file, requests), list[str](), []
    for stage in STAGES:
        changed += list_changed(before.get(stage, {"never": ""}), now[stage])
        found.append((stage, f"stale ({', '.join(dict.fromkeys(changed))})" if changed else "current"))
    return found
