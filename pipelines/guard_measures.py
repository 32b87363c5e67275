"""What the study of the guard of learning runs and measures: random worlds, with feedback only beside learning."""

from functools import partial
from typing import Any

import numpy as np

from cmacexp.data.run import Run
from cmacexp.metrics.final import FINAL_CYCLES, compute_final
from cmacexp.report.figures import Panel, Series
from cmacexp.study import DataFrame, Figure, Finding, Request, Results, at_least, draw, grid
from cmacexp.study.interval import UNPAIRED
from cmacexp.study.samples import Sample, relative
from cmacexp.typing import Array
from pipelines.common_results import find_least, percent
from pipelines.worlds import HARD, draw_hard_world

ALONE, GUARDED, UNGUARDED = "feedback only", "guarded", "unguarded"
KINDS = {ALONE: ("feedforward=none",), GUARDED: ("learning.guard=freeze",), UNGUARDED: ("learning.guard=none",)}
ERROR, LEVEL = "error", "level"
"""Measures."""
IN_PLANE, FORCE = partial(Results.measure, name=ERROR), partial(Results.end, name="force_rmse")
"""Errors that are compared."""
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
    common = (*HARD[machine], f"cycles={cycles}", f"record.cycles=[{cycles}]", "warn=false")
    labels: dict[str, Any] = {"part": WORLDS, "machine": machine}
    return [
        request
        for world in range(number)
        for request in grid(*common, *draw_hard_world(machine, world), over={"kind": KINDS}, world=world, **labels)
    ]


def measure_error(run: Run) -> float:
    """Final transfer error in the plane of the legs, also of robots, m; infinite of a run that ended before."""
    sides = [run.pooled[f"transfer_rmse_{axis}"] for axis in "xy"] if run.status == "completed" else []
    return compute_final(np.hypot(*sides)) if sides else np.inf


def measure_level(run: Run) -> float:
    """Feedback torque at the end over that of the cycle whose torque acts; without one, over its least."""
    if run.status != "completed":
        return np.inf
    feedback = run.pooled["feedback_rms"]
    restored = [event["restored"] for event in run.manifest["guard"]]
    best = feedback[max(restored[-1], 1) - 1] if restored else find_least(feedback[1:], FINAL_CYCLES)
    return float(compute_final(feedback) / best)


def compare(results: Results, sample: Sample, kind: str) -> Array:
    """(worlds,): a final error over that with feedback only in the same world, where that completes."""
    ratios = relative(results.select(kind=kind), results.select(kind=ALONE), sample)
    return np.array(ratios[ratios != UNPAIRED])


def no_worse(results: Results, kind: str) -> Array:
    """(worlds,): whether the error at the end is that of feedback only at most."""
    return np.array(compare(results, IN_PLANE, kind) <= WORSE)


def completes(results: Results, kind: str) -> Array:
    """(worlds,): whether a run ends as planned where feedback only does."""
    return np.array(np.isfinite(compare(results, IN_PLANE, kind)))


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
        says=f"{name}: guarded learning ends no worse than feedback only",
    )  # fmt: skip


def table_worlds(results: Results) -> DataFrame:
    """How guarded and unguarded runs end, over feedback only, for every machine."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for machine, worlds in results.select(part=WORLDS).by("machine").items():
        for kind in (GUARDED, UNGUARDED):
            error, force = compare(worlds, IN_PLANE, kind), compare(worlds, FORCE, kind)
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


def draw_errors(results: Results) -> Figure:
    """Error over that with feedback only, of all worlds in the order of their ratio."""
    panels = []
    for machine, worlds in results.select(part=WORLDS).by("machine").items():
        ratios = {kind: np.sort(compare(worlds, IN_PLANE, kind)) for kind in (GUARDED, UNGUARDED)}
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
