"""Alternatives to the CMAC: models, radial basis functions, a perceptron, iterative learning.

``python -m pipelines.feedforwards`` lets each of them learn the same steps of one leg and the same walk, then gives
what it has learnt another ground and another stroke. It takes some minutes, most of them for the perceptron.
"""

from collections.abc import Callable, Sequence
from typing import Any

from cmacexp.cli.study import main
from cmacexp.study import Request, Results, Study, grid, starting_from
from pipelines import feedforwards_figures as figures
from pipelines.feedforwards_cost import measure_costs
from pipelines.feedforwards_figures import ANEW, CARRIED
from pipelines.feedforwards_kinds import (
    ALONE,
    ILC,
    KEPT,
    LEARNERS,
    MODELS,
    RBF,
    SEEDED,
    bytes_held,
    bytes_used,
)
from pipelines.feedforwards_samples import CHANGES, EARLY, LATE, LEG, RATE, RATES, SMOOTH, WALK
from pipelines.feedforwards_statements import CLAIMS, FINDINGS

COMMON = ("reference=aware", "learning.lead=1", "record.cycles=[1]")
STEPS = {
    LEG: (("scenario=one_leg",), 100, 6),
    WALK: (("scenario=quadruped",), 40, 5),
    SMOOTH: (("scenario=one_leg", "gait.vertical=two_cubics"), 40, 5),
}
"""Overrides of each group, its cycles, and those of its quick form."""
AFTER, QUICK_AFTER = 20, 5
"""Cycles after a change, and at other rates."""


def _each(kinds: Sequence[str], *overrides: str, **labels: Any) -> list[Request]:
    """A request for each kind, repeated for each seed if it depends on it."""
    every = {**MODELS, **LEARNERS}
    return [
        request
        for kind in kinds
        for request in grid(*COMMON, *every[kind], *overrides, seeded=kind in SEEDED, kind=kind, **labels)
    ]


def runs(quick: bool) -> list[Request]:
    """Every kind on one leg, on four and on a smooth path; learners at other rates, and before and after changes."""
    found: list[Request] = []
    weights = "record.weights=true"
    for group, (overrides, cycles, quick_cycles) in STEPS.items():
        more = (*overrides, f"cycles={quick_cycles if quick else cycles}")
        found += _each(tuple(MODELS), *more, group=group)
        found += _each(tuple(LEARNERS), *more, *([weights] if group == LEG else []), group=group)
    after = ("scenario=one_leg", f"cycles={QUICK_AFTER if quick else AFTER}")
    for rate in RATES[:1] if quick else RATES:
        found += _each(tuple(LEARNERS), *after, f"learning.rate={rate}", group=RATE)
    _, cycles, quick_cycles = STEPS[LEG]
    before = _each(KEPT, "scenario=one_leg", f"cycles={quick_cycles if quick else cycles}", weights)
    for change, overrides in CHANGES.items():
        found += _each((*MODELS, *KEPT), *after, *overrides, group=change, start=ANEW)
        carried = _each(KEPT, *after, *overrides, "learning.start_cycle=1", group=change, start=CARRIED)
        found += starting_from(before, carried)
    return found


def _shown(results: Results) -> list[int]:
    return [cycle for cycle in (EARLY, LATE) if cycle <= results.value("cycles")]


def _of(groups: str | Sequence[str], work: Callable[[Results], Any]) -> Callable[[Results], Any]:
    return lambda results: work(results.select(group=groups))


def _accuracy(group: str, *extra: Any) -> Callable[[Results], Any]:
    return _of(group, lambda own: figures.accuracy_table(own, _shown(own), extra))


def _plane(*groups: str) -> Callable[[Results], Any]:
    shortest = groups[-1]
    return lambda results: figures.plane_table(
        results.select(group=groups, **({"kind": list(LEARNERS)} if RATE in groups else {})),
        _shown(results.select(group=shortest)),
    )


def values(results: Results) -> dict[str, Any]:
    """Cycles of each group, what the learners are like, and the time of a step of feedback alone on this machine."""
    cycles = {name: results.select(group=group).value("cycles") for name, group in (("leg", LEG), ("walk", WALK))}
    took = results.computed["cost"].set_index("kind").loc[ALONE, "seconds_per_step"].min()
    return {
        "cycles": cycles,
        "after": results.select(group=list(CHANGES)).value("cycles"),
        "centres": results.select(kind=RBF).value("feedforward.centres"),
        "cutoff": results.select(kind=ILC).value("feedforward.cutoff"),
        "rate": results.select(group=LEG).value("learning.rate"),
        "step": 1e6 * float(took),
    }


STUDY = Study(
    title="Alternatives to the CMAC",
    question="How do models, CMAC, radial basis functions, a perceptron and iterative learning control compare in "
    "accuracy, speed of learning, memory and time, and how much of what they learn is of use after a change?",
    runs=runs,
    measures={"held": bytes_held, "used": bytes_used},
    computed={"cost": measure_costs},
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "leg": _of(LEG, figures.draw_learning),
        "walk": _of(WALK, figures.draw_learning),
        "changes": _of(list(CHANGES), figures.draw_changes),
    },
    tables={
        "leg": _accuracy(LEG, "force_steady_state_error", "settled force error, %", 100.0),
        "walk": _accuracy(WALK, "tilt_max", "largest tilt, mrad", 1e3),
        "smooth": _plane(SMOOTH),
        "rates": _plane(LEG, RATE),
        "cost": _of(LEG, figures.cost_table),
        "changes": _of(list(CHANGES), figures.change_table),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
