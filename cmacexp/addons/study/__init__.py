"""Studies: runs, measures, claims, findings and figures, declared in one file, and a page that shows them.

All that a study in Python is written with is imported from here: the declaration, results and samples of its runs,
statistics, tables and figures.
"""

from cmacexp.addons.study.comparison import Comparison, compare, find_order, interval_panel, profile_panel
from cmacexp.addons.study.declaration import Declared, declare, read_criteria
from cmacexp.addons.study.interval import UNPAIRED, Interval, estimate
from cmacexp.addons.study.results import Measure, Measures, Results, RunRow
from cmacexp.addons.study.samples import Sample, compute_growth, ended_in, per_seed, quotients, relative
from cmacexp.addons.study.statements import ANY, Claim, Criterion, Finding, Limit, at_least, at_most, between
from cmacexp.addons.study.study import DataFrame, Figure, Request, Study, grid, starting_from
from cmacexp.addons.study.views import (
    completed,
    cross_tabulate,
    describe_estimates,
    of_completed,
    over_cycles,
    over_setting,
    tabulate,
)
from cmacexp.data.run import Run
from cmacexp.metrics.registry import FINAL_CYCLES, TRANSFER, compute_final, find_history, format_number
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.typing import Array, Mask, Status

__all__ = [
    "ANY",
    "FINAL_CYCLES",
    "TRANSFER",
    "UNPAIRED",
    "Array",
    "Claim",
    "Comparison",
    "Criterion",
    "DataFrame",
    "Declared",
    "Figure",
    "Finding",
    "Interval",
    "Limit",
    "Mask",
    "Measure",
    "Measures",
    "Panel",
    "Request",
    "Results",
    "Run",
    "RunRow",
    "Sample",
    "Series",
    "Status",
    "Study",
    "at_least",
    "at_most",
    "between",
    "compare",
    "completed",
    "compute_final",
    "compute_growth",
    "cross_tabulate",
    "declare",
    "describe_estimates",
    "draw",
    "ended_in",
    "estimate",
    "find_history",
    "find_order",
    "format_number",
    "grid",
    "interval_panel",
    "of_completed",
    "over_cycles",
    "over_setting",
    "per_seed",
    "profile_panel",
    "quotients",
    "read_criteria",
    "relative",
    "starting_from",
    "tabulate",
]
