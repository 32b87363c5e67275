"""When learning holds: verdicts on random settings, compared with long runs.

``python -m pipelines.when_learning_holds`` draws settings of one leg, of the quadruped and of robots, runs each for
thousands of cycles without a guard (robots for fewer), and compares how it went with what several criteria say of the
config alone. The limits of the verdict (``cmacexp/stability/verdict.py``) were chosen on other draws.
"""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.commands.study import main
from cmacexp.models.robot_file import package_models
from cmacexp.report.figures import Panel, Series
from cmacexp.stability.growth import MAX_CYCLES_BEFORE
from cmacexp.stability.verdict import HOLDS, MAX_CYCLES, PLACES, UNDECIDED
from cmacexp.study import Criterion, Finding, Request, Results, Study, at_least, at_most, draw
from cmacexp.typing import Array, Mask
from pipelines.common_results import percent
from pipelines.when_learning_holds_draws import FIRST, LEG, ROBOT, WALK, Draws
from pipelines.when_learning_holds_measures import LINEAR, MEASURES, REALS, SAID

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

DRAWS, QUICK_DRAWS = {LEG: 1200, WALK: 240, ROBOT: 20}, {LEG: 5, WALK: 4}
"""Settings that are drawn: with some of them feedback alone does not last."""
CYCLES, QUICK_CYCLES = {LEG: 3000, WALK: 3000, ROBOT: 150}, 40
SEED = 25
CRITERIA = {
    "condition": "Re(z^l T) > (beta/2) |T|^2",
    "frequency": "Re(z^l T) > 0",
    "cycle_map": "growth of the cycle map below 1",
    "simulation": f"the first {MAX_CYCLES} cycles",
    "verdict": "verdict",
}
WITHIN = 0.002
"""Distance of a predicted growth from the measured one that counts as right."""


def runs(quick: bool) -> list[Request]:
    """One run for each draw; of robots only where their models are installed."""
    requests = []
    for machine, count in (QUICK_DRAWS if quick else DRAWS).items():
        common = (f"cycles={QUICK_CYCLES if quick else CYCLES[machine]}", "record=trace", "record.cycles=[1]")
        draws = Draws(machine, SEED)
        for number in range(count if machine != ROBOT or package_models() else 0):
            requests.append(Request((*draws.draw(number), *common), {"machine": machine}))
    return requests


def learning(results: Results) -> Results:
    """The runs in which feedback alone lasts until learning begins."""
    return Results([row for row in results.rows if row.measures["learns"] == 1.0], results.computed)


def _held(results: Results) -> Mask:
    return np.asarray(results.measure("held") == 1.0)


def _says(results: Results, criterion: str, what: str) -> Mask:
    """(runs,): whether a criterion says ``what``; where it cannot be computed it is undecided."""
    return np.asarray(np.nan_to_num(results.measure(criterion)) == SAID[what])


def falsely_holds(results: Results, criterion: str) -> Mask:
    """Of each run that learns: whether it was said to hold, and grew."""
    own = learning(results)
    return np.asarray(_says(own, criterion, HOLDS) & ~_held(own))


def _spared(results: Results) -> Mask:
    return ~falsely_holds(results, "verdict")


def _undecided(results: Results) -> Mask:
    return _says(learning(results), "verdict", UNDECIDED)


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


SPARED = "settings without a false “holds”"
FINDINGS = {
    "spared": Finding(
        [percent(SPARED, _spared, at_least(0.99), case=LEG, machine=LEG)],
        yes="A false “holds” is rare on one leg: {value} of the settings have none.",
        no="A false “holds” is too frequent on one leg: only {value} of the settings have none.",
    ),
    "spared_walk": Finding(
        [percent(SPARED, _spared, at_least(0.95), case=WALK, machine=WALK)],
        yes="A false “holds” is rare on the quadruped: {value} of the settings have none.",
        no="A false “holds” is too frequent on the quadruped: only {value} of the settings have none.",
    ),
    "decides": Finding(
        [
            percent("undecided", _undecided, at_most(0.2), case=machine, machine=machine) for machine in (LEG, WALK)
        ],
        yes="The verdict leaves few settings undecided: {values[0]} of one leg, {values[1]} of the quadruped.",
        no="The verdict leaves many settings undecided: {values[0]} of one leg, {values[1]} of the quadruped.",
    ),
    "precise": Finding(
        [percent(f"growth within {WITHIN:g} of the measured one", _precise, at_least(0.95), machine=LEG)],
        yes=f"Where changes stay small, growth per cycle is predicted within {WITHIN:g} in {{value}} of the runs.",
        no=f"Where changes stay small, growth per cycle is predicted within {WITHIN:g} in only {{value}} of the "
        "runs.",
    ),
    "condition": Finding(
        [percent("held where the condition says so", partial(_held_if_said, criterion="condition"), at_least(0.95),
                 machine=LEG)],
        yes="Where the condition is met, learning holds in {value} of the settings.",
        no="Where the condition is met at the places that were computed, learning holds in only {value} of the "
        "settings.",
    ),
    **{
        criterion: Finding(
            [_right_share(criterion)],
            yes=f"Where it decides, “{CRITERIA[criterion]}” is right in {{value}} of the settings.",
            no=f"Where it decides, “{CRITERIA[criterion]}” is right in only {{value}} of the settings.",
        )
        for criterion in ("frequency", "cycle_map", "simulation", "verdict")
    },
}  # fmt: skip


def table_confusion(results: Results) -> "pd.DataFrame":
    """How many settings each criterion says to hold or to grow, and how they went."""
    import pandas as pd

    rows = []
    for machine, own in learning(results).by("machine").items():
        held = _held(own)
        for criterion, words in CRITERIA.items():
            holds, undecided = _says(own, criterion, HOLDS), _says(own, criterion, UNDECIDED)
            grows = ~holds & ~undecided
            cells = {"said to hold": holds, "said to grow": grows, "undecided": undecided}
            counts = {
                f"{said}, {went}": int((cell & (held == (went == "held"))).sum())
                for said, cell in cells.items()
                for went in ("held", "grew")
            }
            rows.append({"machine": machine, "criterion": words, **counts})
    return pd.DataFrame(rows)


def table_misses(results: Results) -> "pd.DataFrame":
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
            "said to hold, grew": int((chosen & holds & ~held).sum()),
            "said to grow, held": int((chosen & said & ~holds & held).sum()),
            "undecided, %": 100.0 * float((chosen & undecided).sum() / max(1, chosen.sum())),
        }
        for name, chosen in groups.items()
    )


def draw_growth(results: Results) -> "Figure":
    """Predicted over measured growth where changes stay small."""
    series = [
        Series(machine, own.measure("measured"), own.measure("predicted"), style={"ms": 3})
        for machine, own in learning(results).by("machine").items()
    ]
    panel = Panel("growth per cycle", "measured", "predicted", series, "scatter", from_zero=False)
    return draw([panel], columns=1)


def draw_places(results: Results) -> "Figure":
    """Least Re z^l T over frequency at the places of the cycle: median and quartiles over settings."""
    own, place = learning(results.select(machine=LEG)), np.arange(PLACES) / PLACES
    series = []
    for name, chosen in (("held", _held(own)), ("grew", ~_held(own))):
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
        "false_holds": int(falsely_holds(leg, "verdict").sum()),
        "said_holds": int(_says(learning(leg), "verdict", HOLDS).sum()),
        "grown": len(growth_errors(leg)),
    }


STUDY = Study(
    title="When learning holds",
    question="What do frequency tests, the cycle map, a short simulation and `stability` say of random settings, and "
    "are they right?",
    runs=runs,
    measures=MEASURES,
    findings=FINDINGS,
    figures={"growth": draw_growth, "places": draw_places},
    tables={"confusion": table_confusion, "misses": table_misses},
    values=values,
)

if __name__ == "__main__":
    main(__file__)
