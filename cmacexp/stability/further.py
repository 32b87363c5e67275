"""What the analysis of a run contains where it is asked for: the map of growth, and the corners."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.stability.corners import Corner
from cmacexp.stability.growth_map import GrowthMap
from cmacexp.stability.verdict import GROWS, HOLDS, UNDECIDED

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

SHOWN_GROWTH = (0.95, 1.05)
"""Factors of growth beyond these have the colour of the nearer one."""


def draw_map(growth_map: GrowthMap) -> "Figure":
    """Growth over lead and rate, and the run's own setting."""
    from cmacexp.report.figures import HeatMap, draw

    rates, leads = [f"{rate:.4g}" for rate in growth_map.rates], list(map(str, growth_map.leads))
    values, axes = np.clip(growth_map.growth, *SHOWN_GROWTH), ("learning.rate", "learning.lead, samples")
    return draw([HeatMap("growth per cycle", *axes, rates, leads, values, marks=[growth_map.present])], 1, 2.8)


@dataclass(frozen=True)
class Further:
    """What is said besides the verdict, the map and the corners; None and empty where they are not asked for."""

    growth_map: GrowthMap | None = None
    corners: Sequence[Corner] = ()
    notes: Sequence[str] = ()
    """Sentences: the conclusion of the analysis, or why there is no analysis or map."""

    def count_corners(self) -> str:
        """How many corners hold, grow and are undecided, in a sentence."""
        verdicts = [corner.judgement.verdict for corner in self.corners]
        holds, grows, undecided = map(verdicts.count, (HOLDS, GROWS, UNDECIDED))
        return f"Of {len(verdicts)} corners learning holds in {holds}, grows in {grows}, is undecided in {undecided}."

    def list_figures(self) -> "dict[str, Callable[[], Figure]]":
        """Figures of the page."""
        return {} if self.growth_map is None else {"growth_map": partial(draw_map, self.growth_map)}

    def list_tables(self) -> "dict[str, Callable[[], DataFrame]]":
        """Tables of the page."""
        from pandas import DataFrame

        corners = [
            {
                "stiffness, over the assumed": corner.stiffness,
                "masses, over those of the run": corner.masses,
                "learning": corner.judgement.verdict,
                "growth": corner.judgement.growth,
                "reasons": " ".join(corner.judgement.reasons),
            }
            for corner in self.corners
        ]
        titles, rows = ([], []) if self.growth_map is None else self.growth_map.tabulate()
        return {"growth_map": partial(DataFrame, rows, columns=titles), "corners": partial(DataFrame, corners)}

    def print(self) -> None:
        """Print all of it in the terminal."""
        from cmacexp.report.terminal import say
        from cmacexp.report.terminal_tables import print_table

        for line in self.notes:
            say(line)
        if self.growth_map is not None:
            print_table(*self.growth_map.tabulate())
            say(f"Growth per cycle; * is this run. {self.growth_map.summarise()}")
        for line in (*(corner.describe() for corner in self.corners), self.count_corners()) if self.corners else ():
            say(line)
