"""The stability of a run as a page, and as a table in the terminal."""

import math

from cmacexp.data.tables import TRACE
from cmacexp.report.page import Report, Section, Table, Text
from cmacexp.stability import figures
from cmacexp.stability.analysis import DELAYS, LEADS, Analysis, LeadGrowth
from cmacexp.stability.mode import AFTER_LIFT_OFF, Mode, likeness

TITLES = ("lead", "predicted growth", "measured growth", "over cycles", "largest eigenvalue", "least Re T", "ends")
HOLDS = 1.0
"""Growth per cycle below which learning holds."""


def _number(value: float, digits: int = 4) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def _format_end(each: LeadGrowth) -> str:
    return f"runs {len(each.sizes) + 1} cycles" if each.completed else f"stops in cycle {len(each.sizes) + 2}"


def rows(analysis: Analysis) -> list[list[str]]:
    """One row per lead, under :data:`TITLES`."""
    table = []
    for each in analysis.leads:
        place = f"{each.place.first}-{each.place.last}" if each.growth is not None else each.why_not
        own = " (this run)" if each is analysis.own else ""
        growth = [_number(each.predicted), _number(each.measured), place]
        reasons = [_number(each.eigenvalue), _number(analysis.least_real(each.lead), 3)]
        table.append([f"{each.lead}{own}", *growth, *reasons, _format_end(each)])
    return table


def verdict(analysis: Analysis) -> str:
    """The conclusion for the run, in a sentence or two."""
    own = analysis.own
    grows = own.predicted > HOLDS
    change = "grows" if grows else "shrinks"
    text = (
        f"With lead {own.lead} the change of the feedback from cycle to cycle {change} by a factor of "
        f"{_number(own.predicted)} per cycle, predicted after cycle {own.place.calm}; measured over cycles "
        f"{own.place.first} to {own.place.last}: {_number(own.measured)}."
    )
    held = [str(each.lead) for each in analysis.leads if each.predicted < HOLDS]
    if grows:
        text += f" Learning holds with lead {' or '.join(held)}." if held else " No lead that was tried holds."
    return text


def _where(analysis: Analysis) -> Table:
    def row(name: str, mode: Mode, clock: float) -> list[str]:
        share = "-" if math.isnan(mode.share_after_lift_off) else f"{mode.share_after_lift_off:.1%}"
        return [name, share, f"{mode.frequency:.0f}", f"{mode.busiest * clock:.3f}"]

    period = analysis.config.sampling_period
    titles = ["change of the feedforward", f"share in the {AFTER_LIFT_OFF} steps after lift-off"]
    body = [row("measured", analysis.measured_mode, period), row("predicted", analysis.predicted_mode, period)]
    alike = likeness(analysis.measured_mode.change, analysis.predicted_mode.change)
    caption = f"From cycle {analysis.own.place.last} to the next; cosine between the two {alike:.4f}."
    return Table([*titles, "frequency at its peak, Hz", "largest at, s"], body, caption)


def _reasons(analysis: Analysis) -> Table:
    cells = []
    for name, spectra in analysis.places.items():
        values = [spectra[0].wrong_from(lead) for lead in LEADS]
        cells.append([name, *("nowhere" if math.isnan(value) else f"{value:.0f}" for value in values)])
    titles = ["place in the cycle", *(f"lead {lead}" for lead in LEADS)]
    return Table(titles, cells, "Lowest frequency at which Re T is negative, Hz.")


def _delays(analysis: Analysis) -> Table:
    cells = [[str(delay), *(f"{analysis.least_real(lead, delay):+.3f}" for lead in LEADS)] for delay in DELAYS]
    titles = ["further samples of delay", *(f"lead {lead}" for lead in LEADS)]
    return Table(
        titles, cells, "Least Re T over all frequencies and the places above; where it is negative learning grows."
    )


HOW = (
    "A cycle of the run is a map from the state at its start (weights in use, plant, controller) to the state "
    "at its end. The map is the run's own compiled loop, so it includes every built-in learning rule, sensor "
    "and actuator. The run is repeated up to the cycle whose feedback changed least, and differentiated there "
    "by central differences. Repeated from the change that the run made in that cycle, the map predicts the "
    "changes of the cycles that follow. The map is far from normal: a growing change moves through the cycle, and "
    "over a hundred cycles it grows faster than the largest eigenvalue. The growth is therefore that of the "
    "repeated map, over the same cycles as it is measured. Other leads are run in memory, each linearised at "
    "its own calmest cycle. A rule that only bounds large values (e_modification, dead_zone), or whose rate "
    "decays, is linearised as it acts in that cycle."
)


def report(analysis: Analysis) -> Report:
    """The page of an analysis."""
    run = analysis.run
    table = Table(
        list(TITLES), rows(analysis), "Growth per cycle of the change of U; least Re T over the places below."
    )
    sections = [
        Section("Does learning hold", [table, figures.growth(analysis), Text(HOW)]),
        Section("What grows", [_where(analysis), figures.mode(analysis)]),
        Section("Why", [figures.real_parts(analysis), _reasons(analysis), figures.along(analysis)]),
        Section("If torques came later", [figures.delays(analysis), _delays(analysis)]),
        Section("Eigenvalues", [figures.eigenvalues(analysis)]),
    ]
    title = f"Stability of learning: {analysis.config.scenario}, {run.folder.resolve().name}"
    asked = {"runs": {str(run.folder.resolve()): run.manifest.get("config_hash")}, "cycle": analysis.own.place.calm}
    return Report(title, verdict(analysis), sections, [run.folder / TRACE], asked)
