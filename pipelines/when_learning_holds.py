"""When learning stays bounded: what several predictors say of random configurations, compared with long runs.

``python -m pipelines.when_learning_holds`` draws configurations of one leg, of the quadruped and of robots, runs each
for thousands of cycles without a guard (robots for fewer), and compares how it went with what each predictor says of
the config alone. The limits of the verdict (``cmacexp/stability/verdict.py``) were chosen on other draws.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from cmacexp.models.robot_file import package_models
from cmacexp.report.figures import Panel, Series
from cmacexp.stability.growth import MAX_CYCLES_BEFORE
from cmacexp.stability.verdict import GROWS, HOLDS, MAX_CYCLES, PLACES, UNDECIDED
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
    draw,
)
from cmacexp.study.interval import UNKNOWN, estimate
from cmacexp.study.statements import Limit
from cmacexp.typing import Array, Mask
from pipelines.common_results import percent
from pipelines.when_learning_holds_measures import LINEAR, MEASURES, REALS, SAID
from pipelines.worlds import FIRST, LEG, ROBOT, WALK, draw_settings

DRAWS, QUICK_DRAWS = {LEG: 1200, WALK: 240, ROBOT: 20}, {LEG: 5, WALK: 4}
"""Settings that are drawn: with some of them feedback alone does not last."""
CYCLES, QUICK_CYCLES = {LEG: 3000, WALK: 3000, ROBOT: 150}, 40
SEED = 25
CRITERIA = {
    "condition_1": "condition 1, Re(z^l T) > (beta/2) T^H T",
    "condition_2": "condition 2, Re(z^l T) > beta (l + 1/2) T^H T",
    "frequency": "Re(z^l T) > 0",
    "cycle_map": "growth of the cycle map below 1",
    "simulation": f"the first {MAX_CYCLES} cycles",
    "verdict": "verdict",
}
WITHIN = 0.002
"""Distance of a predicted growth from the measured one that counts as right."""


BOUNDED, GREW = True, False
"""How a run went."""


def runs(quick: bool) -> list[Request]:
    """One run for each draw; of robots only where their models are installed."""
    requests = []
    for machine, count in (QUICK_DRAWS if quick else DRAWS).items():
        common = (f"cycles={QUICK_CYCLES if quick else CYCLES[machine]}", "record=trace", "record.cycles=[1]")
        for number in range(count if machine != ROBOT or package_models() else 0):
            requests.append(Request((*draw_settings(machine, SEED, number), *common), {"machine": machine}))
    return requests


def learning(results: Results) -> Results:
    """The runs in which feedback alone lasts until learning begins."""
    return Results([row for row in results.rows if row.measures["learns"] == 1.0], results.computed)


def _held(results: Results) -> Mask:
    return np.asarray(results.measure("held") == 1.0)


def _says(results: Results, criterion: str, what: str) -> Mask:
    """(runs,): whether a criterion says ``what``; where it cannot be computed it is undecided."""
    return np.asarray(np.nan_to_num(results.measure(criterion)) == SAID[what])


def _cell(results: Results, criterion: str, says: str, went: bool) -> Mask:
    """Of each run that learns: whether a criterion says this of it, and it went so."""
    own = learning(results)
    return np.asarray(_says(own, criterion, says) & (_held(own) == went))


def _spared(results: Results) -> Mask:
    return ~_cell(results, "verdict", HOLDS, GREW)


def _undecided(results: Results, criterion: str = "verdict") -> Mask:
    return _says(learning(results), criterion, UNDECIDED)


def _stayed_bounded(results: Results) -> Mask:
    return _held(learning(results))


def _right(results: Results, criterion: str) -> Mask:
    """Of each run of which a criterion says something: whether it went so."""
    own = learning(results)
    said = ~_says(own, criterion, UNDECIDED)
    return np.asarray((_says(own, criterion, HOLDS) == _held(own))[said])


def _held_if_said(results: Results, criterion: str) -> Mask:
    own = learning(results)
    return _held(own)[_says(own, criterion, HOLDS)]


def growth_errors(results: Results) -> Array:
    """Distances of predicted from measured growth, of runs whose changes stay small."""
    own = learning(results)
    errors = np.abs(own.measure("predicted") - own.measure("measured"))
    return np.asarray(errors[np.isfinite(errors)])


def _precise(results: Results) -> Mask:
    return np.asarray(growth_errors(results) <= WITHIN)


def _right_share(criterion: str) -> Criterion:
    return percent(
        "right where it decides", partial(_right, criterion=criterion), at_least(0.9), case=CRITERIA[criterion],
        machine=LEG,
    )  # fmt: skip


def _matrix(criterion: str) -> Finding:
    """The confusion matrix of a criterion on one leg, as shares of all settings, and the share undecided."""
    cells: list[tuple[str, Callable[..., Mask], Limit]] = [
        ("said to stay bounded, stayed bounded", partial(_cell, says=HOLDS, went=BOUNDED), at_least(0.2)),
        ("said to stay bounded, grew", partial(_cell, says=HOLDS, went=GREW), at_most(0.05)),
        ("said to grow, grew", partial(_cell, says=GROWS, went=GREW), at_least(0.2)),
        ("said to grow, stayed bounded", partial(_cell, says=GROWS, went=BOUNDED), at_most(0.05)),
        ("undecided", _undecided, at_most(0.2)),
    ]
    return Finding(
        [
            percent(quantity, partial(sample, criterion=criterion), limit, case=CRITERIA[criterion], machine=LEG)
            for quantity, sample, limit in cells
        ],
        says=f"“{CRITERIA[criterion]}” is seldom wrong or undecided on one leg",
    )


SPARED = "settings without a false “holds”"
FINDINGS = {
    "base_rate": Finding(
        [
            percent("stays bounded", _stayed_bounded, between(0.2, 0.8), case=machine, machine=machine)
            for machine in (LEG, WALK)
        ],
        says="Neither outcome is rare",
    ),
    "spared": Finding(
        [percent(SPARED, _spared, at_least(0.99), case=LEG, machine=LEG)],
        says="A false “holds” is rare on one leg",
    ),
    "spared_walk": Finding(
        [percent(SPARED, _spared, at_least(0.95), case=WALK, machine=WALK)],
        says="A false “holds” is rare on the quadruped",
    ),
    "decides": Finding(
        [
            percent("undecided", _undecided, at_most(0.2), case=machine, machine=machine) for machine in (LEG, WALK)
        ],
        says="The verdict leaves few settings undecided",
    ),
    "precise": Finding(
        [percent(f"growth within {WITHIN:g} of the measured one", _precise, at_least(0.95), machine=LEG)],
        says=f"Where changes stay small, growth per cycle is predicted within {WITHIN:g}",
    ),
    "condition": Finding(
        [percent("bounded where condition 1 is met", partial(_held_if_said, criterion="condition_1"), at_least(0.95),
                 machine=LEG)],
        says="Where condition 1 is met at the places that were computed, learning stays bounded",
    ),
    **{
        criterion: Finding(
            [_right_share(criterion)],
            says=f"Where it decides, “{CRITERIA[criterion]}” is right",
        )
        for criterion in CRITERIA
    },
    **{f"matrix_{criterion}": _matrix(criterion) for criterion in CRITERIA},
}  # fmt: skip


def table_confusion(results: Results) -> DataFrame:
    """How many settings each predictor says to stay bounded or to grow, how they went, and how often it was right."""
    import pandas as pd

    rows = []
    for machine, own in learning(results).by("machine").items():
        for criterion, words in CRITERIA.items():
            counts = {
                f"{named}, {then}": int(_cell(own, criterion, says, went).sum())
                for named, says in (("said bounded", HOLDS), ("said to grow", GROWS), ("undecided", UNDECIDED))
                for then, went in (("bounded", BOUNDED), ("grew", GREW))
            }
            right = _right(own, criterion)
            accuracy = estimate(right) if len(right) else UNKNOWN
            rows.append(
                {
                    "machine": machine,
                    "predictor": words,
                    "n": len(own),
                    "stay bounded, %": 100.0 * float(_held(own).mean()),
                    **counts,
                    "undecided, %": 100.0 * float(_undecided(own, criterion).mean()),
                    "right where it decides, %": 100.0 * accuracy.value,
                    "from, %": 100.0 * accuracy.low,
                    "to, %": 100.0 * accuracy.high,
                }
            )
    return pd.DataFrame(rows)


def table_misses(results: Results) -> DataFrame:
    """Wrong and undecided verdicts of one leg by single settings."""
    import pandas as pd

    own = learning(results.select(machine=LEG))
    groups = {"settings": np.ones(len(own), dtype=bool)}
    groups |= {f"rule {rule}": np.array([row.settings["learning.rule"] == rule for row in own.rows])
               for rule in sorted(own.values("learning.rule"))}  # fmt: skip
    behind = own.measure("late")
    groups |= {"lead as by `auto`": behind == 0, "less lead": behind > 0, "more lead": behind < 0}
    slow = np.abs(own.measure("predicted") - 1.0) <= WITHIN
    groups |= {f"growth predicted within {WITHIN:g} of 1": slow}
    said, undecided = ~_says(own, "verdict", UNDECIDED), _says(own, "verdict", UNDECIDED)
    holds, held = _says(own, "verdict", HOLDS), _held(own)
    return pd.DataFrame(
        {
            "which": name,
            "settings": int(chosen.sum()),
            "said bounded, grew": int((chosen & holds & ~held).sum()),
            "said to grow, bounded": int((chosen & said & ~holds & held).sum()),
            "undecided, %": 100.0 * float((chosen & undecided).sum() / max(1, chosen.sum())),
        }
        for name, chosen in groups.items()
    )


def draw_growth(results: Results) -> Figure:
    """Predicted over measured growth where changes stay small."""
    series = [
        Series(machine, own.measure("measured"), own.measure("predicted"), style={"ms": 3})
        for machine, own in learning(results).by("machine").items()
    ]
    panel = Panel("growth per cycle", "measured", "predicted", series, "scatter", from_zero=False)
    return draw([panel], columns=1)


def draw_places(results: Results) -> Figure:
    """Least eigenvalue of Re(z^l T) over frequency at the places of the cycle: median and quartiles over settings."""
    own, place = learning(results.select(machine=LEG)), np.arange(PLACES) / PLACES
    series = []
    for name, chosen in (("stayed bounded", _held(own)), ("grew", ~_held(own))):
        reals = np.array([own.measure(real) for real in REALS])[:, chosen]
        known = reals[:, np.isfinite(reals).all(axis=0)]
        if known.size:
            low, middle, high = np.quantile(known, (0.25, 0.5, 0.75), axis=1)
            series.append(Series(name, place, middle, low, high))
    panel = Panel("one leg", "share of the cycle", "least Re z^l T", series, y_limits=[0.0], y_range=(-2.0, 1.0))
    return draw([panel], columns=1)


def values(results: Results) -> dict[str, Any]:
    """Counts and settings that the page names."""
    counts = {machine: len(own.rows) for machine, own in learning(results).by("machine").items()}
    leg = results.select(machine=LEG)
    return {
        "drawn": len(results.rows),
        "legs": counts.get(LEG, 0),
        "walks": counts.get(WALK, 0),
        "robots": counts.get(ROBOT, 0),
        "robot_cycles": CYCLES[ROBOT],
        "cycles": leg.value("cycles"),
        "first": FIRST,
        "short": MAX_CYCLES_BEFORE,
        "places": PLACES,
        "small": LINEAR,
        "false_holds": int(_cell(leg, "verdict", HOLDS, GREW).sum()),
        "said_holds": int(_says(learning(leg), "verdict", HOLDS).sum()),
        "grown": len(growth_errors(leg)),
    }


STUDY = Study(
    title="When learning stays bounded",
    question="What do frequency tests, the cycle map, a short simulation and `stability` say of random "
    "configurations, and are they right?",
    runs=runs,
    measures=MEASURES,
    findings=FINDINGS,
    figures={"growth": draw_growth, "places": draw_places},
    tables={"confusion": table_confusion, "misses": table_misses},
    values=values,
)
