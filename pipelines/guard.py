"""The guard of learning: guarded and unguarded runs under random conditions against feedback only.

``python -m pipelines.guard`` (needs the extra ``robots``; its quick form does not) draws random worlds and
hyperparameters for one leg, the quadruped and two robots, and runs each with feedback only, with guarded and with
unguarded learning. One leg also learns for many cycles with random hyperparameters.
"""

from functools import partial

import numpy as np
import pandas as pd

from cmacexp.models.robot_file import package_models
from cmacexp.study import (
    FINAL_CYCLES,
    UNPAIRED,
    Array,
    DataFrame,
    Declared,
    Results,
    Run,
    Sample,
    compute_final,
    declare,
    relative,
)
from pipelines.common_results import if_completed, slide_median
from pipelines.worlds import ALIENGO, GO1, HARD, ONE_LEG, QUADRUPED, draw_hard_world, draw_long

KINDS = {
    "feedback only": ["feedforward=none"],
    "guarded": ["learning.guard=freeze"],
    "unguarded": ["learning.guard=none"],
}
WORLDS = {ONE_LEG: (240, 100), QUADRUPED: (480, 100), GO1: (45, 40), ALIENGO: (45, 40)}
"""Number of random worlds, in some of which feedback only does not complete, and cycles of a run, by machine."""
IN_PLANE, FORCE = partial(Results.measure, name="error"), partial(Results.end, name="force_rmse")
"""Errors compared with those of feedback only: of feet in transfer, m, and of force, N."""
WORSE = 1.05
"""Largest ratio of an error to that with feedback only that counts as no worse."""


def _draw(machine: str, *kinds: str) -> Declared:
    """Return the runs of a machine in its random worlds, with each of these kinds of learning."""
    number, cycles = WORLDS[machine]
    skipped = machine == ALIENGO or (machine == GO1 and not package_models())
    return {
        "set": [*HARD[machine], f"cycles={cycles}", f"record.cycles=[{cycles}]"],
        "quick": None if skipped else {"cycles": 4, "record.cycles": [4]},
        "over": {
            "world": {world: [*draw_hard_world(machine, world), "warn=false"] for world in range(number)},
            "kind": {kind: KINDS[kind] for kind in kinds},
        },
        "labels": {"part": "worlds", "machine": machine},
    }


def _learn_long(kind: str, cycles: int, quick: int) -> Declared:
    """Return runs of one leg with random hyperparameters, over ``cycles`` cycles, or ``quick`` in the quick form."""
    return {
        "set": [*HARD[ONE_LEG], f"cycles={cycles}", f"record.cycles=[{cycles}]", "warn=false"],
        "quick": {"cycles": quick, "record.cycles": [quick]},
        "over": {"world": {number: [*draw_long(number)] for number in range(110)}, "kind": {kind: KINDS[kind]}},
        "labels": {"part": "long", "machine": ONE_LEG},
    }


@if_completed
def measure_error(run: Run) -> float:
    """Return the final transfer error in the plane of the leg (x and y), also for robots, m."""
    return compute_final(np.hypot(*(run.pooled[f"transfer_rmse_{axis}"] for axis in "xy")))


@if_completed
def measure_level(run: Run) -> float:
    """Return the final RMS feedback torque relative to that of the best cycle.

    The best cycle is the one whose feedforward the guard restored last; if it never did, the least moving median.
    """
    feedback = run.pooled["feedback_rms"]
    restored = [event["restored"] for event in run.manifest["guard"]]
    best = feedback[max(restored[-1], 1) - 1] if restored else slide_median(feedback[1:], FINAL_CYCLES).min()
    return float(compute_final(feedback) / best)


def compare(results: Results, kind: str = "guarded", sample: Sample = IN_PLANE) -> Array:
    """Return a final error relative to that with feedback only in the same world, (worlds,).

    Worlds in which feedback only does not complete are left out.
    """
    ratios = relative(results.select(kind=kind), results.select(kind="feedback only"), sample)
    return np.array(ratios[ratios != UNPAIRED])


def find_long(results: Results) -> Results:
    """Select the long guarded runs with hyperparameters with which feedback only completes its short run."""
    feedback_only, guarded = (results.select(part="long", kind=kind).rows for kind in ("feedback only", "guarded"))
    walks = {row.settings["world"] for row in feedback_only if row.run.completed}
    return Results([row for row in guarded if row.settings["world"] in walks], results.computed)


def table_worlds(results: Results) -> DataFrame:
    """Tabulate the final errors of guarded and unguarded runs relative to feedback only, for every machine."""
    ratios = {
        (machine, kind): [compare(worlds, kind, sample) for sample in (IN_PLANE, FORCE)]
        for machine, worlds in results.select(part="worlds").by("machine").items()
        for kind in ("guarded", "unguarded")
    }
    return pd.DataFrame(
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
        for (machine, kind), (error, force) in ratios.items()
    )


def values(results: Results) -> Declared:
    """Return the counts that the page shows: worlds drawn and walked with feedback only, long runs, guard actions."""
    feedback_only = results.select(part="worlds", kind="feedback only").by("machine")
    lasting = find_long(results)
    return {
        "drawn": {machine: len(runs) for machine, runs in feedback_only.items()},
        "walked": {machine: sum(runs.completed) for machine, runs in feedback_only.items()},
        "long": lasting.value("cycles"),
        "settings": len(lasting),
        "acted": sum(bool(run.manifest["guard"]) for run in lasting.runs),
    }


STUDY = declare(
    title="The guard of learning",
    question="Can a run that learns end worse than with feedback only, when its learning is guarded?",
    runs=[
        *(_draw(machine, *kinds) for machine in WORLDS for kinds in (("feedback only", "guarded"), ("unguarded",))),
        _learn_long("guarded", 10_000, 12),
        _learn_long("feedback only", 20, 20),
    ],
    measures={"error": measure_error, "level": measure_level},
    findings={
        **{
            f"guarded_{machine}": {
                "says": f"{machine[0].upper()}{machine[1:]}: guarded learning ends no worse than feedback only",
                "criteria": [
                    {"quantity": "guarded runs that complete, of those that do with feedback only",
                     "value": lambda results: np.isfinite(compare(results)),
                     "of": {"part": "worlds", "machine": machine}, "limit": "at least 95 %"},
                    {"quantity": "guarded runs whose error is at most 1.05 times that with feedback only",
                     "value": lambda results: compare(results) <= WORSE,
                     "of": {"part": "worlds", "machine": machine}, "limit": "at least 95 %"},
                ],
            }
            for machine in WORLDS
        },
        "lasts": {
            "says": "Guarded learning of one leg lasts with random settings: long runs complete and keep their "
            "feedback low",
            "criteria": [
                {"quantity": "long runs that complete", "value": lambda results: find_long(results).completed,
                 "limit": "at least 95 %"},
                {"quantity": "long runs whose feedback ends at most 1.2 times as high as in the best cycle",
                 "value": lambda results: find_long(results).measure("level") <= 1.2, "limit": "at least 95 %"},
            ],
        },
    },
    tables={"worlds": table_worlds},
    values=values,
)  # fmt: skip
