"""Runs of a study made up by hand, as rows of its results."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from support.doors import RunRow

import cmacexp
from cmacexp.data.manifest import make_manifest
from cmacexp.data.records import RunEnd
from cmacexp.study import Results
from cmacexp.typing import Array


def made_run(
    folder: str | Path, status: str, metrics: Mapping[str, Array] | None = None, **settings: object
) -> cmacexp.Run:
    """A run that ended so, with these metrics by cycle, of a config of these settings; it has no files."""
    run = cmacexp.Run(folder, make_manifest(settings, status, ""))
    run.__dict__["_summary"] = (RunEnd(status), dict(metrics or {}), 1)
    return run


def made_row(
    metrics: Mapping[str, Sequence[float]],
    asked: int | None = None,
    measures: Mapping[str, float] | None = None,
    seeded: bool = False,
    **settings: object,
) -> RunRow:
    """A run with these metrics by cycle; it fell if more cycles were ``asked`` for than they have."""
    histories = {name: np.array(values, dtype=float) for name, values in metrics.items()}
    cycles = len(next(iter(histories.values()), ()))
    status = "completed" if asked in (None, cycles) else "fell"
    return RunRow(made_run("run", status, histories), settings, settings, measures or {}, seeded)


def made_errors(*errors: float, cycles: int = 5, **settings: object) -> Results:
    """A run for each final error in x, m; that of NaN fell after two cycles."""
    rows = []
    for error in errors:
        history = [1.0, 0.5] if math.isnan(error) else np.linspace(1.0, error, cycles)
        metrics = {"transfer_rmse_x": history, "feedforward_share": history}
        rows.append(made_row(metrics, cycles, **settings))
    return Results(rows)
