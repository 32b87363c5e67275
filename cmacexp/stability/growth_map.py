"""Growth of learning over lead and rate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmacexp.config import Config
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.text import format_cell
from cmacexp.stability.lifted import lift
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
    """Growth per cycle with every lead and rate, from one linearisation."""

    cycle: int
    """The cycle whose torque the loop is linearised about."""
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


def map_growth(config: Config, cycle: int, ends: Sequence[int] | None, rates: Sequence[float] | None) -> GrowthMap:
    """Growth of learning with some leads and rates, and those of the run.

    Args:
        config: of a run.
        cycle: the loop is linearised about the torque of the one after it.
        ends: first and last lead, samples; None: AROUND that of the run.
        rates: None: those of RATES that are not near that of the run.

    Raises:
        NotPredictable: see :func:`cmacexp.stability.lifted.lift`.
    """
    setup = make_scenario(config).setup
    lifted = lift(config, cycle)
    lead, rate = setup.lead, setup.rate
    first, last = ends or (lead - AROUND, lead + AROUND)
    all_leads = sorted({*range(first, last + 1), lead})
    others = [other for other in RATES if abs(other - rate) > 0.1 * rate] if rates is None else rates
    all_rates = sorted(({_label(other): other for other in others} | {_label(rate): rate}).values())
    growth = np.array([[lifted.lasting_growth(row, column) for column in all_rates] for row in all_leads])
    return GrowthMap(cycle + 1, all_leads, all_rates, growth, (all_leads.index(lead), all_rates.index(rate)))
