"""Figures of the stability of a run."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.style import SERIES
from cmacexp.stability.analysis import LEADS, Analysis
from cmacexp.stability.mode import spectrum

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 80
"""Samples of the growing change that are shown."""
DEEPEST = -0.6
"""Real parts below this are cut off."""
PREDICTED: dict[str, Any] = {"color": "black", "linestyle": ":", "linewidth": 1.0}


def format_lead(lead: int) -> str:
    """E.g. ``lead 1``."""
    return f"lead {lead}"


def growth(analysis: Analysis) -> "Figure":
    """Change of the feedback from cycle to cycle, measured and predicted; growth of every lead."""
    own, place = analysis.own, analysis.own.place
    assert own.growth is not None
    last = min(place.last + (place.last - place.first) // 2, len(own.sizes))
    predicted = own.growth.sizes(max(last - place.calm, 2))
    change = [
        Series("measured", np.arange(1, len(own.sizes) + 1), own.sizes),
        Series("predicted", place.calm + 1 + np.arange(len(predicted)), predicted),
    ]
    known = [each for each in analysis.leads if each.growth is not None]
    places, leads = np.arange(len(known)), [str(each.lead) for each in known]
    factors = [
        Series("measured", places, [each.measured for each in known], style={"ms": 8, "mfc": "none"}),
        Series("predicted", places, [each.predicted for each in known]),
    ]
    panels = [
        Panel(
            "change of U to the next cycle", "cycle", "root of summed squares, N m", change, log="y",
            shaded=[(place.first, place.last)],
        ),
        Panel(
            "growth per cycle", "learning.lead, samples", "factor from cycle to cycle", factors, "scatter",
            ticks=leads, y_limits=[1.0], from_zero=False,
        ),
    ]  # fmt: skip
    return draw(panels, height=3.0)


def mode(analysis: Analysis) -> "Figure":
    """The growing change of the feedforward over the cycle, and its spectrum."""
    measured, predicted = analysis.measured_mode.change, analysis.predicted_mode.change
    period = analysis.config.sampling_period
    leg = int(np.argmax((measured**2).sum(axis=(0, 2))))
    clock, change = period * np.arange(len(measured)), []
    for index, joint in enumerate(("hip", "knee")):
        solid = {"color": SERIES[1 + index], "linestyle": "-"}
        change.append(Series(f"{joint}, measured", clock, _relative(measured[:, leg], index), style=solid))
        change.append(Series("predicted", clock, _relative(predicted[:, leg], index), style=PREDICTED))
    begin = max(0, int(np.argmax((measured[:, leg] ** 2).sum(axis=1))) - SHOWN // 4) * period
    whose = f" of leg {leg + 1}" if measured.shape[1] > 1 else ""
    (hertz, power), (_, of_predicted) = spectrum(measured, period), spectrum(predicted, period)
    spectra = [
        Series("measured", hertz, power / power.max()),
        Series("predicted", hertz, of_predicted / of_predicted.max(), style=PREDICTED),
    ]
    panels = [
        Panel(
            f"change of the feedforward{whose}", "time in the cycle, s", "of its largest", change,
            x_range=(begin, begin + SHOWN * period),
        ),
        Panel("its spectrum", "frequency, Hz", "power, of its largest", spectra),
    ]  # fmt: skip
    return draw(panels, height=2.8, legend="panel")


def _relative(change: Any, joint: int) -> Any:
    """The change of one joint over the largest of all joints, over the cycle."""
    return change[:, joint] / np.abs(change).max()


def eigenvalues(analysis: Analysis) -> "Figure":
    """Leading eigenvalues of the map from cycle to cycle for every lead."""
    angle, panels = np.linspace(0.0, 2.0 * np.pi, 200), []
    circle = Series(
        "unit circle", np.cos(angle), np.sin(angle), style={"color": "#828282", "linestyle": "-", "lw": 1.0}
    )
    points = {"linestyle": "none"}
    for each in analysis.leads:
        if each.growth is None:
            continue
        values = each.growth.eigenvalues()
        outside = np.abs(values) > 1.0
        series = [
            circle,
            Series("inside", values[~outside].real, values[~outside].imag, style=points | {"mfc": "none"}),
            Series("outside", values[outside].real, values[outside].imag, style=points),
        ]
        title = f"{format_lead(each.lead)}: {outside.sum()} outside"
        panels.append(Panel(title, "real part", "imaginary part", series, equal=True))
    return draw(panels, 3, 2.3, share="xy")


def _by_lead(x: Any, values: Callable[[int], Any]) -> list[Series]:
    return [Series(format_lead(lead), x, values(lead)) for lead in LEADS]


def real_parts(analysis: Analysis) -> "Figure":
    """Re T over frequency for each lead, at a few places of the cycle."""
    panels = [
        Panel(
            name, "frequency, Hz", "Re T, least eigenvalue", _by_lead(spectra[0].frequencies, spectra[0].least_real),
            y_limits=[0.0], y_range=(DEEPEST, 1.3),
        )
        for name, spectra in analysis.places.items()
    ]  # fmt: skip
    return draw(panels, len(panels), 2.8, share="xy")


def along(analysis: Analysis) -> "Figure":
    """The least Re T over all frequencies, over the cycle."""
    clock = [sample * analysis.config.sampling_period for sample in analysis.along]
    series = _by_lead(clock, lambda lead: [each.least(lead) for each in analysis.along.values()])
    panel = Panel("least Re T of all frequencies", "time in the cycle, s", "Re T", series, y_limits=[0.0],
                  y_range=(2 * DEEPEST, 0.4))  # fmt: skip
    return draw([panel], height=2.6)
