"""The stages of a study, runs, measures, claims, page, and what each was made from.

A stage is made again if what it is made from has changed: runs (by ``cmacexp.data.integrity``) with their requests
and the code of the simulation; measures of each run with the run and the files of the measures; claims with the
measures and the files of the study; the page with the claims and its text. Measures are kept beside the runs, so that
a study that is ended in the middle goes on where it was; what the other stages were made from stands beside the page.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa

from cmacexp.config.component import find_sources
from cmacexp.data.files import write_atomically
from cmacexp.data.parquet import read_table, write_table
from cmacexp.data.run import Run
from cmacexp.jit.sources import PACKAGE, code_hash
from cmacexp.study.provenance import DIGITS, STATISTICS, digest_files, digest_source, digest_study, list_changed
from cmacexp.study.study import Request
from cmacexp.study.study_file import StudyFile, find_module, load_study
from cmacexp.typing import RESULTS

STAGES = ("runs", "measures", "claims", "page")
STAGES_FILE, MEASURES = "stages.json", "measures"
"""Beside the page; the folder of the measures of every study, beside that of the runs."""
MADE_FROM = ("runs", "results", "measures", "claims")
"""Entries of the file that claims depend on."""
TOGETHER = 100
"""Measured runs after which measures are written."""
IDENTITY = ("config_hash", "code_hash", "custom_code", "model_hash", "start_weights", "status")
"""Entries of a manifest that say which result a folder holds."""
WRITERS = ("study/page.py", "study/curves.py", "study/tables.py")
"""Files that make pages."""
Measured = Mapping[Path, Mapping[str, float]]


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, default=str).encode()).hexdigest()[:DIGITS]


def _identify(folder: Path) -> list[Any]:
    """Which result a folder holds."""
    manifest = Run(folder).manifest
    return [folder.name, *(manifest.get(name) for name in IDENTITY)]


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
        known = {row.pop("key"): row for row in read_table(table, texts=True).to_pylist()}
    found = {folder: known[key] for folder, key in keys.items() if key in known}

    def write() -> None:
        table.parent.mkdir(parents=True, exist_ok=True)
        rows = [{"key": keys[folder], **values} for folder, values in found.items()]
        with write_atomically(table) as new:
            write_table(pa.Table.from_pylist(rows), new)

    def add(measured: tuple[Path, dict[str, float]]) -> None:
        found.update([measured])
        if len(found) % TOGETHER == 0:
            write()

    missing = [(file.path, folder) for folder in folders if folder not in found]
    if missing:
        parallel_map("measuring", measure_run, missing, add)
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
    code = {f"{PACKAGE.name}/{name}": digest_source(PACKAGE / name) for name in STATISTICS}
    shown = {f"{PACKAGE.name}/{name}": digest_source(PACKAGE / name) for name in WRITERS}
    return {
        "runs": {"requests": _digest(asked), "code": code_hash()},
        "results": _digest([[_identify(folder), labels] for folder, labels in rows]),
        "measures": digest_measures(file),
        "claims": {**digest_study(file.path), **code},
        "page": {file.page.name: _digest(file.text), **shown},
    }


def find_stale(before: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, list[str]]:
    """What has changed for each stage; all that follows a stale stage is stale."""
    return {stage: list_changed(before.get(stage, {"never": ""}), now[stage]) for stage in STAGES}


def read_stages(folder: Path) -> dict[str, Any]:
    """What the stages of the report in ``folder`` were made from; empty if there is none."""
    path = folder / STAGES_FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def list_stages(file: StudyFile, requests: Sequence[Request], folder: Path) -> list[tuple[str, str]]:
    """The state of each stage of a study whose report is in ``folder``: ``current``, ``stale`` or ``missing``."""
    before = read_stages(folder)
    if not before:
        return [(stage, "missing") for stage in STAGES]
    stale, found = find_stale(before, describe_stages(file, requests)), []
    for number, stage in enumerate(STAGES):
        changed = [name for each in STAGES[: number + 1] for name in stale[each]]
        found.append((stage, f"stale ({', '.join(dict.fromkeys(changed))})" if changed else "current"))
    return found
