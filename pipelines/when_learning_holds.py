"""Bounded learning: verdicts of several predictors on random configurations, compared with long runs.

``python -m pipelines.when_learning_holds`` draws configurations of one leg, of the quadruped and of robots, runs each
for thousands of cycles without a guard (robots for fewer), and compares the outcome with the verdict that each
predictor derives from the config only. Robots need the extra ``robots``; the quick form does not include them. The
thresholds of the verdict (``cmacexp/addons/stability/verdict.py``) were chosen with other random configurations.
"""

from collections.abc import Callable

import numpy as np

from cmacexp.addons.stability.verdict import GROWS, HOLDS, MAX_CYCLES
from cmacexp.study import Array, Declared, Figure, Mask, Panel, Results, Series, declare, draw
from pipelines.when_learning_holds_measures import MEASURES, SAID
from pipelines.worlds import ONE_LEG, QUADRUPED, ROBOT, draw_settings

DRAWS = {ONE_LEG: (1200, 3000), QUADRUPED: (240, 3000), ROBOT: (20, 150)}
"""Number of random configurations, with some of which feedback only diverges, and cycles of a run, by machine."""
CRITERIA = {
    "condition_1": "condition 1, Re(z^l T) > (beta/2) T^H T",
    "condition_2": "condition 2, Re(z^l T) > beta (l + 1/2) T^H T",
    "frequency": "Re(z^l T) > 0",
    "cycle_map": "growth of the cycle map below 1",
    "simulation": f"the first {MAX_CYCLES} cycles",
    "verdict": "verdict",
}
WITHIN = 0.002
"""Largest difference of a predicted growth per cycle from the measured one that counts as correct."""


def learning(results: Results) -> Results:
    """Select the runs that complete the cycles with feedback only, so that learning begins."""
    return Results([row for row in results.rows if row.measures["learns"] == 1.0], results.computed)


def judge(results: Results, criterion: str = "verdict") -> tuple[Mask, Mask, Mask]:
    """Compare the verdict of a criterion with the outcome, for each run that learns.

    Returns:
        Masks (runs,): the criterion predicts bounded learning; it predicts growth; learning stayed bounded. A
        criterion that cannot be computed predicts neither.
    """
    runs = learning(results)
    says = np.nan_to_num(runs.measure(criterion))
    return says == SAID[HOLDS], says == SAID[GROWS], runs.measure("held") == 1.0


def _sample(compute: Callable[[Mask, Mask, Mask], Mask], criterion: str = "verdict") -> Callable[[Results], Mask]:
    """Return a function of results that applies ``compute`` to the masks of :func:`judge`."""
    return lambda results: compute(*judge(results, criterion))


def find_growth_errors(results: Results) -> Array:
    """Return absolute differences of predicted and measured growth per cycle, for runs with small changes (n,)."""
    runs = learning(results)
    errors: Array = np.abs(runs.measure("predicted") - runs.measure("measured"))
    return errors[np.isfinite(errors)]


def draw_growth(results: Results) -> Figure:
    """Draw predicted over measured growth per cycle, for runs with small changes."""
    series = [
        Series(machine, runs.measure("measured"), runs.measure("predicted"), style={"ms": 3})
        for machine, runs in learning(results).by("machine").items()
    ]
    panel = Panel("growth per cycle", "measured", "predicted", series, "scatter", from_zero=False)
    return draw([panel], columns=1)


def values(results: Results) -> Declared:
    """Return the counts that the page shows: configurations, false verdicts of one leg, runs with a growth."""
    counts = {machine: len(runs) for machine, runs in learning(results).by("machine").items()}
    leg = results.select(machine=ONE_LEG)
    bounded, _, held = judge(leg)
    return {
        "drawn": len(results), "counts": {machine: counts.get(machine, 0) for machine in DRAWS},
        "false_holds": int((bounded & ~held).sum()), "said_holds": int(bounded.sum()),
        "grown": len(find_growth_errors(leg)),
    }  # fmt: skip


SPARED = {
    "quantity": "settings without a false “holds”",
    "value": _sample(lambda bounded, grows, held: ~(bounded & ~held)),
}
CELLS: dict[str, tuple[Callable[[Mask, Mask, Mask], Mask], str]] = {
    "said to stay bounded, stayed bounded": (lambda bounded, grows, held: bounded & held, "at least 20 %"),
    "said to stay bounded, grew": (lambda bounded, grows, held: bounded & ~held, "at most 5 %"),
    "said to grow, grew": (lambda bounded, grows, held: grows & ~held, "at least 20 %"),
    "said to grow, stayed bounded": (lambda bounded, grows, held: grows & held, "at most 5 %"),
    "undecided": (lambda bounded, grows, held: ~bounded & ~grows, "at most 20 %"),
}
"""The confusion matrix of a criterion, as shares of all settings, and the share undecided."""
SHARES: dict[str, Callable[[Mask, Mask, Mask], Mask]] = {
    "right where it decides": lambda bounded, grows, held: (bounded == held)[bounded | grows],
    "undecided": CELLS["undecided"][0],
}
"""Columns of the table for each predictor."""
STUDY = declare(
    title="When learning stays bounded",
    question="What do frequency tests, the cycle map, a short simulation and `stability` say of random "
             "configurations, and are they right?",
    runs=[
        {"set": [f"cycles={cycles}", "record=trace", "record.cycles=[1]"],
         "over": {"draw": {number: [*draw_settings(machine, 25, number)] for number in range(count)}},
         "quick": None if machine == ROBOT else {"cycles": 40}, "labels": {"machine": machine}}
        for machine, (count, cycles) in DRAWS.items()
    ],
    measures=MEASURES,
    findings={
        "base_rate": {
            "says": "Neither outcome is rare",
            "quantity": "stays bounded", "value": _sample(lambda bounded, grows, held: held),
            "each": {"machine": [ONE_LEG, QUADRUPED]}, "limit": "20 to 80 %",
        },
        "spared": {
            "says": "A false “holds” is rare on one leg", **SPARED, "each": {"machine": ONE_LEG},
            "limit": "at least 99 %",
        },
        "spared_walk": {
            "says": "A false “holds” is rare on the quadruped", **SPARED, "each": {"machine": QUADRUPED},
            "limit": "at least 95 %",
        },
        "decides": {
            "says": "The verdict leaves few settings undecided",
            "quantity": "undecided", "value": _sample(CELLS["undecided"][0]), "limit": "at most 20 %",
            "each": {"machine": [ONE_LEG, QUADRUPED]},
        },
        "precise": {
            "says": f"Where changes stay small, growth per cycle is predicted within {WITHIN:g}",
            "quantity": f"growth within {WITHIN:g} of the measured one", "of": {"machine": ONE_LEG},
            "limit": "at least 95 %",
            "value": lambda results: find_growth_errors(results) <= WITHIN,
        },
        "condition": {
            "says": "Where condition 1 is met at the places that were computed, learning stays bounded",
            "quantity": "bounded where condition 1 is met", "of": {"machine": ONE_LEG}, "limit": "at least 95 %",
            "value": _sample(lambda bounded, grows, held: held[bounded], "condition_1"),
        },
        **{
            criterion: {
                "says": f"Where it decides, “{words}” is right", "quantity": "right where it decides", "case": words,
                "value": _sample(SHARES["right where it decides"], criterion),
                "of": {"machine": ONE_LEG}, "limit": "at least 90 %",
            }
            for criterion, words in CRITERIA.items()
        },
        **{
            f"matrix_{criterion}": {
                "says": f"“{words}” is seldom wrong or undecided on one leg",
                "criteria": [
                    {"quantity": quantity, "value": _sample(cell, criterion), "of": {"machine": ONE_LEG},
                     "case": words, "limit": limit}
                    for quantity, (cell, limit) in CELLS.items()
                ],
            }
            for criterion, words in CRITERIA.items()
        },
    },
    figures={"growth": draw_growth},
    tables={
        "confusion": {
            "rows": "machine",
            "columns": {
                "n": lambda runs: len(learning(runs)),
                "stays bounded": _sample(lambda bounded, grows, held: held),
                **{
                    f"{words}: {what}": _sample(share, criterion)
                    for criterion, words in CRITERIA.items()
                    for what, share in SHARES.items()
                },
            },
        },
        **{
            f"misses_{name}": {
                "rows": {f"learning.{name}": name}, "of": {"machine": ONE_LEG},
                "columns": {
                    "settings": lambda runs: len(learning(runs)),
                    **{what: _sample(CELLS[what][0]) for what in ("said to stay bounded, grew",
                                                                  "said to grow, stayed bounded", "undecided")},
                },
            }
            for name in ("rule", "lead")
        },
    },
    values=values,
)  # fmt: skip
