"""The stability of a run as a page, and as a table in the terminal."""

import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cmacexp.data.folder import OUT_KEY, replacing
from cmacexp.data.manifest import REPORT
from cmacexp.data.stored_run import StoredRun
from cmacexp.metrics.text import format_cell
from cmacexp.report.figures import HeatMap, Panel, Series, draw
from cmacexp.report.markdown import render_markdown
from cmacexp.report.page import Report, write_report
from cmacexp.report.parts import Renderer
from cmacexp.stability import verdict as limits
from cmacexp.stability.analysis import Analysis
from cmacexp.stability.growth_map import GrowthMap
from cmacexp.stability.verdict import HOLDS, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

TITLES = ("lead", "learning", "growth per cycle", "least Re T", "ends in cycle")
VERDICT = "stability.json"
DECIMALS = 4
"""Of factors of growth."""
MIN_SHOWN_REAL = -0.6
"""Real parts below this are cut off."""
SHOWN_GROWTH = (0.95, 1.05)
"""Factors of growth beyond these have the colour of the nearer one."""


class Findings(NamedTuple):
    """What is said of a run; None where there is none, or it is not asked for."""

    verdict: Verdict
    analysis: Analysis | None
    growth_map: GrowthMap | None
    notes: Sequence[str]
    """Sentences: other leads, or why there is no analysis or map."""


def rows(analysis: Analysis) -> list[list[str]]:
    """One row per lead, under :data:`TITLES`."""
    return [
        [
            f"{lead} (this run)" if lead == analysis.lead else str(lead),
            each.verdict,
            format_cell(each.growth, DECIMALS),
            format_cell(float(analysis.least_real(lead).min())),
            str(each.ends or "-"),
        ]
        for lead, each in analysis.verdicts.items()
    ]


def advise(analysis: Analysis) -> list[str]:
    """Other leads with which learning holds, in a sentence; nothing where it holds with that of the run."""
    if len(analysis.verdicts) == 1 or analysis.verdicts[analysis.lead].verdict == HOLDS:
        return []
    held = [str(lead) for lead, each in analysis.verdicts.items() if each.verdict == HOLDS]
    return [f"Learning holds with lead {' or '.join(held)}." if held else "No lead that was tried is sure to hold."]


def _draw_growth(analysis: Analysis) -> "Figure":
    """Change of the feedback from cycle to cycle, measured and predicted; growth of every lead."""
    start, sizes = analysis.growth.cycle + 1, analysis.sizes
    predicted = analysis.growth.sizes(max(len(sizes) - start + 1, 2))
    change = [
        Series("in memory", np.arange(1, len(sizes) + 1), sizes),
        Series("predicted", start + np.arange(len(predicted)), predicted),
    ]
    leads, factors = list(map(str, analysis.verdicts)), [each.growth for each in analysis.verdicts.values()]
    by_lead = [Series("growth", np.arange(len(leads)), factors)]
    panels = [
        Panel("change of U to the next cycle", "cycle", "root of summed squares, N m", change, log="y"),
        Panel(
            "growth per cycle", "learning.lead, samples", "factor from cycle to cycle", by_lead, "scatter",
            ticks=leads, y_limits=[1.0], from_zero=False,
        ),
    ]  # fmt: skip
    return draw(panels, height=3.0)


def _draw_real_parts(analysis: Analysis) -> "Figure":
    """Re T over frequency for each lead, the least of all places of the cycle."""
    hertz, shown = analysis.spectra[0].frequencies, (MIN_SHOWN_REAL, 1.3)
    series = [Series(f"lead {lead}", hertz, analysis.least_real(lead)) for lead in analysis.verdicts]
    return draw([Panel("T", "frequency, Hz", "Re T, least eigenvalue", series, y_limits=[0.0], y_range=shown)])


def _draw_map(growth_map: GrowthMap) -> "Figure":
    """Growth over lead and rate, and the run's own setting."""
    rates, leads = [f"{rate:.4g}" for rate in growth_map.rates], list(map(str, growth_map.leads))
    values, axes = np.clip(growth_map.growth, *SHOWN_GROWTH), ("learning.rate", "learning.lead, samples")
    return draw([HeatMap("growth per cycle", *axes, rates, leads, values, marks=[growth_map.present])], 1, 2.8)


def _list_figures(found: Findings) -> "dict[str, Callable[[], Figure]]":
    figures: dict[str, Callable[[], Figure]] = {}
    if found.analysis is not None:
        figures["growth"] = partial(_draw_growth, found.analysis)
        figures["real_parts"] = partial(_draw_real_parts, found.analysis)
    if found.growth_map is not None:
        figures["growth_map"] = partial(_draw_map, found.growth_map)
    return figures


def _list_tables(found: Findings) -> "dict[str, Callable[[], DataFrame]]":
    """Growth of each lead; the map."""
    from pandas import DataFrame

    tables: dict[str, Callable[[], DataFrame]] = {}
    if found.analysis is not None:
        tables["leads"] = partial(DataFrame, rows(found.analysis), columns=list(TITLES))
    if found.growth_map is not None:
        titles, cells = found.growth_map.tabulate()
        tables["growth_map"] = partial(DataFrame, cells, columns=titles)
    return tables


def write_stability_report(run: StoredRun, found: Findings, folder: Path) -> Path:
    """Write what was found of a run, verdict and page, into ``folder``; returns the HTML file."""
    title = f"Stability of learning: {run.config['scenario']}, {run.folder.resolve().name}"
    asked: dict[str, Any] = {"runs": {str(run.folder.resolve()): run.manifest.get("config_hash")}}
    verdict, analysis = found.verdict, found.analysis
    values: dict[str, Any] = {**found._asdict(), "limits": limits}
    if analysis is not None:
        asked["cycle"] = analysis.growth.cycle
        values["holding"] = [f"lead {lead}" for lead in analysis.verdicts if (analysis.least_real(lead) > 0.0).all()]
    with replacing(folder, OUT_KEY, REPORT) as place:
        growth = verdict.growth if math.isfinite(verdict.growth) else None
        place.write_text(VERDICT, json.dumps({**verdict._asdict(), "growth": growth}, indent=1) + "\n")
        renderer, text = Renderer(place.new), Path(__file__).with_name("page.md")
        drawn, tables = _list_figures(found), _list_tables(found)
        sections = render_markdown(text, "Does learning hold", renderer, drawn, tables, values)
        summary = " ".join((verdict.describe(), *found.notes))
        return write_report(Report(title, summary, sections, [place.new / VERDICT, *renderer.files], asked), place)
