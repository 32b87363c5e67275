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

    @property
    def titles(self) -> list[str]:
        """Columns of a table."""
        return ["lead", *(f"rate\n{rate:.4g}" for rate in self.rates)]

    @property
    def rows(self) -> list[list[str]]:
        """Rows of a table; an asterisk marks the run's own setting."""
        cells = [[format_cell(value, DECIMALS) for value in row] for row in self.growth]
        row, column = self.present
        cells[row][column] += " *"
        return [[str(lead), *line] for lead, line in zip(self.leads, cells, strict=True)]

    def summarise(self) -> str:
        """The rates with which each lead holds, in a sentence."""
        held = {lead: self.growth[i] < 1.0 for i, lead in enumerate(self.leads)}
        named = [
            f"{lead} (rate {', '.join(f'{rate:.4g}' for rate, holds in zip(self.rates, row, strict=True) if holds)})"
            for lead, row in held.items()
            if row.any()
        ]
        return f"Below 1 with lead {'; '.join(named)}." if named else "No lead and rate of the map is below 1."


def map_growth(config: Config, cycle: int, leads: Sequence[int] | None, rates: Sequence[float] | None) -> GrowthMap:
    """Growth of learning with some leads and rates, and those of the run.

    Args:
        config: of a run.
        cycle: the loop is linearised about the torque of the one after it.
        leads: samples; None: AROUND that of the run.
        rates: None: those of RATES that are not near that of the run.

    Raises:
        NotPredictable: see :func:`cmacexp.stability.lifted.lift`.
    """
    setup = make_scenario(config).setup
    lifted = lift(config, cycle)
    lead, rate = setup.lead, setup.rate
    all_leads = sorted({*(range(lead - AROUND, lead + AROUND + 1) if leads is None else leads), lead})
    others = [other for other in RATES if abs(other - rate) > 0.1 * rate] if rates is None else rates
    all_rates = sorted({*others, rate})
    growth = np.array([[lifted.lasting_growth(row, column) for column in all_rates] for row in all_leads])
    return GrowthMap(cycle + 1, all_leads, all_rates, growth, (all_leads.index(lead), all_rates.index(rate)))
