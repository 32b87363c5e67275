"""How much each value that Lin & Song 1997 do not give changes the conclusions.

``python -m pipelines.assumptions`` changes one assumed value at a time, of one leg, of the quadruped and of the point
mass, and evaluates every conclusion again.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cmacexp.metrics.text import format_number
from cmacexp.report.style import logarithmic, new_figure
from cmacexp.study import (
    Criterion,
    DataFrame,
    Figure,
    Finding,
    Request,
    Results,
    Study,
    at_least,
    at_most,
    between,
    grid,
)
from cmacexp.study.samples import growth
from cmacexp.study.statements import Limit
from cmacexp.study.tables import tabulate
from cmacexp.typing import Array, Mask

LEG, WALK, MASS = "leg", "walk", "mass"
NAMES = {LEG: "One leg", WALK: "Quadruped", MASS: "Point mass"}
CYCLES, QUICK_CYCLES = 20, 5
CYCLE = 5
"""Cycle in which the paper shows one leg."""
TAKEN = "assumed values"
"""The variant without a change."""


class Assumption(NamedTuple):
    """A value that is taken, and others that could have been."""

    name: str
    keys: Sequence[str]
    """Of the config, all set to the same value."""
    values: Sequence[str]
    """Others than the one taken, as the command line takes them."""
    quick: bool = False
    """Whether the quick form tries its first value."""

    def overrides(self, value: str) -> list[str]:
        """Of the command line."""
        return [f"{key}={value}" for key in self.keys]


def _lead(*omegas: str) -> list[Assumption]:
    """Corner frequencies of the compensator."""
    return [
        Assumption("LEAD omega", ["controller.lead_omega"], omegas, quick=True),
        Assumption("LEAD alpha", ["controller.lead_alpha"], ["5", "20"]),
    ]


VERTICAL = Assumption("vertical path", ["gait.vertical"], ["two_cubics"])


def _cmac(inputs: Sequence[str], ranges: Sequence[str], shifts: Sequence[str], memory: int) -> list[Assumption]:
    """What the paper leaves open of its CMAC; words of half the length give as many rows as twice the memory."""
    return [
        Assumption("CMAC inputs", ["cmac.inputs"], inputs),
        Assumption("CMAC range", ["cmac.range_factor"], ranges, quick=True),
        Assumption("CMAC displacement", ["cmac.displacement"], shifts),
        Assumption("memory of 4-byte words", ["cmac.memory_bytes"], [str(2 * memory)]),
    ]


ONE_LEG = [
    Assumption("knee", ["machine.leg.knee"], ["forward"]),
    Assumption("stroke", ["gait.stroke"], ["0.1", "0.15", "0.25", "0.3"]),
    Assumption("lift", ["gait.lift"], ["0.12", "0.2"], quick=True),
    VERTICAL,
    *_lead("2.5", "10", "20"),
    *_cmac(["[angle]", "[angle,velocity]"], ["2", "3", "10"], ["odd_lattice", "parks_militzer"], 2**20),
]
QUADRUPED = [
    Assumption("front knees", ["machine.legs.left_front.knee", "machine.legs.right_front.knee"], ["back"]),
    Assumption("rear knees", ["machine.legs.left_rear.knee", "machine.legs.right_rear.knee"], ["forward"]),
    Assumption("cycle time", ["gait.cycle_time"], ["2", "4"]),
    Assumption("stroke", ["gait.stroke"], ["0.2", "0.25", "0.35"]),
    Assumption("lift", ["gait.lift"], ["0.05", "0.15"]),
    VERTICAL,
    Assumption("touch-down", ["gait.touch_down"], ["[0.5,0,0.3,0.8]", "[0.1,0.6,0.9,0.4]", "[0,0.5,0.75,0.25]"]),
    Assumption("load ramp", ["gait.load_ramp"], ["0.12"]),
    Assumption("hip height", ["machine.hip_height"], ["0.45", "0.55"]),
    Assumption("weight", ["machine.weight"], ["49.05"], quick=True),
    Assumption("reference", ["reference"], ["literal"]),
    Assumption("learns from cycle", ["learning.start_cycle"], ["3"]),
    *_lead("5", "20"),
    *_cmac(["[angle]", "[angle,velocity,acceleration]"], ["2", "5"], ["odd_lattice"], 2**18),
]
POINT_MASS = [
    Assumption("start clearance", ["machine.start_clearance"], ["0.02", "0.1"], quick=True),
    *_lead("2.5", "10"),
]
MACHINES: dict[str, tuple[str, Sequence[Assumption]]] = {
    LEG: ("one_leg", ONE_LEG),
    WALK: ("quadruped", QUADRUPED),
    MASS: ("force_step", POINT_MASS),
}


def runs(quick: bool) -> list[Request]:
    """Every value of every assumption, and the values taken; of the point mass, with each method."""
    found = []
    for machine, (scenario, assumptions) in MACHINES.items():
        common = [f"scenario={scenario}"]
        if machine != MASS:
            common += [f"cycles={QUICK_CYCLES if quick else CYCLES}", "record.cycles=[1]"]
        variants = {TAKEN: [], **_variants(assumptions, quick)}
        methods = {"force_control": ("stiffness", "damping", "combined")} if machine == MASS else {}
        found += grid(*common, over={"variant": variants, **methods}, seeded=machine != MASS, machine=machine)
    return found


def _variants(assumptions: Sequence[Assumption], quick: bool) -> dict[str, list[str]]:
    """The overrides of each value that is tried, by name."""
    return {
        f"{each.name} {value}": each.overrides(value)
        for each in assumptions
        if each.quick or not quick
        for value in (each.values[:1] if quick else each.values)
    }


@dataclass(frozen=True)
class Conclusion:
    """A number of a run, and the limit within which the paper's conclusion from it holds."""

    quantity: str
    """What is measured, with its unit."""
    sample: Callable[[Results], Array]
    """(runs,): of runs that differ in their seed; one that ended early has the worst value, or NaN."""
    limit: Limit

    def holds(self, results: Results) -> Mask:
        """(runs,): whether it holds; never of NaN."""
        values = self.sample(results)
        return (self.limit.low <= values) & (values <= self.limit.high)


def _tried(results: Results) -> dict[str, Results]:
    """The runs of each value tried."""
    return {name: group for name, group in results.by("variant").items() if name != TAKEN}


def ended_early(results: Results) -> Array:
    """(seeds,): number of values tried with which a run ended early."""
    return np.array([sum(not all(g.completed) for g in _tried(s).values()) for s in results.by("seed").values()])


def completing(results: Results) -> Results:
    """The runs with the values taken, and with those tried with which the runs of all seeds complete."""
    return results.select(variant=[TAKEN, *(name for name, group in _tried(results).items() if all(group.completed))])


def differs(conclusion: Conclusion, results: Results, variant: str) -> Mask:
    """(seeds,): whether a conclusion is another one than with the values taken and the same seed."""
    here, before = (conclusion.holds(results.select(variant=name)) for name in (variant, TAKEN))
    return np.not_equal(here, before)


def count_changes(conclusion: Conclusion, results: Results) -> Array:
    """(seeds,): number of values tried, of those with which runs complete, that change a conclusion."""
    kept = completing(results)
    changed: Array = np.sum([differs(conclusion, kept, name) for name in _tried(kept)], axis=0)
    return changed


def value(name: str, cycle: int | None) -> Callable[[Results], Array]:
    """A metric in ``cycle``, or in the last one."""
    return lambda results: results.at(cycle or results.value("cycles"), name)


def ratio(name: str, cycle: int | None) -> Callable[[Results], Array]:
    """A metric in ``cycle``, or in the last one, over that of the first; infinite if a run ended before."""

    return lambda results: growth(value(name, cycle)(results), results.at(1, name))


def against(name: str, method: str) -> Callable[[Results], Array]:
    """A metric of combined control over that of another method; what is undefined counts as infinite."""

    def sample(results: Results) -> Array:
        ours, theirs = (results.select(force_control=each).at(1, name) for each in ("combined", method))
        return np.nan_to_num(ours, nan=np.inf) / np.nan_to_num(theirs, nan=np.inf)

    return sample


def _conclusions(when: str, cycle: int | None) -> dict[str, Conclusion]:
    """Those of a machine that learns, in ``cycle``, or in the last one."""
    share = value("feedforward_share", cycle)
    return {
        **{
            f"{side} error": Conclusion(
                f"transfer error in {side}, {when}, over that of the first cycle",
                ratio(f"transfer_rmse_{side}", cycle),
                at_most(0.1),
            )
            for side in ("x", "y")
        },
        "CMAC share": Conclusion(f"share of the CMAC in the torque, {when}", share, at_least(0.5)),
    }


def _percent(results: Results) -> Array:
    return 100.0 * results.at(CYCLE, "force_steady_state_error")


CONCLUSIONS: Mapping[str, Mapping[str, Conclusion]] = {
    LEG: {
        **_conclusions(f"cycle {CYCLE}", CYCLE),
        "force error": Conclusion(f"error of the settled force, cycle {CYCLE}, %", _percent, between(-5.0, 5.0)),
        "force alone": Conclusion(
            "settled force of the first cycle, with feedback only, N", value("force_settled", 1), between(0.8, 1.0)
        ),
    },
    WALK: {
        **_conclusions("last cycle", None),
        "force error": Conclusion(
            "RMS force error with three feet down, last cycle, over that of the first cycle",
            ratio("force_rmse_three_feet", None),
            at_most(0.25),
        ),
        "tilt": Conclusion(
            "largest tilt, last cycle, over that of the first cycle", ratio("tilt_max", None), at_most(0.25)
        ),
    },
    MASS: {
        "overshoot": Conclusion(
            "overshoot of combined over that of stiffness control",
            against("force_overshoot", "stiffness"),
            at_most(1.0),
        ),
        "settling time": Conclusion(
            "settling time of combined over that of damping control",
            against("force_settling_time", "damping"),
            at_most(1.0),
        ),
    },
}
"""By machine: of section 5, of section 6, and of section 3."""


def _finding(machine: str, name: str, conclusion: Conclusion) -> Finding:
    where = " with which runs complete" if machine != MASS else ""
    own, limit = f"{NAMES[machine]}: ", conclusion.limit.describe(1.0, "")
    what = f"the conclusion on the {name}"
    case, counted = f"{conclusion.quantity}: {limit}", partial(count_changes, conclusion)
    return Finding(
        [Criterion(f"values tried{where} that change", counted, at_most(0.0), of={"machine": machine}, case=case)],
        says=f"{own}{what} is the same with every value tried{where}",
    )


ENDS_EARLY = "values tried with which a run ends early"
FINDINGS = {
    "walks": Finding(
        [Criterion(ENDS_EARLY, ended_early, at_most(0.0), of={"machine": WALK})],
        says="The quadruped walks to the end with every value tried",
    ),
    **{
        f"{machine} {name}": _finding(machine, name, conclusion)
        for machine, conclusions in CONCLUSIONS.items()
        for name, conclusion in conclusions.items()
    },
}


def number_table(results: Results, conclusions: Mapping[str, Conclusion]) -> DataFrame:
    """Every number, the mean over seeds, marked where it changes a conclusion."""

    def cell(conclusion: Conclusion, own: Results) -> str:
        changed = differs(conclusion, results, own.value("variant"))
        mark = " ≠" if changed.all() else " (≠)" if changed.any() else ""
        return format_number(float(conclusion.sample(own).mean())) + mark

    columns: dict[str, Callable[[Results], str]] = {
        **{name: partial(cell, conclusion) for name, conclusion in conclusions.items()},
        "ended early": lambda own: f"{len(own) - sum(own.completed)} of {len(own)}",
    }
    return tabulate(results, {"variant": "value"}, columns)


def draw_changes(results: Results, conclusions: Mapping[str, Conclusion]) -> Figure:
    """Every number over that with the values taken; a dot where the conclusion changes with every seed."""
    from matplotlib.colors import LogNorm

    names = [*_tried(results)][::-1]  # the first row is the lowest

    def numbers(variant: str) -> list[float]:
        own = results.select(variant=variant)
        return [float(one.sample(own).mean()) for one in conclusions.values()]

    ratios = np.abs(np.array([numbers(name) for name in names]) / numbers(TAKEN))
    ratios[~np.isfinite(ratios) | (ratios <= 0.0)] = np.nan
    changed = [[differs(one, results, name).all() for one in conclusions.values()] for name in names]
    figure, (axes,) = new_figure(height=1.2 + 0.17 * len(names))
    norm = LogNorm(np.nanmin(ratios), np.nanmax(ratios))
    image = axes.imshow(ratios, cmap="cividis", norm=norm, aspect="auto", origin="lower")
    axes.set_xticks(range(len(conclusions)), [*conclusions])
    axes.set_yticks(range(len(names)), names)
    axes.grid(visible=False)
    rows, columns = np.nonzero(changed)
    axes.plot(columns, rows, "o", color="#FFFFFF", markeredgecolor="#000000", ms=5)
    bar = figure.colorbar(image, ax=axes, label="over that with the assumed values")
    logarithmic(bar.ax, "y", ratios[np.isfinite(ratios)])
    return figure


def values(results: Results) -> dict[str, Any]:
    """Number of values tried, by machine, and of cycles."""
    tried = {machine: {"tried": len(_tried(own))} for machine, own in results.by("machine").items()}
    return {**tried, "cycles": results.select(machine=LEG).value("cycles")}


def _of(machine: str, work: Callable[[Results, Mapping[str, Conclusion]], Any]) -> Callable[[Results], Any]:
    return lambda results: work(results.select(machine=machine), CONCLUSIONS[machine])


STUDY = Study(
    title="What the assumed values change",
    question="Which of the paper's conclusions change when one of the values that it does not give is changed?",
    runs=runs,
    findings=FINDINGS,
    figures={machine: _of(machine, draw_changes) for machine in (LEG, WALK)},
    tables={machine: _of(machine, number_table) for machine in MACHINES},
    values=values,
)
