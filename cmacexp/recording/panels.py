"""The panels that show a run."""

from collections.abc import Mapping

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from cmacexp.recording.axes import Range
from cmacexp.recording.events import EVENTS
from cmacexp.recording.ground import FORCE_LENGTH
from cmacexp.recording.run_view import RunView
from cmacexp.recording.scene import EYES, FIGURE, LOWEST_NUMBER, MESHES, MM, eye_path, find_trunk
from cmacexp.recording.series import SERIES, collect_series, component
from cmacexp.typing import Array

Panel = rrb.Container | rrb.View
SPACE = ("scene", "sides")
"""Panels that show the machine itself."""
SHARES = {
    **{"scene": 3.0, "sides": 1.6, "gait": 1.2, "force": 2.1},
    **{"posture": 2.2, "margins": 1.0, "error": 2.1, "torque": 4.2, "events": 1.7},
}
BACKGROUND = [245, 245, 245]
BORDER = 60.0
"""Seen around the machine from its sides, mm."""


class Panels:
    """Makes the panels of one run; ``ranges`` are those of vertical axes by plot, ``times`` first and last, s.

    Of one ``cycle`` the plots are of its times, and so named.
    """

    def __init__(self, view: RunView, ranges: Mapping[str, Range], times: Range, cycle: int | None = None):
        self._view = view
        self._lines = collect_series(view)
        self._ranges = ranges
        self._times = times if cycle is None else view.time[view.cycle == cycle][[0, -1]]
        self._cycle = "" if cycle is None else f", cycle {cycle}"
        self._now = float(view.config["gait"]["cycle_time"]) if view.walks and cycle is None else None

    def make(self, name: str) -> Panel:
        """The panel of that name."""
        panel: Panel = getattr(self, name)()
        return panel

    def _parallel(self, eye: str, name: str, without: tuple[str, ...] = ()) -> rrb.Spatial2DView:
        """The machine as one of :data:`EYES` sees it, of everything but the entities ``without``; mm."""
        world, meshes = f"/{self._view.root}world", (MESHES,) if self._view.meshes else ()
        seen = self._seen() @ np.array(EYES[eye][:2]).T * MM
        low, high = seen.min(axis=0) - BORDER, seen.max(axis=0) + BORDER
        return rrb.Spatial2DView(
            origin=f"/{self._view.root}{eye_path(eye)}",
            contents=[f"+ {world}/**", *(f"- {world}/{path}/**" for path in ("travel/eyes", *without, *meshes))],
            name=name,
            background=BACKGROUND,
            visual_bounds=rrb.VisualBounds2D(x_range=(low[0], high[0]), y_range=(low[1], high[1])),
        )

    def _seen(self) -> Array:
        """Two corners of what the machine takes up, in the frame that moves with it, m."""
        view = self._view
        up = np.array([0.0, 0.0, float(view.body["height"].mean()) + view.foot_radius])
        points = np.concatenate([joint for leg in view.legs for joint in leg.joints()]) + up
        if view.is_robot:
            middle, half = find_trunk(view)
            points = np.concatenate([points, [middle + half + up]])
        lowest = points.min(axis=0) - [0.0, 0.0, -LOWEST_NUMBER if view.walks else 0.0]
        return np.array([lowest, np.maximum(points.max(axis=0), [0.0, 0.0, FORCE_LENGTH])])

    def plot(self, path: str, name: str, around: float | None = None) -> rrb.TimeSeriesView:
        """A plot of all times, or of those from 1.6 to 0.2 times ``around`` seconds about now."""
        entity = f"/{self._view.root}{SERIES}"
        names, _, colours = zip(*self._lines[path], strict=True)
        style = rr.SeriesLines(names=list(names), colors=list(colours), widths=[1.5] * len(names))
        drawn = VisualizerComponentMapping(
            "Scalars:scalars", ComponentSourceKind.SourceComponent, source_component=component(path)
        )
        shown, drawn_times = self._time_axis(around)
        return rrb.TimeSeriesView(
            origin=entity,
            contents=[f"+ {entity}"],
            name=name + self._cycle,
            overrides={entity: style.visualizer(mappings=[drawn])},
            axis_y=rrb.ScalarAxis(range=self._ranges.get(path)),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=path.startswith(("leg_1/", "body/"))),
            axis_x=shown,
            time_ranges=drawn_times,
        )

    def _time_axis(self, around: float | None) -> tuple[rrb.TimeAxis, list[rrb.VisibleTimeRange]]:
        """The time axis of a plot, and which times it draws: lines end before the right edge, where the legend is."""
        if around:
            start, until, end = (rrb.TimeRangeBoundary.cursor_relative(seconds=n * around) for n in (-1.6, 0.2, 1.0))
        else:
            first, last = self._times
            times = first, last, last + 0.3 * (last - first)
            start, until, end = (rrb.TimeRangeBoundary.absolute(seconds=time) for time in times)
        drawn = rrb.VisibleTimeRange("time", start=start, end=until)
        return rrb.TimeAxis(view_range=rrb.TimeRange(start, end)), [drawn]

    def scene(self) -> Panel:
        """A walk in space, where the eye goes along with it; one leg, which moves in a plane, from its right side."""
        if not self._view.walks:
            return self._parallel("right side", self._view.label)
        world, size, figure = f"/{self._view.root}world", self._size(), FIGURE if self._view.meshes else ()
        eye, target = (0.85 * size, -1.0 * size, 0.65 * size), (0.0, 0.0, 0.22 * size)
        return rrb.Spatial3DView(
            origin=f"{world}/travel",
            contents=[f"+ {world}/**", *(f"- {world}/{path}/**" for path in ("travel/eyes", *figure))],
            name=self._view.label,
            background=BACKGROUND,
            line_grid=rrb.LineGrid3D(spacing=0.1, color=[190, 190, 190]),
            eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0)),
        )

    def _size(self) -> float:
        """Length and height of a robot over those of the paper's quadruped, for which the eye is placed."""
        view = self._view
        if not view.is_robot:
            return 1.0
        return float(2.0 * find_trunk(view)[1][0] + view.body["height"].mean()) / 0.95

    def sides(self) -> Panel:
        """A walk from front, side and top."""
        paths = "travel/body/path"
        return rrb.Horizontal(
            self._parallel("front", "from the front", (paths,)),
            self._parallel("right side", "from the right", (paths,)),
            self._parallel("top", "from above", (paths, "travel/body/plate")),
        )

    def gait(self) -> Panel:
        """Which foot supports when (Lin & Song 1997, Fig. 14)."""
        legs = self._view.legs
        return rrb.TimeSeriesView(
            origin=f"/{self._view.root}gait",
            name="support of " + ", ".join(f"{leg.number} {leg.name}" for leg in legs),
            axis_y=rrb.ScalarAxis(range=(0.4, len(legs) + 0.6)),
            plot_legend=rrb.PlotLegend(visible=False),
            axis_x=self._time_axis(self._now)[0],
        )

    def force(self) -> Panel:
        """Contact forces."""
        if not self._view.walks:
            return self.plot("leg_1/force", "contact force, N")
        plots = [
            self.plot(f"leg_{leg.number}/force", f"{leg.number} {leg.name}: force, N", self._now)
            for leg in self._view.legs
        ]
        return rrb.Grid(*plots, grid_columns=1 if self._cycle else 2)

    def posture(self) -> Panel:
        """Tilt and height of the body."""
        tilt = self.plot("body/tilt", "tilt of the body, mrad")
        return rrb.Vertical(tilt, self.plot("body/height", "height of the body, mm"))

    def margins(self) -> Panel:
        """Stability margins: the planned one, and those of the feet that carry load."""
        return self.plot("body/margins", "stability margins, planned and true, mm", self._now)

    def error(self) -> Panel:
        """Tracking error of the only foot."""
        return self.plot("leg_1/error", "foot, actual minus desired, mm")

    def torques(self, number: int, before: str = "") -> list[rrb.TimeSeriesView]:
        """Feedback and feedforward of all joints of one leg."""
        names = [f"torque of joint {n}, N m" for n in range(1, len(self._view.legs[0].axes) + 1)]
        if not self._view.legs[0].has_joints:
            names = ["Cartesian force along x, N", "Cartesian force along y, N"]
        return [self.plot(f"leg_{number}/torque_{i}", before + name) for i, name in enumerate(names, start=1)]

    def torque(self) -> Panel:
        """Feedback and feedforward torques of the only leg."""
        return rrb.Vertical(*self.torques(1))

    def events(self) -> Panel:
        """Lift-offs, touch-downs and critical moments; a click on the time of one goes there."""
        return rrb.TextLogView(
            origin=f"/{self._view.root}{EVENTS}",
            name="events: click a time to jump to it",
            columns=rrb.TextLogColumns(timeline_columns=["time"], text_log_columns=["body"]),
        )
