"""Alternatives to the CMAC: models, radial basis functions, a perceptron, iterative learning.

``python -m pipelines.feedforwards`` lets each of them learn the same steps of one leg and the same walk, then gives
what it has learnt another ground and another stroke. It takes some minutes, most of them for the perceptron.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.commands.study import main
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study import Claim, Criterion, Finding, Request, Results, Study, at_least, at_most
from cmacexp.study.statements import Limit
from cmacexp.study.study import grid, starting_from
from cmacexp.study.tables import tabulate
from cmacexp.typing import Array
from pipelines import feedforwards_measures as measures
from pipelines.feedforwards_measures import ALONE, CMAC, EXACT, ILC, LEARNERS, MLP, MODELS, RBF, error_at, errors

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LEG, WALK, SMOOTH, RATE = "one leg", "quadruped", "without jumps", "other rates"
CARRIED, ANEW = "carried over", "from nothing"
STEPS = {
    LEG: (("scenario=one_leg",), 100, 6),
    WALK: (("scenario=quadruped",), 40, 5),
    SMOOTH: (("scenario=one_leg", "gait.vertical=two_cubics"), 40, 5),
}
"""Overrides of each group, its cycles, and those of its quick form."""
RATES = (0.5, 1.0)
"""Besides the paper's; the last suits iterative learning control."""
STROKES = {"stroke 150 mm": ("gait.stroke=0.15",), "stroke 250 mm": ("gait.stroke=0.25",)}
CHANGES = {
    **STROKES,
    "ground 1.5 times as stiff, known": ("terrain.stiffness=15",),
    "ground 1.5 times as stiff, unknown": ("terrain.stiffness=15", "terrain.assumed_stiffness=10"),
}
"""What becomes of the default path and ground (10 N/m); planner and models know of the ground, or do not."""
KEPT = (CMAC, RBF, MLP, ILC)
"""Learners whose weights are carried over to another ground or path."""
EARLY, LATE = 5, 20
"""Cycles that are compared."""
AS_GOOD, HALF, LITTLE = 1.25, 0.5, 0.25
"""Largest ratios of errors or cycles that count as as good, as far below, and as little left of an error."""


def _each(kinds: Sequence[str], *overrides: str, **labels: Any) -> list[Request]:
    """A request for each kind, repeated for each seed where a hash or the initial weights depend on it."""
    common = ("reference=aware", "learning.lead=1", "record.cycles=[1]")
    every, seeded = {**MODELS, **LEARNERS}, (CMAC, measures.ANGLES, MLP)
    return [
        request
        for kind in kinds
        for request in grid(*common, *every[kind], *overrides, seeded=kind in seeded, kind=kind, **labels)
    ]


def runs(quick: bool) -> list[Request]:
    """Every kind on one leg, on four and on a smooth path; learners at other rates, and before and after changes."""
    found: list[Request] = []
    weights = "record.weights=true"
    for group, (overrides, cycles, quick_cycles) in STEPS.items():
        more = (*overrides, f"cycles={quick_cycles if quick else cycles}")
        found += _each(tuple(MODELS), *more, group=group)
        found += _each(tuple(LEARNERS), *more, *([weights] if group == LEG else []), group=group)
    after = ("scenario=one_leg", f"cycles={3 if quick else 20}")
    for rate in RATES[:1] if quick else RATES:
        found += _each(tuple(LEARNERS), *after, f"learning.rate={rate}", group=RATE)
    _, cycles, quick_cycles = STEPS[LEG]
    before = _each(KEPT, "scenario=one_leg", f"cycles={quick_cycles if quick else cycles}", weights)
    for change, overrides in CHANGES.items():
        found += _each((*MODELS, *KEPT), *after, *overrides, group=change, start=ANEW)
        carried = _each(KEPT, *after, *overrides, "learning.start_cycle=1", group=change, start=CARRIED)
        found += starting_from(before, carried)
    return found


def cycles_to_tenth(results: Results, kind: str, **settings: str) -> Array:
    """(seeds,): cycles that a kind needs to a tenth of the error of feedback alone."""
    return measures.cycles_to(errors(results.select(settings, kind=kind)), measures.small_error(results))


def _mean(results: Results, kind: str, cycle: int) -> float:
    return float(error_at(results.select(kind=kind), cycle).mean())


def _over(cycles: Array, others: float) -> Array:
    """Cycles over those of others; infinite if there are infinitely many."""
    return np.divide(cycles, others, out=np.full(len(cycles), np.inf), where=np.isfinite(cycles))


def against_fastest(results: Results) -> Array:
    """(seeds,): cycles that CMAC needs over those of the fastest of the others; infinite if it never learns."""
    fastest = min(float(cycles_to_tenth(results, kind).mean()) for kind in (RBF, MLP, ILC))
    return _over(cycles_to_tenth(results, CMAC), fastest)


def training_time(results: Results) -> Array:
    """(seeds,): cycles that the perceptron needs over those of CMAC; 1 if neither ever learns."""
    with np.errstate(invalid="ignore"):
        ratios: Array = cycles_to_tenth(results, MLP) / cycles_to_tenth(results, CMAC).mean()
    ratios[np.isnan(ratios)] = 1.0
    return ratios


def left_at_first(results: Results, kind: str = CMAC) -> Array:
    """(seeds,): error of the first cycle after a change, with what was learnt, over that of feedback alone."""
    carried = error_at(results.select(kind=kind, start=CARRIED), 1)
    return carried / _mean(results, ALONE, 1)


def carried_over(results: Results) -> Array:
    """(seeds,): cycles of learning that CMAC needs after a change with its weights, over those from nothing."""

    def needed(start: str) -> Array:
        first = int(results.select(kind=CMAC, start=start).value("learning.start_cycle"))
        return cycles_to_tenth(results, CMAC, start=start) - (first - 1)

    return _over(needed(CARRIED), float(needed(ANEW).mean()))


def _against_models(results: Results) -> Array:
    """(seeds,): late error of CMAC over that of the best of the models."""
    best = min(_mean(results, kind, LATE) for kind in (EXACT, measures.LIGHT, measures.HEAVY))
    return error_at(results.select(kind=CMAC), LATE) / best


def _without_jumps(results: Results, kind: str) -> Array:
    """(runs,): late error of a kind on a path without jumps of speed, over that with jumps."""
    return error_at(results.select(group=SMOOTH, kind=kind), LATE) / _mean(results.select(group=LEG), kind, LATE)


def _at_best_rate(results: Results) -> Array:
    """(seeds,): early error of CMAC over the least of the other learners, each at the best of the rates tried."""
    best = {
        kind: min(
            (error_at(own, EARLY) for own in results.select(kind=kind).by("learning.rate").values()), key=np.mean
        )
        for kind in KEPT
    }
    return best[CMAC] / min(float(best[kind].mean()) for kind in KEPT if kind != CMAC)


def _slowest_step(results: Results) -> list[float]:
    """Time of a step of the slowest feedforward, the least of its runs, over the sampling period."""
    least = results.computed["cost"].groupby("kind")["seconds_per_step"].min()
    return [float(least.max() / results.value("sampling_period"))]


TENTH = "cycles to a tenth of the error of feedback alone"
LEFT = "learnt with the default stroke, error of {} in the first cycle over that of feedback alone"
PERCENT: dict[str, Any] = {"unit": "%", "scale": 100.0}


def _criterion(
    group: str | list[str], quantity: str, sample: Any, holds: Limit, fails: Limit | None = None, **unit: Any
) -> Criterion:
    where = group if isinstance(group, str) else LEG
    return Criterion(f"{where}: {quantity}", sample, holds, fails, **unit, of={"group": group})


CLAIMS = {
    "rapid": Claim(
        "CMAC is suited to real-time control by its simple design and rapid learning",
        "section 1",
        [
            _criterion(
                group,
                f"{TENTH}, CMAC over the fastest of RBF, MLP, ILC",
                against_fastest,
                at_most(AS_GOOD),
                at_least(2.0),
            )
            for group in (LEG, WALK)
        ],
    ),
    "training": Claim(
        "the drawback of a neural network that is trained to compensate for the model is its long training time",
        "section 1, of its reference 17",
        [_criterion(LEG, f"{TENTH}, MLP over CMAC", training_time, at_least(2.0), at_most(1.0))],
    ),
    "generalises": Claim(
        "CMAC generalises: it generates similar outputs for similar inputs",
        "section 1",
        [
            _criterion(stroke, LEFT.format(CMAC), left_at_first, at_most(LITTLE), at_least(1.0), **PERCENT)
            for stroke in STROKES
        ],
    ),
}
FINDINGS = {
    "models": Finding(
        [
            _criterion(
                group,
                f"error of CMAC in cycle {LATE} over the least of the models, exact or with masses 20 % off",
                _against_models,
                at_most(HALF),
            )
            for group in (LEG, WALK)
        ],
        yes=f"In cycle {LATE} the error of CMAC is far below that of every model tried, on one leg and on four.",
        no=f"In cycle {LATE} the error of CMAC is not far below that of every model tried on both machines.",
    ),
    "jumps": Finding(
        [
            _criterion(
                [LEG, SMOOTH],
                f"error of {kind} in cycle {LATE} without jumps of the planned speed, over that with them",
                partial(_without_jumps, kind=kind),
                at_most(HALF),
            )
            for kind in (EXACT, CMAC)
        ],
        yes="The exact model and CMAC are both far more accurate on a path without jumps: plan such paths first.",
        no="The exact model and CMAC are not both far more accurate on a path without jumps.",
    ),
    "best_rate": Finding(
        [
            _criterion(
                [LEG, RATE],
                f"error in cycle {EARLY}, CMAC over the least of RBF, MLP, ILC, at the best rate of each",
                _at_best_rate,
                at_most(AS_GOOD),
            )
        ],
        yes=f"Each at its best rate, CMAC is in cycle {EARLY} about as accurate as RBF, MLP and ILC, or more.",
        no=f"Each at its best rate, CMAC is in cycle {EARLY} less accurate than one of RBF, MLP and ILC.",
    ),
    "time": Finding(
        [
            _criterion(
                LEG,
                "least time of a step, the largest of all, over the sampling period",
                _slowest_step,
                at_most(0.1),
                **PERCENT,
            )
        ],
        yes="A step of the slowest takes {value} of the sampling period: computing time need not decide the choice.",
        no="A step of the slowest takes {value} of the sampling period: computing time limits the choice.",
    ),
    "keep": Finding(
        [
            _criterion(
                change,
                f"{TENTH}, counted from where learning begins, CMAC with its weights over CMAC from nothing",
                carried_over,
                at_most(0.8),
            )
            for change in CHANGES
        ],
        yes="After each of these changes CMAC needs fewer cycles with its weights than from nothing: keep them.",
        no="After some of these changes CMAC does not need fewer cycles with its weights than from nothing.",
    ),
    "carries_more": Finding(
        [
            _criterion(stroke, LEFT.format(RBF), partial(left_at_first, kind=RBF), at_most(LITTLE), **PERCENT)
            for stroke in STROKES
        ],
        yes="RBF carries most of what it has learnt over to another stroke.",
        no="RBF does not carry most of what it has learnt over to both other strokes.",
    ),
}


def _series(name: str, results: Results) -> Series:
    """The mean over seeds, and their range as a band."""
    found = errors(results)
    found[np.isinf(found)] = np.nan
    band = (found.min(axis=0), found.max(axis=0)) if len(found) > 1 else (None, None)
    return Series(name, np.arange(1, found.shape[1] + 1), found.mean(axis=0), *band)


def _panel(title: str, results: Results, lines: Mapping[str, Mapping[str, str]], log: str, **more: Any) -> Panel:
    series = [_series(name, results.select(settings)) for name, settings in lines.items()]
    return Panel(title, "cycle", "transfer error, mm", series, log=log, **more)


def draw_learning(results: Results) -> "Figure":
    """Transfer error over the cycles, a line for each feedforward."""
    lines = {kind: {"kind": kind} for kind in (*LEARNERS, *MODELS)}
    return draw([_panel("", results, lines, "xy", y_limits=[measures.small_error(results)])], height=4.0)


def draw_changes(results: Results) -> "Figure":
    """Transfer error after each change, with what was learnt before it; for CMAC also from nothing."""
    lines = {
        ALONE: {"kind": ALONE},
        **{f"{kind}, {CARRIED}": {"kind": kind, "start": CARRIED} for kind in KEPT},
        f"{CMAC}, {ANEW}": {"kind": CMAC, "start": ANEW},
    }
    return draw([_panel(change, own, lines, "y") for change, own in results.by("group").items()])


def _early_and_late(results: Results) -> dict[str, Any]:
    """Columns of the error in the plane in the cycles compared, mean over seeds."""
    cycles = [cycle for cycle in (EARLY, LATE) if cycle <= min(results.values("cycles"))]
    return {f"cycle {n}, mm": partial(lambda own, cycle: error_at(own, cycle).mean(), cycle=n) for n in cycles}


def accuracy_table(results: Results, metric: str, title: str, factor: float) -> "pd.DataFrame":
    """Errors of every feedforward, when it has learnt, and a further metric of the last cycle; means over seeds."""
    small = measures.small_error(results)
    columns = {
        "cycles to a tenth": lambda own: measures.cycles_to(errors(own), small).mean(),
        "force RMS at the end, N": lambda own: own.end("force_rmse").mean(),
        title: lambda own: factor * own.end(metric).mean(),
        "ended early": lambda own: f"{len(own) - sum(own.completed)} of {len(own)}",
    }
    return tabulate(results, {"kind": "feedforward"}, _early_and_late(results) | columns)


def rate_table(results: Results) -> "pd.DataFrame":
    """Errors of every learner at every rate."""
    return tabulate(results, {"kind": "feedforward", "learning.rate": "rate"}, _early_and_late(results))


def cost_table(results: Results) -> "pd.DataFrame":
    """Bytes of weights of one leg, and time of a step over that of feedback alone."""
    least = results.computed["cost"].groupby("kind")["seconds_per_step"].min()

    def kilobytes(name: str) -> Callable[[Results], float]:
        return lambda own: np.nan_to_num(own.measure(name)).mean() / 1024  # models have no weights

    columns = {
        "weights, KB": kilobytes("held"),
        "of them used, KB": kilobytes("used"),
        "time of a step": lambda own: least[own.value("kind")] / least[ALONE],
    }
    return tabulate(results, {"kind": "feedforward"}, columns)


def values(results: Results) -> dict[str, Any]:
    """Cycles of each group, what the learners are like, and the time of a step of feedback alone on this machine."""
    took = results.computed["cost"].set_index("kind").loc[ALONE, "seconds_per_step"].min()
    return {
        "cycles": {
            name: results.select(group=group).value("cycles") for name, group in (("leg", LEG), ("walk", WALK))
        },
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
    measures={"held": measures.bytes_held, "used": measures.bytes_used},
    computed={"cost": measures.measure_costs},
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "leg": lambda r: draw_learning(r.select(group=LEG)),
        "walk": lambda r: draw_learning(r.select(group=WALK)),
        "changes": lambda r: draw_changes(r.select(group=list(CHANGES))),
    },
    tables={
        "leg": lambda r: accuracy_table(
            r.select(group=LEG), "force_steady_state_error", "settled force error at the end, %", 100.0
        ),
        "walk": lambda r: accuracy_table(r.select(group=WALK), "tilt_max", "largest tilt at the end, mrad", 1e3),
        "rates": lambda r: rate_table(r.select(group=[LEG, RATE], kind=list(LEARNERS))),
        "cost": lambda r: cost_table(r.select(group=LEG)),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
