"""The stability of a run as a page, and as a table in the terminal."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmacexp.data.folder import OUT_KEY, replacing
from cmacexp.data.manifest import REPORT
from cmacexp.data.tables import TRACE
from cmacexp.metrics.text import format_cell
from cmacexp.report.markdown import render_markdown
from cmacexp.report.page import Report, write_report
from cmacexp.report.render import Renderer
from cmacexp.stability import figures
from cmacexp.stability.analysis import DELAYS, LEADS, Analysis, LeadGrowth
from cmacexp.stability.mode import AFTER_LIFT_OFF, likeness

if TYPE_CHECKING:
    import pandas as pd

TITLES = ("lead", "predicted growth", "measured growth", "over cycles", "largest eigenvalue", "least Re T", "ends")
DECIMALS = 4
"""Of factors of growth."""
HOLDS = 1.0
"""Growth per cycle below which learning holds."""


def _format_end(each: LeadGrowth) -> str:
    return f"runs {len(each.sizes) + 1} cycles" if each.completed else f"stops in cycle {len(each.sizes) + 2}"


def rows(analysis: Analysis) -> list[list[str]]:
    """One row per lead, under :data:`TITLES`."""
    table = []
    for each in analysis.leads:
        place = f"{each.place.first}-{each.place.last}" if each.growth is not None else each.why_not
        own = " (this run)" if each is analysis.own else ""
        growth = [format_cell(each.predicted, DECIMALS), format_cell(each.measured, DECIMALS), place]
        reasons = [format_cell(each.eigenvalue, DECIMALS), format_cell(analysis.least_real(each.lead))]
        table.append([f"{each.lead}{own}", *growth, *reasons, _format_end(each)])
    return table


def verdict(analysis: Analysis) -> str:
    """The conclusion for the run, in a sentence or two."""
    own = analysis.own
    grows = own.predicted > HOLDS
    change = "grows" if grows else "shrinks"
    predicted, measured = format_cell(own.predicted, DECIMALS), format_cell(own.measured, DECIMALS)
    text = (
        f"With lead {own.lead} the change of the feedback from cycle to cycle {change} by a factor of "
        f"{predicted} per cycle, predicted after cycle {own.place.calm}; measured over cycles "
        f"{own.place.first} to {own.place.last}: {measured}."
    )
    held = [str(each.lead) for each in analysis.leads if each.predicted < HOLDS]
    if grows:
        text += f" Learning holds with lead {' or '.join(held)}." if held else " No lead that was tried holds."
    return text


def _where(analysis: Analysis) -> "pd.DataFrame":
    """Place and frequency of the growing change, measured and predicted."""
    import pandas as pd

    modes = {"measured": analysis.measured_mode, "predicted": analysis.predicted_mode}
    return pd.DataFrame(
        {
            "change of the feedforward": name,
            f"share in the {AFTER_LIFT_OFF} steps after lift-off, %": 100.0 * mode.share_after_lift_off,
            "frequency at its peak, Hz": mode.frequency,
            "largest at, s": mode.busiest * analysis.config.sampling_period,
        }
        for name, mode in modes.items()
    )


def _reasons(analysis: Analysis) -> "pd.DataFrame":
    """Lowest frequency, Hz, at which Re T is negative with each lead, by place; NaN where none is."""
    import pandas as pd

    return pd.DataFrame(
        {"place in the cycle": name} | {figures.format_lead(lead): spectra[0].wrong_from(lead) for lead in LEADS}
        for name, spectra in analysis.places.items()
    )


def _delays(analysis: Analysis) -> "pd.DataFrame":
    """Least Re T over frequencies and places with each lead, by further samples of delay."""
    import pandas as pd

    return pd.DataFrame(
        {"further samples of delay": str(delay)}
        | {figures.format_lead(lead): analysis.least_real(lead, delay) for lead in LEADS}
        for delay in DELAYS
    )


def _leads(analysis: Analysis) -> "pd.DataFrame":
    """What :func:`rows` says of each lead."""
    import pandas as pd

    return pd.DataFrame(rows(analysis), columns=list(TITLES))


FIGURES = {
    "growth": figures.growth,
    "mode": figures.mode,
    "real_parts": figures.real_parts,
    "along": figures.along,
    "eigenvalues": figures.eigenvalues,
}
TABLES = {"leads": _leads, "where": _where, "reasons": _reasons, "delays": _delays}


def _values(analysis: Analysis) -> dict[str, Any]:
    """What the page says in numbers."""
    place = analysis.own.place
    best = max(LEADS, key=lambda lead: min(each.least(lead) for each in analysis.along.values()))
    along = {sample * analysis.config.sampling_period: each.least(best) for sample, each in analysis.along.items()}
    return {
        "calm": place.calm,
        "last": place.last,
        "ahead": place.last - place.calm,
        "likeness": likeness(analysis.measured_mode.change, analysis.predicted_mode.change),
        "holding": [figures.format_lead(lead) for lead in LEADS if analysis.least_real(lead) > 0.0],
        "best": figures.format_lead(best),
        "samples": len(along),
        "wrong": [f"{time:.2f}" for time, least in along.items() if least < 0.0],
    }


def write_stability_report(analysis: Analysis, folder: Path) -> Path:
    """Write the page of an analysis into ``folder``; returns the HTML file."""
    run = analysis.run
    title = f"Stability of learning: {analysis.config.scenario}, {run.folder.resolve().name}"
    asked = {"runs": {str(run.folder.resolve()): run.manifest.get("config_hash")}, "cycle": analysis.own.place.calm}
    with replacing(folder, OUT_KEY, REPORT) as place:
        renderer = Renderer(place.new)
        sections = render_markdown(
            Path(__file__).with_name("page.md"),
            "Does learning hold",
            renderer,
            {name: partial(draw, analysis) for name, draw in FIGURES.items()},
            {name: partial(tabulate, analysis) for name, tabulate in TABLES.items()},
            _values(analysis),
        )
        inputs = [run.folder / TRACE, *renderer.files]
        return write_report(Report(title, verdict(analysis), sections, inputs, asked), place)
