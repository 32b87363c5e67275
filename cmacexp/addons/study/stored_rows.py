"""A small set of stored runs of a study, from which its statements are judged again without a simulation.

Two runs with one study prove nothing about its statements. So a study also stores, as text, the settings, measures
and used metrics of its runs with the first two seeds, and what its statements give on these runs alone.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.addons.study.results import Results, RunRow
from cmacexp.addons.study.statements import Claim, Finding
from cmacexp.data.records import RunEnd
from cmacexp.data.run import Run
from cmacexp.errors import CmacexpError
from cmacexp.typing import Array

STORED_ROWS = "stored_rows.json"
"""Name of the file beside the page of a study."""
SEEDS = 2
"""Number of seeds whose runs are stored."""
MOST = 20_000
"""Number of metric values that may be stored; statements that would need more are left out."""
DIGITS = 7
"""Significant digits of a stored value."""
Statements = Mapping[str, Claim | Finding]


class StoredRun(Run):
    """A run without files: its outcome, and some of its metrics by cycle, (whole cycles,) each."""

    def __init__(self, status: str, metrics: dict[str, Array]):
        super().__init__("stored", {"status": status, "cause": ""})
        self._summary = RunEnd(status), metrics, 1


class _Used(dict[str, Array]):
    """Metrics of a run that remember which of them were read."""

    def __init__(self, metrics: Mapping[str, Array]):
        super().__init__(metrics)
        self.names: set[str] = set()

    def __getitem__(self, name: str) -> Array:
        self.names.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return a metric, or ``default`` without it."""
        self.names.add(name)
        return super().get(name, default)


def judge(statements: Statements, results: Results) -> dict[str, dict[str, Any]]:
    """Judge statements; returns verdict and measured columns of those that these runs can judge, by name."""
    judged = {}
    for name, statement in statements.items():
        try:
            result = statement.judge(results)
        except (CmacexpError, LookupError, TypeError, ValueError, OSError):
            continue  # it needs a trace, a table or runs that are not stored
        judged[name] = {"verdict": result.verdict, **result.columns}
    return judged


def _round(values: Any) -> list[float]:
    return [float(f"{value:.{DIGITS}g}") for value in values]


def store_rows(statements: Statements, results: Results) -> str:
    """Return the text of the stored runs of a study, and of what its statements give on them."""
    seeds = sorted({row.settings.get("seed", 0) for row in results.rows})[:SEEDS]
    full = [row for row in results.rows if row.settings.get("seed", 0) in seeds]
    used = [_Used(row.run.pooled) for row in full]
    rows = [replace(row, run=StoredRun(row.run.status, metrics)) for row, metrics in zip(full, used, strict=True)]
    stored: list[dict[str, Array]] = [{} for _ in rows]
    chosen: dict[str, Claim | Finding] = {}
    for name, statement in statements.items():
        for metrics in used:
            metrics.names.clear()
        if judge({name: statement}, Results(rows)):
            needed = [{key: metrics[key] for key in sorted(metrics.names & metrics.keys())} for metrics in used]
            merged = [before | more for before, more in zip(stored, needed, strict=True)]
            if sum(len(values) for metrics in merged for values in metrics.values()) <= MOST:
                stored, chosen[name] = merged, statement
    common = {
        key: value
        for key, value in (rows[0].settings if rows else {}).items()
        if all(row.settings.get(key, math.nan) == value for row in rows)
    }
    entries = [
        {
            "settings": {key: value for key, value in row.settings.items() if key not in common},
            "seeded": row.seeded,
            "status": row.run.status,
            "measures": dict(zip(row.measures, _round(row.measures.values()), strict=True)),
            "metrics": {name: _round(values) for name, values in metrics.items()},
        }
        for row, metrics in zip(rows, stored, strict=True)
    ]
    content: dict[str, Any] = {"common": common, "rows": entries}
    content["statements"] = judge(chosen, _read_rows(content))
    return json.dumps(content, ensure_ascii=False) + "\n"


def _read_rows(content: Mapping[str, Any]) -> Results:
    rows = []
    for entry in content["rows"]:
        metrics = {name: np.array(values) for name, values in entry["metrics"].items()}
        settings = {**content["common"], **entry["settings"]}
        run = StoredRun(entry["status"], metrics)
        rows.append(RunRow(run, settings, settings, entry["measures"], entry["seeded"]))
    return Results(rows)


def judge_again(path: Path, statements: Statements) -> list[str]:
    """Judge the statements of a study on the runs stored in a file, and list those that give something else."""
    content = json.loads(path.read_text(encoding="utf-8"))
    expected = content["statements"]
    found = judge({name: statements[name] for name in expected if name in statements}, _read_rows(content))
    return [
        f"{name}: was {old}, is {found.get(name, 'not declared or not judged')}"
        for name, old in expected.items()
        if found.get(name) != old
    ]
