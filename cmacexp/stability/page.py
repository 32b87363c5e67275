"""The stability of a run as a page, and as a table in the terminal."""

import math

from cmacexp.data.tables import TRACE
from cmacexp.report.page import Report, Section, Table, Text
from cmacexp.stability import figures
from cmacexp.stability.analysis import DELAYS, LEADS, Analysis, OfLead
from cmacexp.stability.mode import AFTER_LIFT_OFF, Mode, likeness

TITLES = ("lead", "predicted growth", "measured growth", "over cycles", "largest eigenvalue", "least Re T", "ends")
HOLDS = 1.0
"""Growth per cycle below which learning holds."""


def _number(value: float, digits: int = 4) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def _ends(of: OfLead) -> str:
    return f"runs {len(of.sizes) + 1} cycles" if of.completed else f"stops in cycle {len(of.sizes) + 2}"


def rows(found: Analysis) -> list[list[str]]:
    """One row per lead, under :data:`TITLES`."""
    told = []
    for of in found.leads:
        place = f"{of.place.first}-{of.place.last}" if of.growth is not None else of.why_not
        own = " (this run)" if of is found.own else ""
        numbers = [
            _number(of.predicted),
            _number(of.measured),
            place,
            _number(of.eigenvalue),
            _number(found.least_real(of.lead), 3),
        ]
        told.append([f"{of.lead}{own}", *numbers, _ends(of)])
    return told


def verdict(found: Analysis) -> str:
    """What follows for the run, in a sentence or two."""
    own = found.own
    grows = own.predicted > HOLDS
    what = "grows" if grows else "shrinks"
    text = (
        f"With lead {own.lead} the change of the feedback from cycle to cycle {what} by a factor of "
        f"{_number(own.predicted)} per cycle, predicted after cycle {own.place.calm}; measured over cycles "
        f"{own.place.first} to {own.place.last}: {_number(own.measured)}."
    )
    held = [str(of.lead) for of in found.leads if of.predicted < HOLDS]
    if grows:
        text += f" Learning holds with lead {' or '.join(held)}." if held else " No lead that was tried holds."
    return text


def _where(found: Analysis) -> Table:
    def row(name: str, mode: Mode, clock: float) -> list[str]:
        share = "-" if math.isnan(mode.share_after_lift_off) else f"{mode.share_after_lift_off:.1%}"
        return [name, share, f"{mode.frequency:.0f}", f"{mode.busiest * clock:.3f}"]

    period = found.config.sampling_period
    titles = ["change of the feedforward", f"share in the {AFTER_LIFT_OFF} steps after lift-off"]
    body = [row("measured", found.measured_mode, period), row("predicted", found.predicted_mode, period)]
    alike = likeness(found.measured_mode.change, found.predicted_mode.change)
    caption = f"From cycle {found.own.place.last} to the next; cosine between the two {alike:.4f}."
    return Table([*titles, "frequency at its peak, Hz", "largest at, s"], body, caption)


def _reasons(found: Analysis) -> Table:
    told = []
    for name, spectra in found.places.items():
        values = [spectra[0].wrong_from(lead) for lead in LEADS]
        told.append([name, *("nowhere" if math.isnan(value) else f"{value:.0f}" for value in values)])
    titles = ["place in the cycle", *(f"lead {lead}" for lead in LEADS)]
    return Table(titles, told, "Lowest frequency at which Re T is negative, Hz.")


def _delays(found: Analysis) -> Table:
    told = [[str(delay), *(f"{found.least_real(lead, delay):+.3f}" for lead in LEADS)] for delay in DELAYS]
    titles = ["further samples of delay", *(f"lead {lead}" for lead in LEADS)]
    return Table(
        titles, told, "Least Re T over all frequencies and the places above; where it is negative learning grows."
    )


HOW = (
    "A cycle of the run is a map from the state at its start (weights in use, plant, controller) to the state "
    "at its end. The map is the run's own compiled loop, so it includes every built-in learning rule, sensor "
    "and actuator. The run is repeated up to the cycle whose feedback changed least, and differentiated there "
    "by central differences. Repeated from the change that the run made in that cycle, the map predicts the "
    "changes of the cycles that follow. The map is far from normal: what grows moves through the cycle, and "
    "over a hundred cycles it grows faster than the largest eigenvalue. The growth is therefore that of the "
    "repeated map, over the same cycles as it is measured. Other leads are run in memory, each linearised at "
    "its own calmest cycle. A rule that only bounds large values (e_modification, dead_zone), or whose rate "
    "decays, is linearised as it acts in that cycle."
)


def report(found: Analysis) -> Report:
    """The page of an analysis."""
    run = found.run
    table = Table(list(TITLES), rows(found), "Growth per cycle of the change of U; least Re T over the places below.")
    sections = [
        Section("Does learning hold", [table, figures.growth(found), Text(HOW)]),
        Section("What grows", [_where(found), figures.mode(found)]),
        Section("Why", [figures.real_parts(found), _reasons(found), figures.along(found)]),
        Section("If torques came later", [figures.delays(found), _delays(found)]),
        Section("Eigenvalues", [figures.eigenvalues(found)]),
    ]
    title = f"Stability of learning: {found.config.scenario}, {run.folder.resolve().name}"
    asked = {"runs": {str(run.folder.resolve()): run.manifest.get("config_hash")}, "cycle": found.own.place.calm}
    return Report(title, verdict(found), sections, [run.folder / TRACE], asked)
