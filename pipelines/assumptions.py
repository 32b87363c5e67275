"""Sensitivity of the conclusions to values that Lin & Song 1997 do not give.

``python -m pipelines.assumptions`` changes one assumed value at a time, of one leg, of the quadruped and of the point
mass, and evaluates every conclusion again.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from cmacexp.study import (
    Array,
    Criterion,
    DataFrame,
    Declared,
    Mask,
    Results,
    Sample,
    compute_growth,
    declare,
    format_number,
    read_criteria,
    tabulate,
)

TAKEN = "assumed values"
"""The variant in which no value is changed."""
LEG, WALK, MASS = "leg", "walk", "mass"


def _try(name: str, key: str, *values: str) -> dict[str, list[str]]:
    """Return the overrides of alternative values, by name; all config keys in ``key`` are set to the same value."""
    return {f"{name} {value}": [f"{field}={value}" for field in key.split()] for value in values}


def _try_cmac(inputs: str, ranges: str, shifts: str, memory: int) -> dict[str, list[str]]:
    """Return variants of CMAC parameters that the paper leaves open.

    ``memory`` is the size assumed, bytes. Twice the memory stands for words of half the length: both give the same
    number of rows.
    """
    return {
        **_try("CMAC inputs", "cmac.inputs", *inputs.split()),
        **_try("CMAC range", "cmac.range_factor", *ranges.split()),
        **_try("CMAC displacement", "cmac.displacement", *shifts.split()),
        **_try("memory of 4-byte words", "cmac.memory_bytes", str(2 * memory)),
    }


VARIANTS = {
    LEG: {
        TAKEN: [],
        **_try("knee", "machine.leg.knee", "forward"),
        **_try("stroke", "gait.stroke", "0.1", "0.15", "0.25", "0.3"),
        **_try("lift", "gait.lift", "0.12", "0.2"),
        **_try("vertical path", "gait.vertical", "two_cubics"),
        **_try("LEAD omega", "controller.lead_omega", "2.5", "10", "20"),
        **_try("LEAD alpha", "controller.lead_alpha", "5", "20"),
        **_try_cmac("[angle] [angle,velocity]", "2 3 10", "odd_lattice parks_militzer", 2**20),
    },
    WALK: {
        TAKEN: [],
        **_try("front knees", "machine.legs.left_front.knee machine.legs.right_front.knee", "back"),
        **_try("rear knees", "machine.legs.left_rear.knee machine.legs.right_rear.knee", "forward"),
        **_try("cycle time", "gait.cycle_time", "2", "4"),
        **_try("stroke", "gait.stroke", "0.2", "0.25", "0.35"),
        **_try("lift", "gait.lift", "0.05", "0.15"),
        **_try("vertical path", "gait.vertical", "two_cubics"),
        **_try("touch-down", "gait.touch_down", "[0.5,0,0.3,0.8]", "[0.1,0.6,0.9,0.4]", "[0,0.5,0.75,0.25]"),
        **_try("load ramp", "gait.load_ramp", "0.12"),
        **_try("hip height", "machine.hip_height", "0.45", "0.55"),
        **_try("weight", "machine.weight", "49.05"),
        **_try("reference", "reference", "literal"),
        **_try("learns from cycle", "learning.start_cycle", "3"),
        **_try("LEAD omega", "controller.lead_omega", "5", "20"),
        **_try("LEAD alpha", "controller.lead_alpha", "5", "20"),
        **_try_cmac("[angle] [angle,velocity,acceleration]", "2 5", "odd_lattice", 2**18),
    },
    MASS: {
        TAKEN: [],
        **_try("start clearance", "machine.start_clearance", "0.02", "0.1"),
        **_try("LEAD omega", "controller.lead_omega", "2.5", "10"),
        **_try("LEAD alpha", "controller.lead_alpha", "5", "20"),
    },
}
"""Overrides of each variant, by machine."""


def holds(conclusion: Criterion, results: Results) -> Mask:
    """Check for each of several runs if a conclusion holds, (runs,); False where its value is NaN."""
    values = np.asarray(conclusion.take(results))
    return (conclusion.holds.low <= values) & (values <= conclusion.holds.high)


def _list_tried(results: Results) -> dict[str, Results]:
    """Return the runs of each variant, by its name, without the unchanged one."""
    return {name: group for name, group in results.by("variant").items() if name != TAKEN}


def ended_early(results: Results) -> Array:
    """Count the variants whose run ended early, for each seed, (seeds,)."""
    return np.sum([np.logical_not(group.completed) for group in _list_tried(results).values()], axis=0)


def differs(conclusion: Criterion, results: Results, variant: str) -> Mask:
    """Check for each seed if a variant reverses a conclusion that the assumed values give, (seeds,)."""
    changed, assumed = (holds(conclusion, results.select(variant=name)) for name in (variant, TAKEN))
    return np.not_equal(changed, assumed)


def count_changes(results: Results, conclusion: Criterion) -> Array:
    """Count for each seed the variants that reverse a conclusion, (seeds,).

    Only variants with which the runs of all seeds complete count.
    """
    complete = [name for name, group in _list_tried(results).items() if all(group.completed)]
    return np.sum([differs(conclusion, results, name) for name in complete], axis=0)


def _over_method(results: Results, name: str, method: str) -> Array:
    """Return a metric of combined control divided by that of another method; NaN counts as infinite."""
    combined, other = (results.select(force_control=control).at(1, name) for control in ("combined", method))
    return np.nan_to_num(combined, nan=np.inf) / np.nan_to_num(other, nan=np.inf)


def _conclude(quantity: str, value: Sample, limit: str) -> Criterion:
    """Return the criterion of a conclusion: a quantity of a run, and the limit within which the conclusion holds."""
    return read_criteria({"quantity": quantity, "value": value, "limit": limit})[0]


def _growth(results: Results, read: Callable[[Results, str], Array], name: str) -> Array:
    """Return a metric late in a run, as taken by ``read``, divided by that of the first cycle, (runs,)."""
    return compute_growth(read(results, name), results.at(1, name))


def _list_learnt(when: str, read: Callable[[Results, str], Array]) -> dict[str, Criterion]:
    """Return the conclusions on a machine that learns, by name.

    ``read`` takes a metric of the cycle that ``when`` describes, (runs,).
    """
    over = f"{when}, over that of the first cycle"
    return {
        **{
            f"{side} error": _conclude(
                f"transfer error in {side}, {over}",
                partial(_growth, read=read, name=f"transfer_rmse_{side}"),
                "at most 0.1",
            )
            for side in "xy"
        },
        "CMAC share": _conclude(
            f"share of the CMAC in the torque, {when}", lambda runs: read(runs, "feedforward_share"), "at least 0.5"
        ),
    }


def _in_last(results: Results, name: str) -> Array:
    """Return a metric of the last cycle, (runs,)."""
    return results.end(name, 1)


CONCLUSIONS = {
    LEG: {
        **_list_learnt("cycle 5", lambda runs, name: runs.at(5, name)),
        "force error": _conclude(
            "error of the settled force, cycle 5, %",
            lambda runs: 100 * runs.at(5, "force_steady_state_error"),
            "-5 to 5",
        ),
        "force alone": _conclude(
            "settled force of the first cycle, with feedback only",
            lambda runs: runs.at(1, "force_settled"),
            "0.8 to 1 N",
        ),
    },
    WALK: {
        **_list_learnt("last cycle", _in_last),
        "force error": _conclude(
            "RMS force error with three feet down, last cycle, over that of the first cycle",
            partial(_growth, read=_in_last, name="force_rmse_three_feet"),
            "at most 0.25",
        ),
        "tilt": _conclude(
            "largest tilt, last cycle, over that of the first cycle",
            partial(_growth, read=_in_last, name="tilt_max"),
            "at most 0.25",
        ),
    },
    MASS: {
        "overshoot": _conclude(
            "overshoot of combined over that of stiffness control",
            partial(_over_method, name="force_overshoot", method="stiffness"),
            "at most 1",
        ),
        "settling time": _conclude(
            "settling time of combined over that of damping control",
            partial(_over_method, name="force_settling_time", method="damping"),
            "at most 1",
        ),
    },
}
"""Conclusions of the paper by machine: from section 5, section 6 and section 3."""


def tabulate_numbers(results: Results, machine: str) -> DataFrame:
    """Tabulate the quantity of each conclusion for each variant of a machine, as a mean over seeds.

    A mark shows where the variant reverses the conclusion: ≠ for all seeds, (≠) for some.
    """
    whole = results.select(machine=machine)

    def cell(variant: Results, conclusion: Criterion) -> str:
        changed = differs(conclusion, whole, variant.value("variant"))
        mark = " ≠" if changed.all() else " (≠)" if changed.any() else ""
        return format_number(float(np.mean(conclusion.take(variant)))) + mark

    return tabulate(
        whole,
        {"variant": "value"},
        {
            **{name: partial(cell, conclusion=conclusion) for name, conclusion in CONCLUSIONS[machine].items()},
            "ended early": lambda runs: f"{len(runs) - sum(runs.completed)} of {len(runs)}",
        },
    )


COMMON: Declared = {"quick": {"cycles": 5}, "seeds": True}
NAMES = {LEG: ("One leg", " with which runs complete"), WALK: ("Quadruped", " with which runs complete"),
         MASS: ("Point mass", "")}  # fmt: skip
STUDY = declare(
    title="What the assumed values change",
    question="Which of the paper's conclusions change when one of the values that it does not give is changed?",
    runs=[
        {"set": ["scenario=one_leg", "cycles=20", "record.cycles=[1]"], "over": {"variant": VARIANTS[LEG]},
         "labels": {"machine": LEG}, **COMMON},
        {"set": ["scenario=quadruped", "cycles=20", "record.cycles=[1]"], "over": {"variant": VARIANTS[WALK]},
         "labels": {"machine": WALK}, **COMMON},
        *(
            {"set": ["scenario=force_step"], "labels": {"machine": MASS},
             "over": {"variant": VARIANTS[MASS], "force_control": methods}}
            for methods in (["stiffness", "damping"], ["combined"])
        ),
    ],
    findings={
        "walks": {
            "says": "The quadruped walks to the end with every value tried",
            "quantity": "values tried with which a run ends early", "value": ended_early, "of": {"machine": WALK},
            "limit": "at most 0",
        },
        **{
            f"{machine} {name}": {
                "says": f"{NAMES[machine][0]}: the conclusion on the {name} is the same with every value "
                f"tried{NAMES[machine][1]}",
                "quantity": f"values tried{NAMES[machine][1]} that change",
                "value": partial(count_changes, conclusion=conclusion),
                "of": {"machine": machine},
                "case": f"{conclusion.quantity}: {conclusion.format_limit(conclusion.holds)}",
                "limit": "at most 0",
            }
            for machine, conclusions in CONCLUSIONS.items()
            for name, conclusion in conclusions.items()
        },
    },
    tables={machine: partial(tabulate_numbers, machine=machine) for machine in CONCLUSIONS},
)  # fmt: skip
