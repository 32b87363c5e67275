"""Growth of learning over lead and rate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmacexp.config import Config
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.text import format_cell
from cmacexp.plants import AnalyticPlant
from cmacexp.stability.cycle_map import NotPredictable, RestorableLoop
from cmacexp.stability.growth import GROWTH_CYCLES, grow, learn_until
from cmacexp.typing import Array

AROUND = 2
"""Leads to each side of the run's, unless others are asked for."""
RATES = (0.02, 0.05, 0.1, 0.2, 0.4)
"""Rates, unless others are asked for."""
DECIMALS = 4
"""Of factors of growth."""


def _label(rate: float) -> str:
    """A rate as printed: those that read alike are one."""
    return f"{rate:.4g}"


@dataclass(frozen=True)
class GrowthMap:
    """Growth per cycle with every lead and rate, from one state that learning has reached."""

    cycle: int
    """The cycle before which the loop is linearised."""
    leads: Sequence[int]
    rates: Sequence[float]
    growth: Array
    """(leads, rates)."""
    present: tuple[int, int]
    """Row and column of the run's own lead and rate."""

    def tabulate(self) -> tuple[list[str], list[list[str]]]:
        """Titles and rows of a table; an asterisk marks the run's own setting."""
        cells = [[format_cell(value, DECIMALS) for value in row] for row in self.growth]
        cells[self.present[0]][self.present[1]] += " *"
        rows = [[str(lead), *line] for lead, line in zip(self.leads, cells, strict=True)]
        return ["lead", *(f"rate\n{_label(rate)}" for rate in self.rates)], rows

    def summarise(self) -> str:
        """The rates with which each lead holds, in a sentence."""
        held = [
            f"{lead} (rate {', '.join(_label(self.rates[int(column)]) for column in np.flatnonzero(row < 1.0))})"
            for lead, row in zip(self.leads, self.growth, strict=True)
            if (row < 1.0).any()
        ]
        return f"Below 1 with lead {'; '.join(held)}." if held else "No lead and rate of the map is below 1."


def lasting_growth(loop: RestorableLoop, lead: int, rate: float) -> float:
    """The larger of growth over the cycles of ``Growth.per_cycle``, and later, over those with slow changes alone.

    Args:
        loop: learns with these from where it stands; its state stays as it is.
        lead: of learning, samples.
        rate: of learning.

    Returns:
        Infinite where a run ends within a cycle.
    """
    loop.learn_with(lead, rate)
    try:
        growth = grow(loop)
    except NotPredictable:
        return float("inf")
    later = growth.cycle + 2 * GROWTH_CYCLES
    both = growth.per_cycle, growth.over(later, later + GROWTH_CYCLES)
    return float(np.nan_to_num(both, nan=np.inf).max())  # what grows without end is not finite


def map_growth(config: Config, cycle: int, ends: Sequence[int] | None, rates: Sequence[float] | None) -> GrowthMap:
    """Growth of learning with some leads and rates, and those of the run.

    Args:
        config: of a run.
        cycle: the loop is linearised when so many cycles are done.
        ends: first and last lead, samples; None: AROUND that of the run.
        rates: None: those of RATES that are not near that of the run.

    Raises:
        NotPredictable: the run does not learn, ends before, or is too slow: its plant is not analytic.
    """
    scenario = make_scenario(config)
    if not isinstance(scenario.plant, AnalyticPlant):
        raise NotPredictable("only the analytic plant of planar machines is fast enough")
    loop, lead, rate = learn_until(config, cycle, scenario), scenario.setup.lead, scenario.setup.rate
    first, last = ends or (lead - AROUND, lead + AROUND)
    all_leads = sorted({*range(first, last + 1), lead})
    others = [other for other in RATES if abs(other - rate) > 0.1 * rate] if rates is None else rates
    all_rates = sorted(({_label(other): other for other in others} | {_label(rate): rate}).values())
    growth = np.array([[lasting_growth(loop, row, column) for column in all_rates] for row in all_leads])
    return GrowthMap(cycle + 1, all_leads, all_rates, growth, (all_leads.index(lead), all_rates.index(rate)))
