"""Alternatives to the CMAC: models, radial basis functions, a perceptron, iterative learning.

``python -m pipelines.feedforwards`` lets each of them learn the same steps of one leg and the same walk in the
paper's own perfect world, where its claims are judged, and in randomised runs, called worlds
(``feedforwards_worlds.py``). It takes some minutes, most of them for the perceptron.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study import Claim, Criterion, DataFrame, Figure, Finding, Request, Results, Study, at_least, at_most
from cmacexp.study.samples import quotients
from cmacexp.study.statements import Limit
from cmacexp.study.study import grid, starting_from
from cmacexp.study.tables import tabulate
from cmacexp.typing import Array
from pipelines import feedforwards_measures as measures
from pipelines import feedforwards_worlds as in_worlds
from pipelines.feedforwards_measures import ALONE, CMAC, ILC, LEARNERS, MLP, MODELS, RBF, error_at, errors
from pipelines.worlds import TESTED, TUNED

LEG, WALK = "one leg", "quadruped"
STEPS = {
    LEG: (("scenario=one_leg",), 100, 6),
    WALK: (("scenario=quadruped",), 40, 5),
}
"""Overrides of each group, its cycles, and those of its quick form."""
STROKES = {"another stroke: 150 mm": "gait.stroke=0.15", "another stroke: 250 mm": "gait.stroke=0.25"}
AS_GOOD, LITTLE = 1.25, 0.25
"""Largest ratios that count as as good, of cycles, and as little left, of an error."""


def _each(kinds: Sequence[str], *overrides: str, **labels: Any) -> list[Request]:
    """A request for each kind, repeated for each seed where a hash or the initial weights depend on it."""
    common = ("reference=literal", "learning.lead=0", "record.cycles=[1]")  # as printed, since claims are judged
    every, seeded = {**MODELS, **LEARNERS}, (CMAC, measures.ANGLES, MLP)
    return [
        request
        for kind in kinds
        for request in grid(*common, *every[kind], *overrides, seeded=kind in seeded, kind=kind, **labels)
    ]


def runs(quick: bool) -> list[Request]:
    """Every kind on one leg and on four in the paper's world, CMAC after another stroke; and all runs in worlds."""
    found: list[Request] = []
    weights = "record.weights=true"
    for group, (overrides, cycles, quick_cycles) in STEPS.items():
        more = (*overrides, f"cycles={quick_cycles if quick else cycles}")
        found += _each(tuple(MODELS), *more, group=group)
        found += _each(tuple(LEARNERS), *more, *([weights] if group == LEG else []), group=group)
    _, cycles, quick_cycles = STEPS[LEG]
    before = _each((CMAC,), "scenario=one_leg", f"cycles={quick_cycles if quick else cycles}", weights)
    for stroke, override in STROKES.items():
        after = ("scenario=one_leg", "cycles=3", override)
        found += _each((ALONE,), *after, group=stroke)
        found += starting_from(before, _each((CMAC,), *after, "learning.start_cycle=1", group=stroke))
    return [*found, *in_worlds.runs(quick)]


def cycles_to_tenth(results: Results, kind: str, **settings: str) -> Array:
    """(seeds,): cycles that a kind needs to a tenth of the error of feedback only."""
    return measures.cycles_to(errors(results.select(settings, kind=kind)), measures.small_error(results))


def _mean(results: Results, kind: str, cycle: int) -> float:
    return float(error_at(results.select(kind=kind), cycle).mean())


def against_fastest(results: Results) -> Array:
    """(seeds,): cycles that CMAC needs over those of the fastest of the others; infinite if it never learns."""
    fastest = min(float(cycles_to_tenth(results, kind).mean()) for kind in (RBF, MLP, ILC))
    return quotients(cycles_to_tenth(results, CMAC), fastest)


def training_time(results: Results) -> Array:
    """(seeds,): cycles that the perceptron needs over those of CMAC; infinite if it alone never learns."""
    return quotients(cycles_to_tenth(results, MLP), cycles_to_tenth(results, CMAC).mean())


def left_at_first(results: Results) -> Array:
    """(seeds,): error of CMAC in the first cycle after a change, with its weights, over that with feedback only."""
    return quotients(error_at(results.select(kind=CMAC), 1), _mean(results, ALONE, 1))


def _slowest_step(results: Results) -> Array:
    """(rounds,): time of a step of the slowest feedforward over the sampling period."""
    seconds = results.computed["cost"].groupby("kind")["seconds_per_step"]
    slowest: Array = seconds.get_group(seconds.median().idxmax()).to_numpy()
    return slowest / float(results.value("sampling_period"))


TENTH = "cycles to a tenth of the error of feedback only"
LEFT = "error of {} in its first cycle with a new stroke, over that with feedback only"
PERCENT: dict[str, Any] = {"unit": "%", "scale": 100.0}


def _criterion(
    group: str | list[str], quantity: str, sample: Any, holds: Limit, fails: Limit | None = None, **unit: Any
) -> Criterion:
    return Criterion(
        quantity,
        sample,
        holds,
        fails,
        **unit,
        of={"group": group},
        case=group.removeprefix("another ") if isinstance(group, str) else LEG,
    )


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
    **in_worlds.FINDINGS,
    "time": Finding(
        [
            _criterion(
                LEG,
                "time of a step of the slowest over the sampling period",
                _slowest_step,
                at_most(0.1),
                **PERCENT,
            )
        ],
        says="Computing time need not decide the choice",
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


def draw_learning(results: Results) -> Figure:
    """Transfer error over the cycles, a line for each feedforward."""
    lines = {kind: {"kind": kind} for kind in (*LEARNERS, *MODELS)}
    return draw([_panel("", results, lines, "xy", y_limits=[measures.small_error(results)])], height=4.0)


def _early_and_late(results: Results) -> dict[str, Any]:
    """Columns of the error in the plane in the cycles compared, mean over seeds."""
    cycles = [cycle for cycle in (in_worlds.EARLY, in_worlds.LATE) if cycle <= min(results.values("cycles"))]
    return {f"cycle {n}, mm": partial(lambda own, cycle: error_at(own, cycle).mean(), cycle=n) for n in cycles}


def accuracy_table(results: Results, metric: str, title: str, factor: float) -> DataFrame:
    """Errors of every feedforward, when it has learnt, and a further metric of the last cycle; means over seeds."""
    small = measures.small_error(results)
    columns = {
        "cycles to a tenth": lambda own: measures.cycles_to(errors(own), small).mean(),
        "force RMS at the end, N": lambda own: own.end("force_rmse").mean(),
        title: lambda own: factor * own.end(metric).mean(),
        "ended early": lambda own: f"{len(own) - sum(own.completed)} of {len(own)}",
    }
    return tabulate(results, {"kind": "feedforward"}, _early_and_late(results) | columns)


def cost_table(results: Results) -> DataFrame:
    """Bytes of weights of one leg, and time of a step over that with feedback only."""
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
    """Cycles of each group, what the learners are like, and the time of a step of feedback only on this machine."""
    took = results.computed["cost"].set_index("kind").loc[ALONE, "seconds_per_step"].min()
    return {
        "cycles": {
            name: results.select(group=group).value("cycles") for name, group in (("leg", LEG), ("walk", WALK))
        },
        "centres": results.select(kind=RBF).value("feedforward.centres"),
        "cutoff": results.select(kind=ILC).value("feedforward.cutoff"),
        "rate": results.select(group=LEG).value("learning.rate"),
        "step": 1e6 * float(took),
        "worlds": len(TESTED),
        "tuned": len(TUNED),
        "late": in_worlds.LATE,
        "stiffer": in_worlds.STIFFER,
    }


STUDY = Study(
    title="Alternatives to the CMAC",
    question="How do models, CMAC, radial basis functions, a perceptron and iterative learning control compare in "
    "accuracy, speed of learning, memory and time, and how much of what they learn is of use after a change?",
    runs=runs,
    measures={
        "held": measures.bytes_held,
        "used": measures.bytes_used,
        "ended_by_guard": in_worlds.ended_by_guard,
    },
    computed={"cost": measures.measure_costs},
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "leg": lambda r: draw_learning(r.select(group=LEG)),
        "walk": lambda r: draw_learning(r.select(group=WALK)),
        **in_worlds.FIGURES,
    },
    tables={
        "leg": lambda r: accuracy_table(
            r.select(group=LEG), "force_steady_state_error", "settled force error at the end, %", 100.0
        ),
        "walk": lambda r: accuracy_table(r.select(group=WALK), "tilt_max", "largest tilt at the end, mrad", 1e3),
        "cost": lambda r: cost_table(r.select(group=LEG)),
        **in_worlds.TABLES,
    },
    values=values,
)
