"""Feedforwards in randomised runs (worlds): what to choose, what carries over, what the guard ends."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cmacexp.data.run import Run
from cmacexp.metrics.final import TRANSFER
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study import Criterion, DataFrame, Figure, Finding, Request, Results, at_least, at_most
from cmacexp.study.samples import relative
from cmacexp.study.statements import Limit
from cmacexp.study.study import starting_from
from cmacexp.study.tables import tabulate
from cmacexp.typing import Array
from pipelines.common_results import percent
from pipelines.feedforwards_measures import ALONE, CMAC, ILC, LEARNERS, MLP, MODELS, RBF, error_at, errors
from pipelines.worlds import TESTED, TUNED, in_worlds

MODEL, ON_MODEL = "model", "CMAC on model"
KINDS = {
    ALONE: MODELS[ALONE],
    MODEL: ("feedforward=inverse_dynamics",),
    CMAC: LEARNERS[CMAC],
    ON_MODEL: ("feedforward=cmac_on_model",),
    **{kind: LEARNERS[kind] for kind in (RBF, MLP, ILC)},
}
"""What is compared in worlds; the model has the masses of the plan, not the true ones."""
LEARN = (CMAC, ON_MODEL, RBF, MLP, ILC)
OTHERS = (RBF, MLP, ILC)
LEG, WALK, SMOOTH = "worlds, one leg", "worlds, quadruped", "worlds, without jumps"
RATE, GUARDED = "worlds, rates", "worlds, guarded"
MACHINES = {
    LEG: ("one_leg", ("reference=aware", "learning=lasting")),
    WALK: ("quadruped_lasting", ()),
}
"""Scenario and further overrides of each group."""
RATES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
STROKES = {"stroke 150 mm": (("gait.stroke=0.15",), 1.0), "stroke 250 mm": (("gait.stroke=0.25",), 1.0)}
STIFFER = 1.5
CHANGES = {
    **STROKES,
    "ground stiffer, known": ((f"terrain.assumed_stiffness={10 * STIFFER:g}",), STIFFER),
    "ground stiffer, unknown": ((), STIFFER),
}
"""What becomes of path and ground after the first runs: overrides, and how many times as stiff the ground is."""
KEPT = (CMAC, ON_MODEL, RBF)
"""Learners whose weights are carried over."""
CARRIED, ANEW = "carried over", "from nothing"
EARLY, LATE, QUICK_CYCLES = 5, 20, 5
AS_GOOD, CLEARLY, HALF, LITTLE = 1.25, 0.8, 0.5, 0.25
"""Largest ratios of errors that count as as good, clearly smaller, far below, and little left of an error."""
LET = 0.75
"""Share of the worlds, at the lower end of its interval, in which the guard lets learning be."""


def runs(quick: bool) -> list[Request]:
    """Every kind on one leg and on four; models and CMAC without jumps; other rates; guarded; and after changes."""
    tested, tuned = (TESTED[:1], TUNED[:1]) if quick else (TESTED, TUNED)

    def part(
        group: str, kinds: Sequence[str], *overrides: str, machine: str = LEG, guard: str = "none", **more: Any
    ) -> list[Request]:
        scenario, common = MACHINES[machine]
        cycles = f"cycles={QUICK_CYCLES if quick else LATE}"
        words = (*common, f"learning.guard={guard}", cycles, "record.cycles=[1]", *overrides)
        over = {"kind": {kind: KINDS[kind] for kind in kinds}, **more.pop("over", {})}
        return in_worlds(scenario, more.pop("numbers", tested), *words, over=over, group=group, **more)

    weights, first = "record.weights=true", "learning.start_cycle=1"
    before = part(LEG, KEPT, weights)
    found = [
        *before,
        *part(LEG, [kind for kind in KINDS if kind not in KEPT]),
        *part(WALK, tuple(KINDS), machine=WALK),
        *part(SMOOTH, (MODEL, CMAC), "gait.vertical=two_cubics"),
        *part(RATE, LEARN, numbers=[*tested, *tuned], over={"learning.rate": RATES[1:3] if quick else RATES}),
        *part(GUARDED, LEARN, guard="freeze"),
    ]
    before = [replace(each, labels={key: each.labels[key] for key in ("kind", "world")}) for each in before]
    for change, (overrides, stiffer) in CHANGES.items():
        more: dict[str, Any] = {"stiffer": stiffer}
        found += part(change, (ALONE,), *overrides, start=ANEW, **more)
        found += part(change, KEPT, *overrides, first, start=ANEW, **more)
        found += starting_from(before, part(change, KEPT, *overrides, first, start=CARRIED, **more))
    return found


def ended_by_guard(run: Run) -> float:
    """Whether the guard ended learning: 1 or 0."""
    return float(bool(run.manifest["guard"]))


def at_best_rate(results: Results, cycle: int) -> Array:
    """(worlds,): error of CMAC in a cycle over the least of the others, each at the rate best in other worlds."""

    def tested(kind: str) -> Results:
        own = results.select(kind=kind)
        rates = own.select(world=list(TUNED)).by("learning.rate")
        best = min(rates, key=lambda rate: float(error_at(rates[rate], cycle).mean()))
        return own.select({"learning.rate": best}, world=list(TESTED))

    error = partial(error_at, cycle=cycle)
    return np.max([relative(tested(CMAC), tested(kind), error) for kind in OTHERS], axis=0)


def _criterion(
    group: Any, quantity: str, sample: Any, holds: Limit, case: str = "", of: Any = None, **more: Any
) -> Criterion:
    return Criterion(quantity, sample, holds, None, of={"group": group, **(of or {})}, case=case, **more)


def _over(group: str, own: str, other: str, cycle: int, most: float) -> Criterion:
    quantity = f"error in cycle {cycle}: {own} over {other}"
    return _criterion(
        group, quantity, f"{TRANSFER}[{cycle}]", at_most(most), NAMES[group], {"kind": own}, over={"kind": other}
    )


PERCENT: dict[str, Any] = {"unit": "%", "scale": 100.0}
KEPT_WEIGHTS = {"kind": CMAC, "start": CARRIED}
NAMES = {LEG: "one leg", WALK: "quadruped"}
WORLDS = "In randomised runs,"
FINDINGS = {
    "models": Finding(
        [_over(group, CMAC, MODEL, LATE, HALF) for group in MACHINES],
        says=f"{WORLDS} the error of CMAC in cycle {LATE} is far below that of inverse dynamics with "
        "the planned masses",
    ),
    "on_model": Finding(
        [_over(group, ON_MODEL, CMAC, EARLY, CLEARLY) for group in MACHINES]
        + [_over(group, ON_MODEL, CMAC, LATE, AS_GOOD) for group in MACHINES],
        says=f"{WORLDS} a CMAC on a model with the planned masses starts better than a CMAC without a "
        "model and ends as well",
    ),
    **{
        f"learners_{name}": Finding(
            [_over(group, CMAC, other, LATE, 1.0) for other in OTHERS],
            says=f"{WORLDS} at rate `auto` and unguarded, CMAC ({name}) is more accurate in cycle {LATE} "
            "than RBF, MLP and ILC",
        )
        for group, name in NAMES.items()
    },
    "jumps": Finding(
        [
            _criterion(
                SMOOTH,
                f"error in cycle {LATE} without jumps of the planned speed, over that with them",
                f"{TRANSFER}[{LATE}]",
                at_most(HALF),
                kind,
                {"kind": kind},
                over={"group": LEG},
            )
            for kind in (MODEL, CMAC)
        ],
        says=f"{WORLDS} inverse dynamics with the planned masses and CMAC are both far more accurate "
        "on a path without jumps: plan such paths first",
    ),
    **{
        name: Finding(
            [
                _criterion(
                    RATE,
                    f"error in cycle {cycle}: CMAC over the least of RBF, MLP, ILC, each at the rate that is best in "
                    "other worlds",
                    partial(at_best_rate, cycle=cycle),
                    at_most(AS_GOOD),
                )
            ],
            says=f"{WORLDS} with each learner at the rate that is best in other worlds, CMAC is about as "
            f"accurate in cycle {cycle} as the best of RBF, MLP and ILC, or more accurate",
        )
        for name, cycle in (("best_rate", EARLY), ("best_rate_late", LATE))
    },
    "guard": Finding(
        [
            percent(
                "worlds in which the guard lets learning go on",
                "ended_by_guard <= 0",
                at_least(LET),
                case=kind,
                group=GUARDED,
                kind=kind,
            )
            for kind in LEARN
        ],
        says=f"{WORLDS} the guard lets each of these learners learn at rate `auto`",
    ),
    "keep": Finding(
        [
            _criterion(
                change,
                f"mean error of the first {EARLY} cycles: CMAC with its weights over CMAC from nothing",
                " + ".join(f"{TRANSFER}[{cycle}]" for cycle in range(1, EARLY + 1)),
                at_most(1.0),
                change,
                KEPT_WEIGHTS,
                over={"start": ANEW},
            )
            for change in CHANGES
        ],
        says=f"{WORLDS} a CMAC that keeps its weights after a change of stroke or ground has a smaller "
        f"error over the first {EARLY} cycles than one that starts from nothing: keep them",
    ),
    "keep_late": Finding(
        [
            _criterion(
                change,
                f"error in cycle {LATE}: CMAC with its weights over CMAC from nothing",
                f"{TRANSFER}[{LATE}]",
                at_most(AS_GOOD),
                change,
                KEPT_WEIGHTS,
                over={"start": ANEW},
            )
            for change in CHANGES
        ],
        says=f"Kept weights do no harm later: in cycle {LATE} CMAC is about as accurate as from "
        "nothing, or more accurate",
    ),
    "carries_most": Finding(
        [
            _criterion(
                stroke,
                f"error of {RBF} in its first cycle with a new stroke, over that with feedback only",
                f"{TRANSFER}[1]",
                at_most(LITTLE),
                stroke,
                {"kind": RBF, "start": CARRIED},
                over={"kind": ALONE, "start": ANEW},
                **PERCENT,
            )
            for stroke in STROKES
        ],
        says=f"{WORLDS} RBF carries most of what it has learnt over to another stroke",
    ),
    "carries_more": Finding(
        [
            _criterion(
                stroke,
                f"error of {RBF} in its first cycle with a new stroke, over that of {CMAC}",
                f"{TRANSFER}[1]",
                at_most(CLEARLY),
                stroke,
                {"kind": RBF, "start": CARRIED},
                over={"kind": CMAC},
            )
            for stroke in STROKES
        ],
        says=f"{WORLDS} RBF carries more over to another stroke than CMAC",
    ),
}


def table_kinds(results: Results) -> DataFrame:
    """Errors of every kind, and of learners at every rate; estimates over the worlds, and runs that ended early."""
    cycles = [cycle for cycle in (EARLY, LATE) if cycle <= min(results.values("cycles"))]
    columns: dict[str, Any] = {
        f"cycle {n}, mm": partial(lambda own, cycle: error_at(own, cycle), cycle=n) for n in cycles
    }
    columns["ended early"] = lambda own: f"{len(own) - sum(own.completed)} of {len(own)}"
    if len(results.values("learning.guard")) == 1 and results.value("learning.guard") != "none":
        columns["ended by the guard"] = lambda own: f"{own.measure('ended_by_guard').sum():.0f} of {len(own)}"
    rates = {"learning.rate": "rate"} if len(results.values("learning.rate")) > 1 else {}
    return tabulate(results, {"kind": "feedforward", **rates}, columns)


def _series(name: str, results: Results) -> Series:
    """The median over worlds, and their range as a band."""
    found = errors(results)
    found[np.isinf(found)] = np.nan
    band = (found.min(axis=0), found.max(axis=0))
    return Series(name, np.arange(1, found.shape[1] + 1), np.median(found, axis=0), *band)


def draw_changes(results: Results) -> Figure:
    """Transfer error after each change, with what was learnt before it; for CMAC also from nothing."""
    lines = {
        ALONE: {"kind": ALONE},
        **{f"{kind}, {CARRIED}": {"kind": kind, "start": CARRIED} for kind in KEPT},
        f"{CMAC}, {ANEW}": {"kind": CMAC, "start": ANEW},
    }
    return draw(
        [
            Panel(
                change,
                "cycle",
                "transfer error, mm",
                [_series(name, own.select(chosen)) for name, chosen in lines.items()],
                log="y",
            )
            for change, own in results.by("group").items()
        ]
    )


FIGURES = {"changes": lambda r: draw_changes(r.select(group=list(CHANGES)))}
TABLES = {
    "leg_worlds": lambda r: table_kinds(r.select(group=LEG)),
    "walk_worlds": lambda r: table_kinds(r.select(group=WALK)),
    "guarded": lambda r: table_kinds(r.select(group=GUARDED)),
    "rates": lambda r: table_kinds(r.select(group=RATE, world=list(TESTED))),
}
