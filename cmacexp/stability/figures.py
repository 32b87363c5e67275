"""Figures of the stability of a run."""

from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.style import SERIES
from cmacexp.stability import mode as modes
from cmacexp.stability.analysis import Analysis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 80
"""Samples of the growing change that are shown."""
MIN_SHOWN_REAL = -0.6
"""Real parts below this are cut off."""
PREDICTED: dict[str, Any] = {"color": "black", "linestyle": ":", "linewidth": 1.0}


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
    for index, joint in enumerate(("hip", "knee", "third joint")[: measured.shape[2]]):
        solid = {"color": SERIES[1 + index], "linestyle": "-"}
        change.append(Series(f"{joint}, measured", clock, _relative(measured[:, leg], index), style=solid))
        change.append(Series("predicted", clock, _relative(predicted[:, leg], index), style=PREDICTED))
    begin = max(0, int(np.argmax((measured[:, leg] ** 2).sum(axis=1))) - SHOWN // 4) * period
    whose = f" of leg {leg + 1}" if measured.shape[1] > 1 else ""
    (hertz, power), (_, of_predicted) = modes.spectrum(measured, period), modes.spectrum(predicted, period)
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


def real_parts(analysis: Analysis) -> "Figure":
    """Re T over frequency for each lead, at a few places of the cycle."""
    panels = []
    for name, spectrum in analysis.places.items():
        series = [Series(f"lead {lead}", spectrum.frequencies, spectrum.least_real(lead)) for lead in analysis.tried]
        panels.append(
            Panel(
                name, "frequency, Hz", "Re T, least eigenvalue", series, y_limits=[0.0], y_range=(MIN_SHOWN_REAL, 1.3)
            )
        )
    return draw(panels, len(panels), 2.8, share="xy")
