"""When learning stays bounded: what several predictors say of random configurations, compared with long runs.

``python -m pipelines.when_learning_holds`` draws configurations of one leg, of the quadruped and of robots, runs each
for thousands of cycles without a guard (robots for fewer), and compares how it went with what each predictor says of
the config alone. Robots need the extra ``robots``; the quick form goes without. The limits of the verdict
(``cmacexp/addons/stability/verdict.py``) were chosen on other draws.
"""

from collections.abc import Callable

import numpy as np

from cmacexp.addons.stability.verdict import GROWS, HOLDS, MAX_CYCLES
from cmacexp.study import Array, Declared, Figure, Mask, Panel, Results, Series, declare, draw
from pipelines.when_learning_holds_measures import MEASURES, SAID
from pipelines.worlds import ONE_LEG, QUADRUPED, ROBOT, draw_settings

DRAWS = {ONE_LEG: (1200, 3000), QUADRUPED: (240, 3000), ROBOT: (20, 150)}
"""Settings that are drawn, of which feedback alone does not last with some; and their cycles."""
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


def learning(results: Results) -> Results:
    """The runs in which feedback alone lasts until learning begins."""
    return Results([row for row in results.rows if row.measures["learns"] == 1.0], results.computed)


def judge(results: Results, criterion: str = "verdict") -> tuple[Mask, Mask, Mask]:
    """Of each run that learns: whether a criterion says that it stays bounded, that it grows; and whether it stayed.

    A criterion that cannot be computed says nothing.
    """
    own = learning(results)
    says = np.nan_to_num(own.measure(criterion))
    return says == SAID[HOLDS], says == SAID[GROWS], own.measure("held") == 1.0


def _sample(compute: Callable[[Mask, Mask, Mask], Mask], criterion: str = "verdict") -> Callable[[Results], Mask]:
    """A sample of what :func:`judge` gives."""
    return lambda results: compute(*judge(results, criterion))


def find_growth_errors(results: Results) -> Array:
    """Distances of predicted from measured growth, of runs whose changes stay small."""
    own = learning(results)
    errors: Array = np.abs(own.measure("predicted") - own.measure("measured"))
    return errors[np.isfinite(errors)]


def draw_growth(results: Results) -> Figure:
    """Predicted over measured growth where changes stay small."""
    series = [
        Series(machine, own.measure("measured"), own.measure("predicted"), style={"ms": 3})
        for machine, own in learning(results).by("machine").items()
    ]
    panel = Panel("growth per cycle", "measured", "predicted", series, "scatter", from_zero=False)
    return draw([panel], columns=1)


def values(results: Results) -> Declared:
    """Counts that the page names."""
    counts = {machine: len(own) for machine, own in learning(results).by("machine").items()}
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
"""What the table shows of each predictor."""
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
                "n": lambda own: len(learning(own)),
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
                    "settings": lambda own: len(learning(own)),
                    **{what: _sample(CELLS[what][0]) for what in ("said to stay bounded, grew",
                                                                  "said to grow, stayed bounded", "undecided")},
                },
            }
            for name in ("rule", "lead")
        },
    },
    values=values,
)  # fmt: skip
