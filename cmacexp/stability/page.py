"""The stability of a run as a page, and as a table in the terminal."""

import json
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.data.folder import OUT_KEY, replacing
from cmacexp.data.manifest import REPORT
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import TRACE
from cmacexp.metrics.text import format_cell
from cmacexp.report.markdown import render_markdown
from cmacexp.report.page import Report, write_report
from cmacexp.report.parts import Renderer, Section
from cmacexp.stability import figures
from cmacexp.stability import verdict as limits
from cmacexp.stability.analysis import Analysis
from cmacexp.stability.further import Further
from cmacexp.stability.growth import with_lead
from cmacexp.stability.mode import AFTER_LIFT_OFF
from cmacexp.stability.verdict import HOLDS, Verdict, assess

if TYPE_CHECKING:
    from pandas import DataFrame

TITLES = ("lead", "predicted growth", "measured growth", "over cycles", "largest eigenvalue", "least Re T", "ends")
VERDICT = "stability.json"
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


def conclude(analysis: Analysis, verdict: Verdict) -> str:
    """The growth of a run, and other leads with which learning holds if its own does not, in a few sentences."""
    own = analysis.own
    change = "grows" if own.predicted > 1.0 else "shrinks"
    predicted, measured = format_cell(own.predicted, DECIMALS), format_cell(own.measured, DECIMALS)
    apart = f"in memory without the guard, which acted in cycle {analysis.guarded}, " if analysis.guarded else ""
    text = (
        f"With lead {own.lead} the change of the feedback from cycle to cycle {change} by a factor of "
        f"{predicted} per cycle, predicted after cycle {own.place.calm}; measured {apart}"
        f"over cycles {own.place.first} to {own.place.last}: {measured}."
    )
    others = [each for each in analysis.leads if each is not own]
    if others and verdict.verdict != HOLDS:
        shrinking = [each.lead for each in others if each.predicted < 1.0]
        held = [str(lead) for lead in shrinking if assess(with_lead(analysis.config, lead)).verdict == HOLDS]
        text += (
            f" Learning holds with lead {' or '.join(held)}." if held else " No lead that was tried is sure to hold."
        )
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
        {"place in the cycle": name} | {f"lead {lead}": spectrum.wrong_from(lead) for lead in analysis.tried}
        for name, spectrum in analysis.places.items()
    ]
    return {
        "leads": partial(DataFrame, rows(analysis), columns=list(TITLES)),
        "where": partial(DataFrame, changes),
        "reasons": partial(DataFrame, wrong_from),
    }


def write_stability_report(
    run: StoredRun, verdict: Verdict, analysis: Analysis | None, folder: Path, further: Further
) -> Path:
    """Write verdict and page of a run into ``folder``; returns the HTML file.

    Args:
        run: that was analysed.
        verdict: on its config.
        analysis: None where there is none.
        folder: of the page.
        further: what is said besides.
    """
    title = f"Stability of learning: {run.config['scenario']}, {run.folder.resolve().name}"
    asked: dict[str, Any] = {"runs": {str(run.folder.resolve()): run.manifest.get("config_hash")}}
    with replacing(folder, OUT_KEY, REPORT) as place:
        growth = verdict.growth if math.isfinite(verdict.growth) else None
        place.write_text(VERDICT, json.dumps({**verdict._asdict(), "growth": growth}, indent=1) + "\n")
        renderer = Renderer(place.new)
        sections, inputs = _render(analysis, further, renderer), [place.new / VERDICT, *renderer.files]
        if analysis is not None:
            asked["cycle"] = analysis.own.place.calm
            inputs.append(run.folder / TRACE)
        summary = " ".join((verdict.describe(), *further.notes))
        return write_report(Report(title, summary, sections, inputs, asked), place)


def _render(analysis: Analysis | None, further: Further, renderer: Renderer) -> list[Section]:
    drawn, tables = further.list_figures(), further.list_tables()
    values: dict[str, Any] = {"analysis": analysis, "further": further, "limits": limits}
    if analysis is not None:
        growth, drawings = analysis.own.place, (figures.growth, figures.mode, figures.real_parts)
        measured, predicted = analysis.measured_mode.change, analysis.predicted_mode.change
        drawn |= {draw.__name__: partial(draw, analysis) for draw in drawings}
        tables |= _tables(analysis)
        values |= {
            "calm": growth.calm,
            "last": growth.last,
            "ahead": growth.last - growth.calm,
            "likeness": float((measured * predicted).sum() / np.linalg.norm(measured) / np.linalg.norm(predicted)),
            "holding": [f"lead {lead}" for lead in analysis.tried if analysis.least_real(lead) > 0.0],
        }
    return render_markdown(Path(__file__).with_name("page.md"), "Does learning hold", renderer, drawn, tables, values)
