"""Figures of the stability of a run."""

from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.figure_data import SUPPORT, legend_above, legend_below, logarithmic, mark
from cmacexp.report.style import DESIRED, MARKERS, SERIES, label, new_figure, new_grid
from cmacexp.stability.analysis import DELAYS, LEADS, Analysis
from cmacexp.stability.mode import spectrum
from cmacexp.stability.transfer import Spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = 80
"""Samples of the growing change that are shown."""
DEEPEST = -0.6
"""Real parts below this are cut off."""


def format_lead(lead: int) -> str:
    """E.g. ``lead 1``."""
    return f"lead {lead}"


def growth(analysis: Analysis) -> "Figure":
    """Change of the feedback from cycle to cycle, measured and predicted; growth of every lead."""
    own, place = analysis.own, analysis.own.place
    assert own.growth is not None
    figure, (left, right) = new_figure(1, 2, 3.0)
    left.plot(np.arange(1, len(own.sizes) + 1), own.sizes, color=SERIES[1], label="measured")
    last = min(place.last + (place.last - place.first) // 2, len(own.sizes))
    predicted = own.growth.sizes(max(last - place.calm, 2))
    left.plot(place.calm + 1 + np.arange(len(predicted)), predicted, "--", color=SERIES[0], label="predicted")
    logarithmic(left, "y", own.sizes)
    left.axvspan(place.first, place.last, color=SUPPORT, zorder=0, linewidth=0)
    label(left, "change of U to the next cycle", "cycle", "root of summed squares, N m")
    legend_above(left)
    known = [each for each in analysis.leads if each.growth is not None]
    numbers = [str(each.lead) for each in known]
    right.axhline(1.0, color=DESIRED, linewidth=1.0)
    right.plot(numbers, [each.measured for each in known], "s", ms=8, mfc="none", color=SERIES[1], label="measured")
    right.plot(numbers, [each.predicted for each in known], "o", ms=4, color=SERIES[0], label="predicted")
    label(right, "growth per cycle", "learning.lead, samples", "factor from cycle to cycle")
    legend_above(right)
    return figure


def _torques(axes: "Axes", analysis: Analysis, leg: int) -> None:
    clock = analysis.config.sampling_period * np.arange(len(analysis.measured_mode.change))
    for index, joint in enumerate(("hip", "knee")):
        measured, predicted = analysis.measured_mode.change, analysis.predicted_mode.change
        scale = np.abs(measured).max()
        axes.plot(clock, measured[:, leg, index] / scale, color=SERIES[1 + index], label=f"{joint}, measured")
        axes.plot(
            clock, predicted[:, leg, index] / np.abs(predicted).max(), ":", color="black", lw=1.0, label="predicted"
        )


def mode(analysis: Analysis) -> "Figure":
    """The growing change of the feedforward over the cycle, and its spectrum."""
    figure, (left, right) = new_figure(1, 2, 2.8)
    change, period = analysis.measured_mode.change, analysis.config.sampling_period
    leg = int(np.argmax((change**2).sum(axis=(0, 2))))
    _torques(left, analysis, leg)
    begin = max(0, int(np.argmax((change[:, leg] ** 2).sum(axis=1))) - SHOWN // 4) * period
    left.set_xlim(begin, begin + SHOWN * period)
    whose = f" of leg {leg + 1}" if change.shape[1] > 1 else ""
    label(left, f"change of the feedforward{whose}", "time in the cycle, s", "of its largest")
    legend_below(figure, left, 4)
    for index, (name, shape) in enumerate((("measured", change), ("predicted", analysis.predicted_mode.change))):
        hertz, power = spectrum(shape, period)
        colour, line = ("black", ":") if index else (SERIES[1], "-")
        right.plot(hertz, power / power.max(), color=colour, linestyle=line, label=name)
    label(right, "its spectrum", "frequency, Hz", "power, of its largest")
    return figure


def eigenvalues(analysis: Analysis) -> "Figure":
    """Leading eigenvalues of the map from cycle to cycle for every lead."""
    known = [each for each in analysis.leads if each.growth is not None]
    figure, axes = new_grid(len(known), min(3, len(known)), 2.3, sharex=True, sharey=True)
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    for index, (ax, each) in enumerate(zip(axes, known, strict=True)):
        assert each.growth is not None
        values = each.growth.eigenvalues()
        outside = np.abs(values) > 1.0
        ax.plot(np.cos(angle), np.sin(angle), color=DESIRED, linewidth=1.0)
        ax.plot(values[~outside].real, values[~outside].imag, "o", ms=3, mfc="none", color=SERIES[1])
        ax.plot(values[outside].real, values[outside].imag, MARKERS[1], ms=3.5, color=SERIES[0])
        ax.set_aspect("equal")
        first = index % 3 == 0
        label(
            ax, f"{format_lead(each.lead)}: {outside.sum()} outside", "real part", "imaginary part" if first else ""
        )
    return figure


def _real_parts(axes: "Axes", each: Spectrum) -> None:
    axes.axhline(0.0, color=DESIRED, linewidth=1.0)
    for index, lead in enumerate(LEADS):
        axes.plot(each.frequencies, each.least_real(lead), label=format_lead(lead), **mark(index))
    axes.set_ylim(DEEPEST, 1.3)


def real_parts(analysis: Analysis) -> "Figure":
    """Re T over frequency for each lead, at a few places of the cycle."""
    figure, axes = new_figure(1, len(analysis.places), 2.8, sharey=True)
    for ax, (name, spectra) in zip(axes, analysis.places.items(), strict=True):
        _real_parts(ax, spectra[0])
        label(ax, name, "frequency, Hz", "Re T, least eigenvalue" if ax is axes[0] else "")
    legend_below(figure, axes[0])
    return figure


def choose_delayed(analysis: Analysis) -> str:
    """The place where further delays are tried: mid transfer, if there is one."""
    return list(analysis.places)[min(1, len(analysis.places) - 1)]


def delays(analysis: Analysis) -> "Figure":
    """Re T in mid transfer if torques reached the joints later."""
    figure, axes = new_figure(1, len(DELAYS), 2.8, sharey=True)
    spectra = analysis.places[choose_delayed(analysis)]
    for ax, delay, each in zip(axes, DELAYS, spectra, strict=True):
        _real_parts(ax, each)
        title = f"{delay} more samples" if delay != 1 else "1 more sample"
        label(ax, title, "frequency, Hz", "Re T, least eigenvalue" if ax is axes[0] else "")
    legend_below(figure, axes[0])
    return figure


def along(analysis: Analysis) -> "Figure":
    """The least Re T over all frequencies, over the cycle."""
    figure, (axes,) = new_figure(1, 1, 2.6)
    clock = [sample * analysis.config.sampling_period for sample in analysis.along]
    axes.axhline(0.0, color=DESIRED, linewidth=1.0)
    for index, lead in enumerate(LEADS):
        least = [each.least(lead) for each in analysis.along.values()]
        axes.plot(clock, least, label=format_lead(lead), marker=MARKERS[index], ms=3, **mark(index))
    axes.set_ylim(2 * DEEPEST, 0.4)
    label(axes, "least Re T of all frequencies", "time in the cycle, s", "Re T")
    legend_below(figure, axes)
    return figure
