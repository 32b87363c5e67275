"""Studies: runs, measures, claims, findings and figures, declared in one file, and a page that shows them."""

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study.comparison import Comparison, compare
from cmacexp.study.curves import over_cycles, over_setting
from cmacexp.study.declaration import declare
from cmacexp.study.results import Results
from cmacexp.study.statements import ANY, Claim, Criterion, Finding, at_least, at_most, between
from cmacexp.study.study import DataFrame, Figure, Request, Study, grid, starting_from

__all__ = [
    "ANY",
    "Claim",
    "Comparison",
    "Criterion",
    "DataFrame",
    "Figure",
    "Finding",
    "Panel",
    "Request",
    "Results",
    "Series",
    "Study",
    "at_least",
    "at_most",
    "between",
    "compare",
    "declare",
    "draw",
    "grid",
    "over_cycles",
    "over_setting",
    "starting_from",
]
