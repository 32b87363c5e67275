"""Figures of the comparison of force control methods."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.style import DASHES, DESIRED, MARKERS, SERIES, label, new_figure
from pipelines.shared.runs import Runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 2.0
"""Seconds after the release that are shown."""
MOST_FORCE, MOST_DEPTH = 3.2, 0.8


def force_methods(runs: Runs, methods: Sequence[str], desired: float, soft: float, hard: float) -> "Figure":
    """Contact force over time, a column for each method, on soft and on hard ground."""
    figure, axes = new_figure(2, len(methods), 1.7, sharex=True, sharey=True)
    cells = [(kind, stiffness, method) for kind, stiffness in (("soft", soft), ("hard", hard)) for method in methods]
    for axis, (kind, stiffness, method) in zip(axes, cells, strict=True):
        run = runs[f"{kind} {method}"]
        trace = run.trace[run.trace["time"] <= SHOWN]
        axis.axhline(desired, color=DESIRED, lw=1.0)
        axis.plot(trace["time"], trace["force"], color=SERIES[1], lw=0.9)
        if run.status != "completed":
            axis.plot(trace["time"].iloc[-1], MOST_FORCE, "x", color=SERIES[0], clip_on=False, ms=7, mew=2.0)
            axis.annotate(run.status, (0.2, 2.7), color=SERIES[0])
        axis.set(ylim=(0.0, MOST_FORCE), xlim=(0.0, SHOWN))
        if kind == "soft":
            axis.set_title(method)
        if method == methods[0]:
            axis.set_ylabel(f"{kind} ground,\n{stiffness:g} N/m\nforce, N")
    figure.supxlabel("time since the release, s", fontsize=8.5)
    return figure


def free_space(runs: Runs, methods: Sequence[str]) -> "Figure":
    """Depth below the start without ground."""
    figure, (axis,) = new_figure(1, 1, 2.6)
    for method, colour, dash in zip(methods, SERIES, DASHES, strict=False):
        trace = runs[f"free {method}"].trace
        trace = trace[trace["time"] <= SHOWN]
        axis.plot(trace["time"], trace["y"] - trace["y"].iloc[0], color=colour, ls=dash, label=method)
    axis.set_ylim(MOST_DEPTH, -0.02)
    axis.set_xlim(0.0, SHOWN)
    label(axis, "no ground", "time since the release, s", "depth below the start, m")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside right upper")
    return figure


def wrong_stiffness(
    measured: Mapping[str, tuple[Sequence[float], np.ndarray, np.ndarray]],
    predicted: Mapping[str, Callable[[float], float]],
) -> "Figure":
    """Settled over desired force against true over assumed stiffness."""
    figure, (axis,) = new_figure(1, 1, 3.0)
    for (method, (factors, force, steady)), colour, dash, marker in zip(
        measured.items(), SERIES, DASHES, MARKERS, strict=False
    ):
        fine = np.geomspace(min(factors), max(factors), 60)
        axis.plot(fine, [predicted[method](f) for f in fine], color=colour, ls=dash)
        axis.plot([], [], color=colour, ls=dash, marker=marker, label=method)
        for factor, value, rests in zip(factors, force, steady, strict=True):
            face = colour if rests else "none"
            axis.plot(factor, value, marker, color=colour, mfc=face, ms=9 if method == "damping" else 6, ls="none")
    axis.set_xscale("log", base=2)
    axis.set_xticks(list(factors), [f"{f:g}" for f in factors])
    label(axis, "force on ground of another stiffness", "true over assumed stiffness", "settled over desired force")
    figure.legend(*axis.get_legend_handles_labels(), loc="outside right upper")
    return figure


def apparent_stiffness(found: Mapping[float, float], gain: float) -> "Figure":
    """Apparent stiffness against elasticity, measured and after eq. 8."""
    figure, (axis,) = new_figure(1, 1, 2.4)
    fine = np.linspace(0.0, max(found), 200)
    axis.plot(1e3 * fine, gain / (1.0 + gain * fine), color=SERIES[1], label="K_a / (1 + K_a P_fn)")
    axis.plot(1e3 * np.array(list(found)), list(found.values()), "o", color=SERIES[0], label="measured")
    axis.set_yscale("log")
    label(axis, "stiffness control as a spring", "elasticity P_fn, mm/N", "apparent stiffness, N/m")
    axis.legend()
    return figure
