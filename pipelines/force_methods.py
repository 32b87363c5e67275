"""Four ways to control the force of a point mass (Lin & Song 1997, sections 2 and 3, eq. 8-15).

``python -m pipelines.force_methods`` lowers a mass onto soft and hard ground under each method, releases it without
ground, and tests ground whose stiffness differs from the assumed one.
"""

import math
from functools import partial

import numpy as np

from cmacexp.control.hybrid_kernels import METHODS as FORCE_METHODS
from cmacexp.study import (
    Array,
    Declared,
    Figure,
    Panel,
    Results,
    Run,
    Series,
    compute_growth,
    declare,
    draw,
    of_completed,
    quotients,
)
from pipelines.common_results import find_depression, if_completed

METHODS = {name: [f"force_control={name}"] for name in FORCE_METHODS}
GROUNDS = {f"{stiffness:g} N/m": [f"terrain.stiffness={stiffness}"] for stiffness in (10.0, 100.0)}
"""The ground stiffness of section 5, from which the references are computed, and ten times that."""
CLEARANCE = "machine.start_clearance"
PRINTED = {"machine.mass": 0.5}
DIGITS = 6
"""Decimals of measures; further ones are rounding errors of the simulation."""


@if_completed
def settled_force(run: Run) -> float:
    """Return the mean force over the second half of a run, relative to the desired force."""
    return round(float(run.metrics["force_settled"].iloc[0]) / run.config["force_control"]["desired_force"], DIGITS)


@if_completed
def rest_error(run: Run) -> float:
    """Return the RMS force error over the second half of a run, relative to the desired force."""
    ripple = float(run.metrics["force_ripple"].iloc[0]) / run.config["force_control"]["desired_force"]
    return round(math.hypot(settled_force(run) - 1.0, ripple), DIGITS)


@if_completed
def end_speed(run: Run) -> float:
    """Return the speed in the last step of a run, m/s."""
    return round(abs(float(run.trace["vy"].iloc[-1])), DIGITS)


def predicted_force(config: Declared) -> float:
    """Predict the ratio of settled to desired force on ground whose stiffness differs from the assumed one.

    The reference depth of eq. 9 and 13 is computed for the assumed ground. On the true ground it yields the force for
    which the same depth would have been computed. Damping and explicit control do not use the stiffness: 1.
    """
    ground = config["terrain"]
    assumed = find_depression(config, ground["assumed_stiffness"] or ground["stiffness"])
    ratio = assumed / find_depression(config)
    return 1.0 if math.isnan(ratio) else ratio


def over_best_other(results: Results, metric: str) -> Array:
    """Return a metric of combined control relative to the best other method that comes to rest, (clearances,).

    Infinite if combined control does not come to rest.
    """
    rests = np.isfinite(results.at(1, metric)) & (results.measure("rest_error") <= 0.02)
    runs = results.table.assign(value=np.where(rests, results.at(1, metric), np.inf)).set_index(CLEARANCE)
    combined = runs["value"][runs["method"] == "combined"]
    best_other = runs["value"][runs["method"] != "combined"].groupby(CLEARANCE).min()
    return quotients(combined.to_numpy(), best_other[combined.index].to_numpy())


def _find_springs(results: Results) -> tuple[Array, Array]:
    """Return the apparent stiffness at the foot under stiffness control, measured and by eq. 8, N/m, (elasticities,).

    Elasticities are in rising order. The measured value follows from force and position at rest on two grounds.
    """
    groups = dict(sorted(results.by("force_control.elasticity").items()))
    gain = float(results.value("controller.position_gain"))
    measured = []
    for pair in groups.values():
        softer, stiffer = (run.trace.iloc[-1] for run in pair.runs)
        measured.append(round(-(stiffer["force"] - softer["force"]) / (stiffer["y"] - softer["y"]), DIGITS))
    return np.array(measured), np.array([gain / (1.0 + gain * float(elasticity)) for elasticity in groups])


def _find_softening(results: Results) -> Array:
    measured, _ = _find_springs(results)
    return measured[1:] / measured[:-1]


def draw_forces(results: Results) -> Figure:
    """Draw the contact force in the first seconds after the release, a panel for each method."""
    panels = []
    for method, runs in results.select({CLEARANCE: 0.05, "part": "known ground", **PRINTED}).by("method").items():
        series = [
            Series(f"ground {ground}", group.run.trace["time"], group.run.trace["force"])
            for ground, group in runs.by("ground").items()
        ]
        panels.append(
            Panel(
                method, "time since the release, s", "force, N", series, x_range=(0.0, 2.0), y_range=(0.0, 4.0),
                y_limits=[runs.value("force_control.desired_force")],
            )
        )  # fmt: skip
    return draw(panels, height=2.0)


ASSUMED = ["scenario=force_step", "terrain.assumed_stiffness=10.0"]
KNOWN: Declared = {"ground": GROUNDS, CLEARANCE: [0.05, 0.02, 0.035, 0.075, 0.1]}
"""Known grounds, and heights of the release above them, m, the scenario's first; the paper gives none."""
EXPLICIT = {"explicit": [*METHODS["explicit"], "machine.mass=1.0"]}
FORCE_MISS = {
    "quantity": "error of the mean force on ground twice as stiff as assumed",
    "value": lambda runs: abs(runs.measure("settled_force") - 1),
    "of": {"part": "ground not as assumed", "terrain.stiffness": 20.0},
}  # fmt: skip
STUDY = declare(
    title="Four methods of force control",
    question="How do stiffness, damping, combined and explicit force control press on soft, hard and no ground, and "
             "on ground that is not as stiff as assumed?",
    runs=[
        {"set": ["scenario=force_step"], "over": {"method": METHODS, **KNOWN}, "labels": {"part": "known ground"}},
        {"set": ["scenario=force_step"], "over": {"method": EXPLICIT, **KNOWN}, "labels": {"part": "known ground"}},
        {"set": [*ASSUMED, "terrain.stiffness=0.001"], "over": {"method": METHODS}, "labels": {"part": "no ground"}},
        {"set": ASSUMED, "over": {"method": METHODS | EXPLICIT, "terrain.stiffness": [2.5, 5.0, 10.0, 20.0, 40.0]},
         "labels": {"part": "ground not as assumed"}},
        {"set": [*ASSUMED, "force_control=stiffness"], "labels": {"part": "spring"},
         "over": {"force_control.elasticity": [0.0, 0.01, 0.03, 0.1, 0.3], "terrain.stiffness": [10.0, 11.0]}},
    ],
    measures={
        "rest_error": rest_error, "settled_force": settled_force, "end_speed": end_speed,
        "predicted": lambda run: predicted_force(run.config),
    },
    claims={
        "spring": {
            "words": "Stiffness control behaves like a spring; the smaller the elasticity, the stiffer it is",
            "where": "section 3.1, eq. 8",
            "criteria": [
                {"quantity": "apparent stiffness over that at the next smaller elasticity", "value": _find_softening,
                 "of": {"part": "spring"}, "limit": "at most 0.9", "opposite": "at least 1"},
                {"quantity": "difference of the apparent stiffness from eq. 8",
                 "value": lambda results: abs(np.divide(*_find_springs(results)) - 1.0),
                 "of": {"part": "spring"}, "limit": "at most 2 %", "opposite": "at least 10 %"},
            ],
        },
    },
    findings={
        "combined_best": {
            "says": "Combined control has the least overshoot and the least ITAE of the methods that come to rest",
            "criteria": [
                {"quantity": f"{name} of combined control over the least of the other methods that come to rest",
                 "value": lambda results, metric=metric: over_best_other(results, metric),
                 "of": {"part": "known ground", **PRINTED}, "each": {"ground": [*GROUNDS]}, "limit": "at most 1"}
                for metric, name in (("force_overshoot", "overshoot"), ("force_itae", "ITAE"))
            ],
        },
        "approach": {
            "says": "Without ground the methods with a position term come to rest, damping and explicit control do "
            "not: where one law has to serve approach and contact, take stiffness or combined control",
            "criteria": [
                {"quantity": "speed at the end without ground", "value": lambda runs: runs.measure("end_speed"),
                 "of": {"part": "no ground"}, "infinite": "the run diverged", "each": {"method": methods},
                 "limit": limit}
                for methods, limit in (
                    (["stiffness", "combined"], "at most 0.01 m/s"), (["damping", "explicit"], "at least 0.05 m/s"),
                )
            ],
        },
        "mismatch": {
            "says": "Methods that press through a position need the stiffness of the ground, damping and explicit "
            "control do not",
            "criteria": [
                {**FORCE_MISS, "each": {"method": ["stiffness", "combined"]}, "limit": "at least 10 %"},
                {**FORCE_MISS, "each": {"method": ["damping", "explicit"]}, "limit": "at most 2 %"},
            ],
        },
        "prediction": {
            "says": "Equations 8 to 15 predict every method's mean force on ground 0.25 and 4 times as stiff as "
            "assumed",
            "criteria": [
                {"quantity": "difference of the mean force from eq. 8 to 15, largest of all methods",
                 "value": lambda runs: abs(
                     compute_growth(runs.measure("settled_force"), runs.measure("predicted")) - 1
                 ).max(keepdims=True),
                 "of": {"part": "ground not as assumed", "terrain.stiffness": 10.0 * factor},
                 "case": f"{factor:g} times the assumed stiffness", "limit": "at most 2 %"}
                for factor in (0.25, 4.0)
            ],
        },
    },
    figures={
        "forces": draw_forces,
        "mismatch": [
            {"value": partial(Results.measure, name=measure), "over": "terrain.stiffness", "by": "method",
             "of": {"part": "ground not as assumed"}, "log": "x", "title": title, "y": "settled over desired force"}
            for title, measure in (("measured", "settled_force"), ("eq. 8 to 15", "predicted"))
        ],
    },
    tables={
        "methods": {
            "rows": {"ground": "ground", "method": "method", "machine.mass": "mass, kg"},
            "columns": {
                **of_completed(
                    {
                        "settled / desired": lambda runs: runs.measure("settled_force"),
                        "ripple, N": lambda runs: runs.at(1, "force_ripple"),
                        "overshoot, %": lambda runs: 100 * runs.at(1, "force_overshoot"),
                        "2 % settling, s": lambda runs: runs.at(1, "force_settling_time"),
                        "ITAE, N s²": lambda runs: runs.at(1, "force_itae"),
                    }
                ),
                "ends": lambda runs: runs.rows[0].run.outcome.status,
            },
            "of": {CLEARANCE: 0.05, "part": "known ground"},
        }
    },
)  # fmt: skip
