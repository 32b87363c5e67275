"""The paper's conclusions as numbers with limits, and what a value tried does to them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.report.figures import HeatMap, draw
from cmacexp.report.numbers import format_number
from cmacexp.study import Results
from cmacexp.study.statements import Limit
from cmacexp.typing import Array, Mask

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

TAKEN = "assumed values"
"""The variant without a change."""
EVERY_SEED, SOME_SEEDS = " ≠", " (≠)"
"""Mark numbers with which the conclusion changes."""


@dataclass(frozen=True)
class Conclusion:
    """A number of a run, and the limit within which the paper's conclusion from it holds."""

    name: str
    """In short."""
    quantity: str
    """What is measured, with its unit."""
    sample: Callable[[Results], Array]
    """(runs,): of runs that differ in their seed; one that ended early has the worst value, or NaN."""
    limit: Limit

    def holds(self, results: Results) -> Mask:
        """(runs,): whether it holds; never of NaN."""
        values = self.sample(results)
        return (self.limit.low <= values) & (values <= self.limit.high)


def tried(results: Results) -> dict[str, Results]:
    """The runs of each value tried."""
    return {name: group for name, group in results.by("variant").items() if name != TAKEN}


def ended_early(results: Results) -> Array:
    """(seeds,): number of values tried with which a run ended early."""
    return np.array([sum(not all(g.completed) for g in tried(s).values()) for s in results.by("seed").values()])


def completing(results: Results) -> Results:
    """The runs with the values taken, and with those tried with which the runs of all seeds complete."""
    return results.select(variant=[TAKEN, *(name for name, group in tried(results).items() if all(group.completed))])


def differs(conclusion: Conclusion, results: Results, variant: str) -> Mask:
    """(seeds,): whether a conclusion is another one than with the values taken and the same seed."""
    here, before = (conclusion.holds(results.select(variant=name)) for name in (variant, TAKEN))
    return np.not_equal(here, before)


def count_changes(conclusion: Conclusion, results: Results) -> Array:
    """(seeds,): number of values tried, of those with which runs complete, that change a conclusion."""
    kept = completing(results)
    changed: Array = np.sum([differs(conclusion, kept, name) for name in tried(kept)], axis=0)
    return changed


def conclusion_table(results: Results, conclusions: Sequence[Conclusion]) -> "pd.DataFrame":
    """Each conclusion: its limit, its number with the values taken, and the range over all that complete."""
    import pandas as pd

    taken, rows = results.select(variant=TAKEN), []
    for one in conclusions:
        numbers, held, every = one.sample(taken), one.holds(taken), one.sample(completing(results))
        rows.append(
            {
                "conclusion": one.name,
                "measured": one.quantity,
                "holds": one.limit.describe(1.0, ""),
                TAKEN: float(numbers.mean()),
                "seeds with which it holds": f"{held.sum()} of {len(held)}",
                "least": float(every.min()),
                "largest": float(every.max()),
            }
        )
    return pd.DataFrame(rows)


def _mark(changed: Mask) -> str:
    return EVERY_SEED if changed.all() else SOME_SEEDS if changed.any() else ""


def number_table(results: Results, conclusions: Sequence[Conclusion]) -> "pd.DataFrame":
    """Every number, the mean over seeds, marked where it changes a conclusion."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for name, group in results.by("variant").items():
        ended = len(group) - sum(group.completed)
        numbers = {
            one.name: format_number(float(one.sample(group).mean())) + _mark(differs(one, results, name))
            for one in conclusions
        }
        rows.append({"value": name, **numbers, "ended early": f"{ended} of {len(group)}"})
    return pd.DataFrame(rows)


def draw_changes(results: Results, conclusions: Sequence[Conclusion]) -> "Figure":
    """Every number over that with the values taken; a dot where the conclusion changes with every seed."""
    groups = dict(reversed(tried(results).items()))  # the first row is the lowest
    taken = results.select(variant=TAKEN)
    ratios = np.array(
        [[np.abs(one.sample(g).mean() / one.sample(taken).mean()) for one in conclusions] for g in groups.values()]
    )
    marks = [
        (row, column)
        for row, name in enumerate(groups)
        for column, one in enumerate(conclusions)
        if differs(one, results, name).all()
    ]
    ratios[~np.isfinite(ratios) | (ratios <= 0.0)] = np.nan
    panel = HeatMap(
        "", "", "", [one.name for one in conclusions], list(groups), ratios,
        "over that with the assumed values", log=True, marks=marks,
    )  # fmt: skip
    return draw([panel], height=1.2 + 0.17 * len(groups))
