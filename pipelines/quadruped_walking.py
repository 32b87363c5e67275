"""Four legs walk (Lin & Song 1997, section 6, Fig. 14 to 20).

``python -m pipelines.quadruped_walking`` walks with and without posture control and CMAC, with noisy sensors, and
longer than the paper, and draws the paper's figures from these runs.
"""

from functools import partial
from typing import Any

import numpy as np

from cmacexp.study import DataFrame, Figure, Request, Results, Study, grid
from cmacexp.study.tables import completed, ends, tabulate
from pipelines import quadruped_walking_events as measured
from pipelines import quadruped_walking_figures as figures
from pipelines.common_results import draw_cycles
from pipelines.quadruped_walking_events import LATE, Walk, instants
from pipelines.quadruped_walking_statements import (
    ALL,
    AWARE,
    CLAIMS,
    ERRORS,
    FEEDBACK,
    FINDINGS,
    LADDER,
    LEAD,
    LONG,
    NO_CMAC,
    NO_POSTURE,
    NOISE,
    PRINTED,
    PUBLISHED,
)

CONTROLLERS = {
    FEEDBACK: ["feedforward=none", "posture.gain=0"],
    NO_POSTURE: ["posture.gain=0", "learning.start_cycle=1"],
    NO_CMAC: ["feedforward=none"],
    ALL: [],
}
REFERENCES = {"reference": [reference["reference"] for reference in (PRINTED, AWARE)]}
UNSEEDED = (FEEDBACK, NO_CMAC)
"""Controllers that learn nothing, so that with perfect sensors no seed matters."""
LAWS = {PUBLISHED: ["learning.lead=0"], LEAD: ["learning.lead=1"]}
NOISES = {
    "force.noise_relative": 0.2,
    "position.noise": 1e-4,
    "velocity.noise": 0.02,
    "height.noise": 1e-4,
    "tilt.noise": 1e-4,
}
"""White noise of sensors, in the fields' units."""


def runs(quick: bool) -> list[Request]:
    """The ladder of controllers; noisy sensors with and without CMAC; and two learning laws for long."""
    short, long = (5, 8) if quick else (20, 500)
    walk = ("scenario=quadruped", f"cycles={short}")
    found = []
    for name, overrides in CONTROLLERS.items():
        found += grid(*walk, *overrides, over=REFERENCES, seeded=name not in UNSEEDED, part=LADDER, controller=name)
    last = ",".join(str(cycle) for cycle in range(max(1, short - LATE + 1), short + 1))
    noisy = ["sensors=real", *(f"sensors.{key}={level}" for key, level in NOISES.items())]
    for name in (NO_CMAC, ALL):
        own = (*walk, *CONTROLLERS[name], *noisy, f"record.cycles=[{last}]")
        found += grid(*own, over=REFERENCES, seeded=True, part=NOISE, controller=name)
    run = ("scenario=quadruped", f"cycles={long}", "record.cycles=[1]")
    return found + grid(*run, over={"law": LAWS}, seeded=True, part=LONG, controller=ALL)


def events(results: Results) -> DataFrame:
    """The events of the full controller with both references: one row per run and whole cycle."""
    import pandas as pd

    own = results.select(part=LADDER, controller=ALL)
    labels = [{name: row.settings[name] for name in ("reference", "seed")} for row in own.rows]
    found = [
        measured.events_in(run).assign(run=str(run.folder), **by) for run, by in zip(own.runs, labels, strict=True)
    ]
    return pd.concat(found, ignore_index=True)


def deviations(results: Results) -> DataFrame:
    """What noise changes in the last cycles, by controller, reference and seed: ``feet``, mm, and ``force``, N.

    RMS over all samples and legs of the difference from the run with perfect sensors and the same settings; infinite
    if either run did not complete.
    """
    import pandas as pd

    noisy, rows = results.select(part=NOISE), []
    for row, run in zip(noisy.rows, noisy.runs, strict=True):
        by = {name: row.settings[name] for name in ("controller", "reference", "seed")}
        same = {**by, "seed": 0} if by["controller"] in UNSEEDED else by
        reference = results.select(same, part=LADDER).run
        feet = force = np.inf
        if run.status == reference.status == "completed":
            cycles, columns = range(max(1, run.whole_cycles - LATE + 1), run.whole_cycles + 1), ["x", "y", "force"]
            change = ((run.cycles(cycles)[columns] - reference.cycles(cycles)[columns]) ** 2).mean()
            feet, force = 1e3 * float(change["x"] + change["y"]) ** 0.5, float(change["force"]) ** 0.5
        rows.append({**by, "feet": feet, "force": force})
    return pd.DataFrame(rows)


def shown_walk(results: Results) -> tuple[Walk, int]:
    """The walk that the paper's figures are drawn from, and the cycle: its last."""
    run = results.select(AWARE, part=LADDER, controller=ALL).run
    return measured.walk_in(run.folder), run.whole_cycles


def values(results: Results) -> dict[str, Any]:
    """Settings of the runs, and when Fig. 17 to 20 are."""
    printed, (walk, cycle) = results.select(PRINTED, part=LADDER, controller=ALL), shown_walk(results)
    began = walk.view.time[walk.view.cycle == cycle][0]
    times = {f"fig{n}": float(walk.view.time[k] - began) for n, k in instants(walk, cycle).items()}
    return times | {
        "last": cycle, "late": LATE, "depth": figures.DEPRESSION_SCALE, "cycles": printed.value("cycles"),
        "long": results.select(part=LONG).value("cycles"), "cmac_from": printed.value("learning.start_cycle"),
        "noises": ", ".join(f"`sensors.{key}={level}`" for key, level in NOISES.items()),
        "hip_height": 1e3 * printed.value("machine.hip_height"), "length": 1e3 * walk.length,
    }  # fmt: skip


def draw_views(results: Results, number: int) -> Figure:
    """Fig. 16 to 20."""
    return figures.views(*shown_walk(results), number)


STUDY = Study(
    title="Quadruped walking",
    question="How do posture control and a CMAC for each leg change the walk of four legs on soft ground, with "
    "perfect and with noisy sensors, and for how long?",
    runs=runs,
    computed={"events": events, "noise": deviations},
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "fig14": lambda r: figures.gait_diagram(shown_walk(r)[0]),
        "fig15": lambda r: figures.diagram(shown_walk(r)[0]),
        **{f"fig{number}": partial(draw_views, number=number) for number in range(16, 21)},
        "learning": lambda r: draw_cycles(
            r.select(part=LADDER, controller=ALL),
            ("feedforward_share", "tilt_max", "transfer_rmse_y", "force_rmse_three_feet"), by="reference",
        ),
        "long": lambda r: draw_cycles(
            r.select(part=LONG), ("transfer_rmse_x", "transfer_rmse_y", "feedback_rms"), by="law", columns=3
        ),
    },
    tables={
        "ladder": lambda r: tabulate(
            r.select(part=LADDER), {"controller": "controller", "reference": "reference"},
            {"walk to the end": completed, **ends((*ERRORS, "feedforward_share", "tilt_max"), LATE)},
        ),
        "noise": lambda r: r.computed["noise"]
        .drop(columns="seed")
        .groupby(["controller", "reference"], as_index=False)
        .mean(),
    },
    values=values,
)  # fmt: skip
