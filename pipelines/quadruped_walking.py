"""Walking of the quadruped (Lin & Song 1997, section 6, Fig. 14, 16 to 20).

``python -m pipelines.quadruped_walking`` simulates walks with and without posture control and CMAC, with noisy
sensors, and for more cycles than the paper; it draws the paper's figures from these runs.
"""

from functools import partial

import numpy as np
import pandas as pd

from cmacexp.recording.run_view import RunView
from cmacexp.study import (
    Array,
    DataFrame,
    Declared,
    Results,
    completed,
    declare,
    of_completed,
    quotients,
)
from pipelines import quadruped_walking_trace as trace

CONTROLLERS = {
    "feedback": ["feedforward=none", "posture.gain=0"],
    "feedback + posture": ["feedforward=none"],
    "feedback + CMAC": ["posture.gain=0", "learning.start_cycle=1"],
    "all": [],
}
UNSEEDED = ["feedback", "feedback + posture"]
"""Controllers that do not learn, so that with perfect sensors the seed has no effect."""
WALK: Declared = {"set": ["scenario=quadruped", "cycles=20"], "quick": {"cycles": 5}, "seeds": True}
NOISY: Declared = {
    **WALK,
    "set": [
        *WALK["set"],
        "sensors=real",
        "sensors.force.noise_relative=0.2",
        "sensors.position.noise=1e-4",
        "sensors.velocity.noise=0.02",
        "sensors.height.noise=1e-4",
        "sensors.tilt.noise=1e-4",
        "record.cycles=[16,17,18,19,20]",
    ],
    "quick": {"cycles": 5, "record.cycles": [1, 2, 3, 4, 5]},
}
LADDER = {"part": "ladder", "controller": "all"}
"""Labels of the runs with the full controller and perfect sensors."""


def _request(label: str, controllers: list[str], **keys: object) -> Declared:
    """Return runs of controllers with two references: eq. 24 as printed, and without F_d/K_ap once a CMAC acts.

    ``keys`` are further keys of the declaration.
    """
    return {
        **keys,
        "over": {"controller": {name: CONTROLLERS[name] for name in controllers}, "reference": ["literal", "aware"]},
        "labels": {"part": label},
    }


def deviations(results: Results) -> DataFrame:
    """Compute the change by noise in the last cycles, by controller, reference and seed.

    ``feet``, mm, and ``force``, N, are the RMS over all samples and legs of the difference from the run with perfect
    sensors and otherwise the same overrides; infinite if either run did not complete.
    """
    rows = []
    for row in results.select(part="noise").rows:
        by = {name: row.settings[name] for name in ("controller", "reference", "seed")}
        same = {**by, "seed": 0} if by["controller"] in UNSEEDED else by
        reference = results.select(same, part="ladder").run
        change = dict.fromkeys(("x", "y", "force"), np.inf)
        if row.run.status == reference.status == "completed":
            cycles = range(max(1, row.run.whole_cycles - trace.LATE + 1), row.run.whole_cycles + 1)
            noisy, perfect = (run.read_trace(cycles) for run in (row.run, reference))
            change = {name: float(np.mean((noisy[name] - perfect[name]) ** 2)) for name in change}
        rows.append({**by, "feet": 1e3 * (change["x"] + change["y"]) ** 0.5, "force": change["force"] ** 0.5})
    return pd.DataFrame(rows)


def noise_ratio(results: Results, column: str) -> Array:
    """Return the change by noise with CMAC relative to that without, (seeds,); ``column``: feet or force."""
    table = results.computed["noise"]
    same_reference = table[table["reference"] == results.value("reference")]
    by_seed = same_reference.pivot_table(index="seed", columns="controller", values=column)
    return quotients(by_seed["all"].to_numpy(), by_seed["feedback + posture"].to_numpy())


def shown_walk(results: Results) -> tuple[RunView, int]:
    """Return the walk from which the paper's figures are drawn, and the cycle: its last."""
    run = results.select(LADDER, reference="aware").run
    return trace.view_walk(run.folder), run.whole_cycles


def values(results: Results) -> Declared:
    """Return the last cycle, and the times of Fig. 17 to 20 from its start, s."""
    walk, cycle = shown_walk(results)
    began = walk.time[walk.cycle == cycle][0]
    instants = trace.instants(trace.walk_in(walk), cycle)
    return {"last": cycle} | {f"fig{n}": walk.time[k] - began for n, k in instants.items()}


NOISE: list[Declared] = [
    {"quantity": "change by noise with CMAC over that without, last 5 cycles",
     "value": partial(noise_ratio, column=column),
     "of": {"part": "noise", "controller": ["feedback + posture", "all"]}, "case": what,
     "limit": "at most 0.8", "opposite": "at least 1"}
    for what, column in (("the feet's positions", "feet"), ("the contact forces", "force"))
]  # fmt: skip


def _scale_end(results: Results, name: str, scale: float) -> Array:
    """Return a final metric multiplied by ``scale``, a conversion of units, (runs,)."""
    return scale * results.end(name, trace.LATE)


def _with(reference: str, criteria: list[Declared]) -> list[Declared]:
    return [
        {**criterion, "of": {**LADDER, **criterion.get("of", {}), "reference": reference}} for criterion in criteria
    ]


STUDY = declare(
    title="Quadruped walking",
    question="How do posture control and a CMAC for each leg change the walk of four legs on soft ground, with "
    "perfect and with noisy sensors, and for how long?",
    runs=[
        _request("ladder", UNSEEDED, **{**WALK, "seeds": False}),
        _request("ladder", ["feedback + CMAC", "all"], **WALK),
        _request("noise", ["feedback + posture", "all"], **NOISY),
        {"set": ["scenario=quadruped", "record.cycles=[1]", "cycles=500"], "quick": {"cycles": 8}, "seeds": True,
         "over": {"law": {"as published": ["learning.lead=0"], "lead of one sample": ["learning.lead=1"]}},
         "labels": {"part": "long", "controller": "all"}},
    ],
    measures=trace.MEASURES,
    computed={"noise": deviations},
    claims={
        "noise": {
            "words": "Improved robustness toward the sensor noises because the input of CMAC comes directly from "
            "trajectory planning, not from measurement",
            "where": "section 6.3", "criteria": _with("literal", NOISE),
        },
    },
    findings={
        "aware_noise": {
            "says": "With `reference=aware` the CMAC makes the walk more robust to noise",
            "criteria": _with("aware", NOISE),
        },
        "lean": {
            "says": "Once the CMAC has learnt, the body leans under eq. 24 as printed, and does not with "
            "`reference=aware`",
            "criteria": [
                {"quantity": "largest tilt in a cycle, median of the last 5 cycles",
                 "value": partial(Results.end, name="tilt_max", cycles=trace.LATE),
                 "of": {**LADDER, "reference": reference}, "case": case, "limit": limit}
                for reference, case, limit in (
                    ("literal", "eq. 24 as printed", "at least 50 mrad"),
                     ("aware", "aware reference", "at most 20 mrad"),
                )
            ],
        },
        "rocking": {
            "says": "Most of the force error that is left falls where four feet are planned to be down, and most of "
            "that moves load from one diagonal pair of feet to the other",
            "criteria": [
                {"quantity": f"part of the squared force error {what}, last 5 cycles",
                 "value": partial(Results.measure, name=column), "of": {**LADDER, "reference": "aware"},
                 "limit": "at least 50 %"}
                for what, column in (
                    ("where four feet are planned to be down", "four_feet"),
                    ("there that moves load between the diagonal pairs of feet", "diagonal"),
                )
            ],
        },
        "noise_cost": {
            "says": "With CMAC, noise on all sensors costs little accuracy",
            "criteria": [
                {"quantity": "transfer error at the end, all sensors noisy over perfect ones",
                 "value": partial(Results.end, name=f"transfer_rmse_{side}", cycles=trace.LATE),
                 "of": {**LADDER, "part": "noise", "reference": "aware"},
                 "over": {"part": "ladder"}, "case": f"in {side}", "limit": "at most 1.25"}
                for side in "xy"
            ],
        },
        "lasting": {
            "says": "With the law as published the walk ends early, with a lead of one sample (`learning.lead=1`) it "
            "completes",
            "criteria": [
                {"quantity": "part of the cycles that are walked", "value": lambda runs: runs.done,
                 "of": {"part": "long"}, "each": {"law": law}, "limit": limit}
                for law, limit in (("as published", "at most 90 %"), ("lead of one sample", "at least 90 %"))
            ],
        },
        "bursts": {
            "says": "Even with the lead, errors grow again",
            "quantity": "largest transfer error in x in the last fifth of the cycles over the median of the second "
            "fifth",
            "value": lambda runs: runs.measure("burst"), "of": {"part": "long", "law": "lead of one sample"},
            "limit": "at least 2",
        },
    },
    figures={
        "fig14": lambda results: trace.gait_diagram(shown_walk(results)[0]),
        **{
            f"fig{number}": lambda results, number=number: trace.views(*shown_walk(results), number)
            for number in range(16, 21)
        },
        "learning": [
            {"metric": name, "by": "reference", "of": LADDER, "log": None}
            for name in ("feedforward_share", "tilt_max", "transfer_rmse_y", "force_rmse_three_feet")
        ],
        "long": [
            {"metric": name, "by": "law", "of": {"part": "long"}, "log": None}
            for name in ("transfer_rmse_x", "transfer_rmse_y", "feedback_rms")
        ],
    },
    tables={
        "ladder": {
            "rows": ["controller", "reference"], "of": {"part": "ladder"},
            "columns": {
                "walk to the end": completed,
                **of_completed({
                    title: partial(_scale_end, name=name, scale=scale)
                    for title, scale, name in (
                        ("x error, mm", 1e3, "transfer_rmse_x"),
                        ("y error, mm", 1e3, "transfer_rmse_y"),
                        ("force error, three feet down, N", 1, "force_rmse_three_feet"),
                        ("force error, whole cycle, N", 1, "force_rmse_cycle"),
                        ("CMAC share, %", 100, "feedforward_share"),
                        ("largest tilt, mrad", 1e3, "tilt_max"),
                    )
                }),
            },
        },
        "noise": lambda results: results.computed["noise"]
        .drop(columns="seed")
        .groupby(["controller", "reference"], as_index=False)
        .mean(),
    },
    values=values,
)  # fmt: skip
