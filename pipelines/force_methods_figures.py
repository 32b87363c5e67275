"""Figures of the comparison of force control methods."""

from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study import Results
from pipelines.force_methods_measures import predicted_forces, springs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN, MOST_FORCE, MOST_DEPTH = 2.0, 4.0, 0.8
"""What is drawn at the most: seconds, N, m."""


def draw_forces(results: Results) -> "Figure":
    """Contact force after the release, a panel for each method."""
    panels = []
    for method, own in results.by("method").items():
        series = []
        for ground, group in own.by("ground").items():
            trace = group.run.trace
            trace = trace[(trace["time"] <= SHOWN) & (trace["force"] <= MOST_FORCE)]
            series.append(Series(f"ground {ground}", trace["time"].to_numpy(), trace["force"].to_numpy()))
        desired = float(own.value("force_control.desired_force"))
        panels.append(Panel(str(method), "time since the release, s", "force, N", series, y_limits=[desired]))
    return draw(panels, height=2.0)


def draw_free(results: Results) -> "Figure":
    """Depth below the start without ground."""
    series = []
    for method, own in results.by("method").items():
        trace = own.run.trace
        depth = trace["y"] - trace["y"].iloc[0]
        shown = (trace["time"] <= SHOWN) & (depth <= MOST_DEPTH)
        series.append(Series(str(method), trace["time"][shown].to_numpy(), depth[shown].to_numpy()))
    return draw([Panel("no ground", "time since the release, s", "depth below the start, m", series)], columns=1)


def draw_mismatch(results: Results, assumed: float) -> "Figure":
    """Settled over desired force against true over assumed stiffness, measured and predicted."""
    panels = []
    for title, value in (("measured", lambda r: r.measure("settled_force")), ("eq. 8 to 15", predicted_forces)):
        series = []
        for method, own in results.by("method").items():
            x = np.array(results.values("terrain.stiffness")) / assumed
            series.append(Series(str(method), x, value(own)))
        panels.append(Panel(title, "true over assumed stiffness", "settled over desired force", series, log="x"))
    return draw(panels)


def draw_spring(results: Results) -> "Figure":
    """Apparent stiffness against elasticity."""
    x = 1e3 * np.sort(np.array(results.values("force_control.elasticity"), dtype=float))
    series = [Series(name, x, y) for name, y in zip(("measured", "eq. 8"), springs(results), strict=True)]
    return draw(
        [Panel("stiffness control", "elasticity, mm/N", "apparent stiffness, N/m", series, log="y")], columns=1
    )
