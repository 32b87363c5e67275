"""What the study of the guard of learning runs and measures: random worlds, with feedback only beside learning."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.data.run import Run
from cmacexp.report.figures import Panel, Series
from cmacexp.study import Finding, Request, Results, at_least, draw, grid
from cmacexp.study.results import LAST_CYCLES, RunRow
from cmacexp.typing import Array
from pipelines.common_results import percent
from pipelines.guard_worlds import SCENARIOS, draw_world

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

ALONE, GUARDED, UNGUARDED = "feedback only", "guarded", "unguarded"
KINDS = {ALONE: ("feedforward=none",), GUARDED: ("learning.guard=freeze",), UNGUARDED: ("learning.guard=none",)}
ERROR, LEVEL = "error", "level"
"""Measures."""
ENOUGH = 0.95
"""Share of the worlds, at the lower end of its interval, that must be no worse."""
WORSE = 1.05
"""Error over that with feedback only up to which it counts as no worse."""
WORLDS = "worlds"
"""The part of the study with random worlds."""
QUICK_NUMBER, QUICK = 2, 4
"""Worlds and cycles of the quick form."""


def request_worlds(machine: str, number: int, cycles: int) -> list[Request]:
    """The first ``number`` worlds of a machine, each with feedback only, guarded and unguarded."""
    common = (*SCENARIOS[machine], f"cycles={cycles}", f"record.cycles=[{cycles}]", "warn=false")
    labels: dict[str, Any] = {"part": WORLDS, "machine": machine}
    return [
        request
        for world in range(number)
        for request in grid(*common, *draw_world(machine, world), over={"kind": KINDS}, world=world, **labels)
    ]


def _root_mean_square(run: Run, *names: str) -> Array:
    """(cycles,): the root of the sum of squares of metrics, mean over the legs."""
    squares = (run.metrics[list(names)] ** 2).sum(axis=1, min_count=len(names))
    return np.asarray(squares.groupby(run.metrics["cycle"]).mean() ** 0.5)


def measure_error(run: Run) -> float:
    """Transfer error, m: median over the last cycles; of a run that ended before, infinite."""
    if run.status != "completed":
        return np.inf
    return float(np.median(_root_mean_square(run, "transfer_rmse_x", "transfer_rmse_y")[-LAST_CYCLES:]))


def measure_level(run: Run) -> float:
    """Feedback torque at the end over that of the cycle whose torque acts; without one, over its least."""
    if run.status != "completed":
        return np.inf
    feedback = _root_mean_square(run, "feedback_rms")
    restored = [event["restored"] for event in run.manifest["guard"]]
    windows = sliding_window_view(feedback[1:], min(LAST_CYCLES, len(feedback) - 1))
    best = feedback[max(restored[-1], 1) - 1] if restored else np.median(windows, axis=1).min()
    return float(np.median(feedback[-LAST_CYCLES:]) / best)


def compare(results: Results, name: str, kind: str) -> Array:
    """(worlds,): a measure over that with feedback only in the same world, where that completes."""
    alone = {row.settings["world"]: row for row in results.select(kind=ALONE).rows if row.run.completed}
    return np.array(
        [
            _end(row, name) / _end(alone[row.settings["world"]], name)
            for row in results.select(kind=kind).rows
            if row.settings["world"] in alone
        ]
    )


def _end(row: RunRow, name: str) -> float:
    """A measure of a row; a metric as its median over the last cycles."""
    if name in row.measures:
        return row.measures[name]
    done = row.run.completed
    return float(np.median(row.run.pooled[name][-LAST_CYCLES:])) if done else np.inf


def no_worse(results: Results, kind: str) -> Array:
    """(worlds,): whether the error at the end is that of feedback only at most."""
    return np.array(compare(results, ERROR, kind) <= WORSE)


def completes(results: Results, kind: str) -> Array:
    """(worlds,): whether a run ends as planned where feedback only does."""
    return np.array(np.isfinite(compare(results, ERROR, kind)))


def never_worse(machine: str) -> Finding:
    """Whether guarded learning is ever worse than feedback only."""
    of, name = {"part": WORLDS, "machine": machine}, machine[0].upper() + machine[1:]
    return Finding(
        [
            percent(
                "guarded runs that complete, of those that do with feedback only", partial(completes, kind=GUARDED),
                at_least(ENOUGH), of=of,
            ),
            percent(
                f"guarded runs whose error is at most {WORSE:g} times that with feedback only",
                partial(no_worse, kind=GUARDED), at_least(ENOUGH), of=of,
            ),
        ],
        yes=f"{name}: guarded learning ends no worse than feedback only. {{value}} of the runs complete, and "
        "{values[1]} have no larger error.",
        no=f"{name}: guarded learning can end worse than feedback only. {{value}} of the runs complete, and "
        "{values[1]} have no larger error.",
    )  # fmt: skip


def table_worlds(results: Results) -> "pd.DataFrame":
    """How guarded and unguarded runs end, over feedback only, for every machine."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for machine, worlds in results.select(part=WORLDS).by("machine").items():
        for kind in (GUARDED, UNGUARDED):
            error, force = compare(worlds, ERROR, kind), compare(worlds, "force_rmse", kind)
            rows.append(
                {
                    "machine": machine,
                    "learning": kind,
                    "worlds": len(error),
                    "complete": int(np.isfinite(error).sum()),
                    "no worse": int((error <= WORSE).sum()),
                    "error over feedback only, median": float(np.median(error)),
                    "largest": float(error.max()),
                    "force error, median": float(np.median(force)),
                    "greater force error": int((force > WORSE).sum()),
                }
            )
    return pd.DataFrame(rows)


def draw_errors(results: Results) -> "Figure":
    """Error over that with feedback only, of all worlds in the order of their ratio."""
    panels = []
    for machine, worlds in results.select(part=WORLDS).by("machine").items():
        ratios = {kind: np.sort(compare(worlds, ERROR, kind)) for kind in (GUARDED, UNGUARDED)}
        series = [
            Series(kind, np.arange(1.0, len(ratio) + 1)[np.isfinite(ratio)], ratio[np.isfinite(ratio)])
            for kind, ratio in ratios.items()
        ]
        panels.append(Panel(machine, "worlds, in order", "error over feedback only", series, log="y"))
    return draw(panels, columns=2)


def count_worlds(results: Results) -> dict[str, Any]:
    """Worlds that were drawn, and those in which feedback only completes, by machine."""
    machines = results.select(part=WORLDS).by("machine")
    alone = {machine: worlds.select(kind=ALONE) for machine, worlds in machines.items()}
    return {
        "drawn": {machine: len(part) for machine, part in alone.items()},
        "walked": {machine: sum(part.completed) for machine, part in alone.items()},
    }
