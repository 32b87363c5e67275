"""The stability of a run as a page, and as a table in the terminal."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.data.folder import OUT_KEY, replacing
from cmacexp.data.manifest import REPORT
from cmacexp.data.tables import TRACE
from cmacexp.metrics.text import format_cell
from cmacexp.report.markdown import render_markdown
from cmacexp.report.page import Report, write_report
from cmacexp.report.render import Renderer
from cmacexp.stability import figures
from cmacexp.stability.analysis import LEADS, Analysis
from cmacexp.stability.further import NOTHING, Further
from cmacexp.stability.mode import AFTER_LIFT_OFF

if TYPE_CHECKING:
    from pandas import DataFrame

TITLES = ("lead", "predicted growth", "measured growth", "over cycles", "largest eigenvalue", "least Re T", "ends")
DECIMALS = 4
"""Of factors of growth."""


def rows(analysis: Analysis) -> list[list[str]]:
    """One row per lead, under :data:`TITLES`."""
    table = []
    for each in analysis.leads:
        place = f"{each.place.first}-{each.place.last}" if each.growth is not None else each.why_not
        own = " (this run)" if each is analysis.own else ""
        growth = [format_cell(each.predicted, DECIMALS), format_cell(each.measured, DECIMALS), place]
        reasons = [format_cell(each.eigenvalue, DECIMALS), format_cell(analysis.least_real(each.lead))]
        cycles = len(each.sizes) + 1
        end = f"runs {cycles} cycles" if each.completed else f"stops in cycle {cycles + 1}"
        table.append([f"{each.lead}{own}", *growth, *reasons, end])
    return table


def verdict(analysis: Analysis) -> str:
    """The conclusion for the run, in a sentence or two."""
    own = analysis.own
    grows = own.predicted > 1.0
    change = "grows" if grows else "shrinks"
    predicted, measured = format_cell(own.predicted, DECIMALS), format_cell(own.measured, DECIMALS)
    text = (
        f"With lead {own.lead} the change of the feedback from cycle to cycle {change} by a factor of "
        f"{predicted} per cycle, predicted after cycle {own.place.calm}; measured over cycles "
        f"{own.place.first} to {own.place.last}: {measured}."
    )
    held = [str(each.lead) for each in analysis.leads if each.predicted < 1.0]
    if grows:
        text += f" Learning holds with lead {' or '.join(held)}." if held else " No lead that was tried holds."
    return text


def _tables(analysis: Analysis) -> "dict[str, Callable[[], DataFrame]]":
    """The tables of the page: growth of each lead; the growing change; frequencies at which learning goes wrong."""
    from pandas import DataFrame

    modes = {"measured": analysis.measured_mode, "predicted": analysis.predicted_mode}
    changes = [
        {
            "change of the feedforward": name,
            f"share in the {AFTER_LIFT_OFF} steps after lift-off, %": 100.0 * mode.share_after_lift_off,
            "frequency at its peak, Hz": mode.frequency,
            "largest at, s": mode.busiest * analysis.config.sampling_period,
        }
        for name, mode in modes.items()
    ]
    wrong_from = [
        {"place in the cycle": name} | {f"lead {lead}": spectrum.wrong_from(lead) for lead in LEADS}
        for name, spectrum in analysis.places.items()
    ]
    return {
        "leads": partial(DataFrame, rows(analysis), columns=list(TITLES)),
        "where": partial(DataFrame, changes),
        "reasons": partial(DataFrame, wrong_from),
    }


def write_stability_report(analysis: Analysis, folder: Path, further: Further = NOTHING) -> Path:
    """Write the page of an analysis into ``folder``; returns the HTML file."""
    run, growth = analysis.run, analysis.own.place
    measured, predicted = analysis.measured_mode.change, analysis.predicted_mode.change
    title = f"Stability of learning: {analysis.config.scenario}, {run.folder.resolve().name}"
    asked = {"runs": {str(run.folder.resolve()): run.manifest.get("config_hash")}, "cycle": growth.calm}
    with replacing(folder, OUT_KEY, REPORT) as place:
        renderer = Renderer(place.new)
        sections = render_markdown(
            Path(__file__).with_name("page.md"),
            "Does learning hold",
            renderer,
            {draw.__name__: partial(draw, analysis) for draw in (figures.growth, figures.mode, figures.real_parts)}
            | further.list_figures(),
            _tables(analysis) | further.list_tables(),
            {
                "further": further,
                "calm": growth.calm,
                "last": growth.last,
                "ahead": growth.last - growth.calm,
                "likeness": float(
                    (measured * predicted).sum() / np.linalg.norm(measured) / np.linalg.norm(predicted)
                ),
                "holding": [f"lead {lead}" for lead in LEADS if analysis.least_real(lead) > 0.0],
            },
        )
        inputs = [run.folder / TRACE, *renderer.files]
        return write_report(Report(title, verdict(analysis), sections, inputs, asked), place)
