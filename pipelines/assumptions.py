"""How much each value that Lin & Song 1997 do not give changes the conclusions.

``python -m pipelines.assumptions`` changes one assumed value at a time, of one leg, of the quadruped and of the point
mass, and evaluates every conclusion again.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from cmacexp.cli.study import main
from cmacexp.study import Criterion, Finding, Request, Results, Study, at_least, at_most, between, grid
from cmacexp.typing import Array
from pipelines.assumptions_list import ONE_LEG, POINT_MASS, QUADRUPED, Assumption
from pipelines.assumptions_measures import (
    TAKEN,
    Conclusion,
    conclusion_table,
    count_changes,
    draw_changes,
    ended_early,
    number_table,
)

LEG, WALK, MASS = "leg", "walk", "mass"
CYCLES, QUICK_CYCLES = 20, 5
CYCLE = 5
"""Cycle in which the paper shows one leg."""
MACHINES: dict[str, tuple[str, Sequence[Assumption]]] = {
    LEG: ("one_leg", ONE_LEG),
    WALK: ("quadruped", QUADRUPED),
    MASS: ("force_step", POINT_MASS),
}
METHODS = ("stiffness", "damping", "combined")
ELIMINATED, SMALL = 0.1, 0.25
"""Errors over those of the first cycle up to which they are virtually eliminated, and small."""


def runs(quick: bool) -> list[Request]:
    """Every value of every assumption, and the values taken; of the point mass, with each method."""
    found = []
    for machine, (scenario, assumptions) in MACHINES.items():
        common = [f"scenario={scenario}"]
        if machine != MASS:
            common += [f"cycles={QUICK_CYCLES if quick else CYCLES}", "record.cycles=[1]"]
        variants = {TAKEN: [], **_variants(assumptions, quick)}
        methods = {"force_control": METHODS} if machine == MASS else {}
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


def value(name: str, cycle: int | None) -> Callable[[Results], Array]:
    """A metric in ``cycle``, or in the last one."""
    return lambda results: results.at(cycle or results.value("cycles"), name)


def ratio(name: str, cycle: int | None) -> Callable[[Results], Array]:
    """A metric in ``cycle``, or in the last one, over that of the first; infinite if a run ended before."""

    def sample(results: Results) -> Array:
        late = value(name, cycle)(results)
        return late / np.where(np.isinf(late), 1.0, results.at(1, name))

    return sample


def against(name: str, method: str) -> Callable[[Results], Array]:
    """A metric of combined control over that of another method; what is undefined counts as infinite."""

    def sample(results: Results) -> Array:
        ours, theirs = (results.select(force_control=each).at(1, name) for each in ("combined", method))
        return np.nan_to_num(ours, nan=np.inf) / np.nan_to_num(theirs, nan=np.inf)

    return sample


def _errors(cycle: int | None) -> list[Conclusion]:
    when = f"cycle {cycle}" if cycle else "last cycle"
    return [
        Conclusion(
            f"{side} error",
            f"transfer error in {side}, {when}, over that of the first cycle",
            ratio(f"transfer_rmse_{side}", cycle),
            at_most(ELIMINATED),
        )
        for side in ("x", "y")
    ]


def _share(cycle: int | None) -> Conclusion:
    when = f"cycle {cycle}" if cycle else "last cycle"
    return Conclusion(
        "CMAC share", f"share of the CMAC in the torque, {when}", value("feedforward_share", cycle), at_least(0.5)
    )


def _percent(results: Results) -> Array:
    return 100.0 * results.at(CYCLE, "force_steady_state_error")


CONCLUSIONS: Mapping[str, Sequence[Conclusion]] = {
    LEG: [
        *_errors(CYCLE),
        Conclusion("force error", f"error of the settled force, cycle {CYCLE}, %", _percent, between(-5.0, 5.0)),
        _share(CYCLE),
        Conclusion(
            "force alone",
            "settled force of the first cycle, with feedback alone, N",
            value("force_settled", 1),
            between(0.8, 1.0),
        ),
    ],
    WALK: [
        *_errors(None),
        Conclusion(
            "force error",
            "RMS force error with three feet down, last cycle, over that of the first cycle",
            ratio("force_rmse_three_feet", None),
            at_most(SMALL),
        ),
        Conclusion(
            "tilt", "largest tilt, last cycle, over that of the first cycle", ratio("tilt_max", None), at_most(SMALL)
        ),
        _share(None),
    ],
    MASS: [
        Conclusion(
            "overshoot",
            "overshoot of combined over that of stiffness control",
            against("force_overshoot", "stiffness"),
            at_most(1.0),
        ),
        Conclusion(
            "settling time",
            "settling time of combined over that of damping control",
            against("force_settling_time", "damping"),
            at_most(1.0),
        ),
    ],
}
"""By machine: of section 5, of section 6, and of section 3."""


def _finding(machine: str, conclusion: Conclusion) -> Finding:
    where = " with which runs complete" if machine != MASS else ""
    mean = " (mean over seeds)" if machine != MASS else ""
    what = f"The conclusion on the {conclusion.name}"
    criterion = Criterion(
        f"number of values tried{where} that change whether the {conclusion.quantity} is "
        f"{conclusion.limit.describe(1.0, '')}",
        partial(count_changes, conclusion),
        at_most(0.0),
        of={"machine": machine},
    )
    return Finding(
        [criterion],
        yes=f"{what} is the same with every value tried{where}.",
        no=f"{what} depends on what is assumed: {{value}} of the values tried{where} change it{mean}.",
        unclear=f"{what} changes with some values tried{where}, but not with every seed.",
    )


WALKS = Finding(
    [
        Criterion(
            "number of values tried with which a run ends early", ended_early, at_most(0.0), of={"machine": WALK}
        )
    ],
    yes="The quadruped walks to the end with every value tried.",
    no="The quadruped does not walk to the end with every value tried: with {value} of them its runs end early.",
    unclear="With some values tried the quadruped's runs end early, but not with every seed.",
)
FINDINGS = {
    "walks": WALKS,
    **{
        f"{machine} {conclusion.name}": _finding(machine, conclusion)
        for machine, conclusions in CONCLUSIONS.items()
        for conclusion in conclusions
    },
}


def _of(machine: str, work: Callable[[Results, Sequence[Conclusion]], Any]) -> Callable[[Results], Any]:
    return lambda results: work(results.select(machine=machine), CONCLUSIONS[machine])


def values(results: Results) -> dict[str, Any]:
    """How many assumptions and values are tried, by machine."""
    counts = {
        machine: {
            "assumptions": len(assumptions),
            "tried": len(results.select(machine=machine).values("variant")) - 1,
        }
        for machine, (_, assumptions) in MACHINES.items()
    }
    return {**counts, "cycles": results.select(machine=LEG).value("cycles")}


STUDY = Study(
    title="What the assumed values change",
    question="Which of the paper's conclusions change when one of the values that it does not give is changed?",
    runs=runs,
    findings=FINDINGS,
    figures={machine: _of(machine, draw_changes) for machine in (LEG, WALK)},
    tables={
        f"{machine} {name}": _of(machine, work)
        for machine in MACHINES
        for name, work in (("conclusions", conclusion_table), ("numbers", number_table))
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
