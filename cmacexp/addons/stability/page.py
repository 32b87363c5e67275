"""The stability analysis of a run as an HTML page and as a table in the terminal."""

import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from pandas import DataFrame

from cmacexp.addons.stability import verdict as limits
from cmacexp.addons.stability.verdict import HOLDS, Analysis, Verdict
from cmacexp.data.folder import OUT_KEY, new_result
from cmacexp.data.manifest import REPORT
from cmacexp.data.run import Run
from cmacexp.metrics.registry import format_cell
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.page import Renderer, Report, render_markdown, write_report

TITLES = ("lead", "learning", "growth per cycle", "least Re T", "ends in cycle")
VERDICT = "stability.json"


def make_rows(analysis: Analysis) -> list[list[str]]:
    """Format the verdicts as a table with one row per lead, and :data:`TITLES` as columns."""
    return [
        [
            f"{lead} (this run)" if lead == analysis.lead else str(lead),
            verdict.verdict,
            format_cell(verdict.growth, decimals=4),
            format_cell(float(analysis.least_real(lead).min())),
            str(verdict.ends or "-"),
        ]
        for lead, verdict in analysis.verdicts.items()
    ]


def advise(analysis: Analysis) -> list[str]:
    """List, in one sentence, the leads with which learning holds; return nothing if it holds with the run's own."""
    if len(analysis.verdicts) == 1 or analysis.verdicts[analysis.lead].verdict == HOLDS:
        return []
    held = [str(lead) for lead, verdict in analysis.verdicts.items() if verdict.verdict == HOLDS]
    return [f"Learning holds with lead {' or '.join(held)}." if held else "No lead that was tried is sure to hold."]


def _draw_growth(analysis: Analysis) -> Figure:
    """Draw the change of the feedback from cycle to cycle, simulated and predicted."""
    start = analysis.growth.cycle + 1
    predicted = analysis.growth.krylov.lengths(max(len(analysis.sizes) - start + 1, 2))
    change = [
        Series("in memory", np.arange(1, len(analysis.sizes) + 1), analysis.sizes),
        Series("predicted", start + np.arange(len(predicted)), predicted),
    ]
    return draw(
        [Panel("change of U to the next cycle", "cycle", "root of summed squares, N m", change, log="y")], height=3.0
    )


def _draw_real_parts(analysis: Analysis) -> Figure:
    """Draw the least eigenvalue of Re z^l T over frequency for each lead l, the least over all samples."""
    series = [
        Series(f"lead {lead}", analysis.spectra[0].frequencies, analysis.least_real(lead))
        for lead in analysis.verdicts
    ]
    return draw(
        [Panel("T", "frequency, Hz", "least eigenvalue of Re T", series, y_limits=[0.0], y_range=(-0.6, 1.3))]
    )


def write_stability_report(
    run: Run, verdict: Verdict, analysis: Analysis | None, notes: Sequence[str], folder: Path
) -> Path:
    """Write verdict and page of a run into ``folder``, and return the HTML file; the summary ends with ``notes``."""
    title = f"Stability of learning: {run.config['scenario']}, {run.folder.resolve().name}"
    request: dict[str, Any] = {"runs": {str(run.folder.resolve()): run.manifest["config_hash"]}}
    values: dict[str, Any] = {"analysis": analysis, "limits": limits}
    figures: dict[str, Callable[[], Figure]] = {}
    tables: dict[str, Callable[[], DataFrame]] = {}
    if analysis is not None:
        figures = {"growth": partial(_draw_growth, analysis), "real_parts": partial(_draw_real_parts, analysis)}
        tables = {"leads": partial(DataFrame, make_rows(analysis), columns=list(TITLES))}
        request["cycle"] = analysis.growth.cycle
        values["holding"] = [f"lead {lead}" for lead in analysis.verdicts if (analysis.least_real(lead) > 0.0).all()]
    with new_result(folder, OUT_KEY, REPORT) as writer:
        growth = verdict.growth if math.isfinite(verdict.growth) else None
        writer.write_text(VERDICT, json.dumps({**verdict._asdict(), "growth": growth}, indent=1) + "\n")
        text = Path(__file__).with_name("page.md.jinja")
        sections = render_markdown(
            text.read_text(encoding="utf-8"),
            text,
            "Does learning hold",
            Renderer(writer.part),
            figures,
            tables,
            values,
        )
        return write_report(Report(title, " ".join((verdict.describe(), *notes)), sections, request), writer)
