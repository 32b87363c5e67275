"""The layout of the viewer: views of machines, plots with room for numbers and legends, and the key of colours."""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatch

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

from cmacexp.config.machine import LEG_NAMES
from cmacexp.recording.run_view import RunView
from cmacexp.recording.scene import EYES, FIGURE, FORCE_LENGTH, LOWEST_NUMBER, MESHES, MM, name_eye
from cmacexp.recording.series import EVENTS, GAIT, SERIES, list_plots, name_component
from cmacexp.typing import Array

Panel = rrb.Container | rrb.View
Range = tuple[float, float]
SHARES = {
    **{"scene": 3.0, "sides": 1.6, "events": 1.7},
    **{"leg_*/force": 2.1, "leg_*/error": 2.1, "leg_*/torque_*": 4.2},
    **{GAIT: 1.2, "body/tilt": 1.1, "body/height": 1.1, "body/margins": 1.0},
}
"""Relative heights of stacked panels, by the method of :class:`Panels` or the pattern of plots that makes them."""
MOVING = ("force", "margins", GAIT)
"""Plots of a walking machine whose time axis moves with the current time."""
KEY = "key"
"""Entity of the text that explains the colours."""
KEY_SHARE = 0.1
"""Height of the key as a fraction of the height of scenes and key."""
BACKGROUND = [245, 245, 245]
BORDER = 60.0
"""Margin around the machine in the side views, mm."""
TICK_ROOM = 0.15
"""Space for a number beyond its tick, as a fraction of the distance between ticks."""
REFERENCE_SIZE = 0.95
"""Length plus height of the paper's quadruped, to which the position of the camera scales, m."""


def widen_range(low: float, high: float) -> Range:
    """Widen a range so that at least two ticks with a number are visible; the viewer puts ticks at powers of ten."""
    span = high - low or abs(high) or 1.0
    low, high = low - 0.05 * span, high + 0.05 * span
    tick = 10.0 ** np.ceil(np.log10((high - low) / 5.0))  # even a low plot has room for five numbers
    first = np.arange(np.floor(low / tick), np.ceil(high / tick)) * tick  # lower one of two visible ticks
    lows = np.minimum(low, first - TICK_ROOM * tick)
    highs = np.maximum(high, first + tick + TICK_ROOM * tick)
    narrowest = np.argmin(highs - lows)
    return float(lows[narrowest]), float(highs[narrowest])


def find_ranges(views: Sequence[RunView]) -> dict[str, Range]:
    """Find the range of the vertical axis of each plot, by its path; runs side by side share it."""
    spans: dict[str, list[Range]] = {}
    for view in views:
        for path, plot in list_plots(view).items():
            if span := plot.find_range():
                spans.setdefault(path, []).append(span)
    return {path: widen_range(min(low for low, _ in s), max(high for _, high in s)) for path, s in spans.items()}


class Panels:
    """The panels of one run, each made by a method.

    Args:
        view: the run.
        ranges: range of the vertical axis of each plot, by its path.
        times: first and last time of the plots, s.
        cycle: a cycle to which the plots are restricted, and which their titles name; None: all.
    """

    def __init__(self, view: RunView, ranges: Mapping[str, Range], times: Range, cycle: int | None = None):
        self.view = view
        self.ranges = ranges
        self.times: Range = times if cycle is None else tuple(view.time[view.cycle == cycle][[0, -1]])
        self._plots = list_plots(view)
        self._cycle = "" if cycle is None else f", cycle {cycle}"
        self._period = float(view.run.config["gait"]["cycle_time"]) if view.walks and cycle is None else None

    def stack(self, names: Sequence[str], title: str | None = None) -> Panel:
        """Stack panels, one per name: the panel that the method of this name makes or, for a pattern, its plots."""
        panels_by_name = {"scene": self.scene, "sides": self.sides, "events": self.events}
        panels = [self._grid(name) if "/" in name else panels_by_name[name]() for name in names]
        return rrb.Vertical(*panels, row_shares=[SHARES[name] for name in names], name=title)

    def plots(self, pattern: str) -> list[rrb.TimeSeriesView]:
        """Make the plots whose paths match the pattern."""
        return [self._plot(path) for path in self._plots if fnmatch(path, pattern)]

    def _grid(self, pattern: str) -> Panel:
        """Stack the plots whose paths match the pattern; those of four legs are in two columns."""
        plots = self.plots(pattern)
        return rrb.Grid(*plots, grid_columns=2 if len(plots) == len(LEG_NAMES) and not self._cycle else 1)

    def _from_side(self, eye: str, name: str, without: tuple[str, ...] = ()) -> rrb.Spatial2DView:
        """Make the view of the machine, mm, by a camera of :data:`EYES`, without the entities ``without``."""
        world = f"/{self.view.root}world"
        hidden = ("travel/eyes", *without, *([MESHES] if self.view.meshes else []))
        extent = self._find_extent() @ np.array(EYES[eye][:2]).T * MM
        low, high = extent.min(axis=0) - BORDER, extent.max(axis=0) + BORDER
        return rrb.Spatial2DView(
            origin=f"/{self.view.root}{name_eye(eye)}",
            contents=[f"+ {world}/**", *(f"- {world}/{path}/**" for path in hidden)],
            name=name,
            background=BACKGROUND,
            visual_bounds=rrb.VisualBounds2D(x_range=(low[0], high[0]), y_range=(low[1], high[1])),
        )

    def _find_extent(self) -> Array:
        """Find two opposite corners of the box around the machine, (2, 3), in the frame that moves with it, m."""
        view = self.view
        middle, half = view.trunk
        points = np.concatenate([view.joints.reshape(-1, 3), [middle + half] if view.robot else np.empty((0, 3))])
        points[:, 2] += float(view.body["height"].mean()) + view.foot_radius
        lowest = points.min(axis=0) - [0.0, 0.0, -LOWEST_NUMBER if view.walks else 0.0]
        return np.array([lowest, np.maximum(points.max(axis=0), [0.0, 0.0, FORCE_LENGTH])])

    def _plot(self, path: str) -> rrb.TimeSeriesView:
        """Make a plot over the whole time or, for MOVING quantities of a walking machine, about the current time."""
        entity = f"/{self.view.root}{SERIES}"
        title, unit, _, lines = self._plots[path]
        style = rr.SeriesLines(
            names=[line.name for line in lines],
            colors=[line.colour for line in lines],
            widths=[9.0 if path == GAIT else 1.5] * len(lines),
        )
        drawn = VisualizerComponentMapping(
            "Scalars:scalars", ComponentSourceKind.SourceComponent, source_component=name_component(path)
        )
        axis, drawn_times = self._make_time_axis(self._period if path.endswith(MOVING) else None)
        return rrb.TimeSeriesView(
            origin=entity,
            contents=[f"+ {entity}"],
            name=f"{title}, {unit}{self._cycle}",
            overrides={entity: style.visualizer(mappings=[drawn])},
            axis_y=rrb.ScalarAxis(range=self.ranges.get(path)),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=path.startswith(("leg_1/", "body/"))),
            axis_x=axis,
            time_ranges=drawn_times,
        )

    def _make_time_axis(self, period: float | None) -> tuple[rrb.TimeAxis, list[rrb.VisibleTimeRange]]:
        """Make the time axis of a plot, and the range of times that it draws.

        Lines end before the right edge, where the legend is. With a gait ``period``, s, the axis moves with the
        current time: lines begin 1.6 periods before and end 0.2 periods after it.
        """
        if period:
            start, until, end = (rrb.TimeRangeBoundary.cursor_relative(seconds=n * period) for n in (-1.6, 0.2, 1.0))
        else:
            first, last = self.times
            times = first, last, last + 0.3 * (last - first)
            start, until, end = (rrb.TimeRangeBoundary.absolute(seconds=time) for time in times)
        drawn = rrb.VisibleTimeRange("time", start=start, end=until)
        return rrb.TimeAxis(view_range=rrb.TimeRange(start, end)), [drawn]

    def scene(self) -> Panel:
        """Make the main view: 3-D with a camera that follows a walking machine, or the right side of a single leg."""
        view = self.view
        if not view.walks:
            return self._from_side("right side", view.label)
        size = float(2.0 * view.trunk[1][0] + view.body["height"].mean()) / REFERENCE_SIZE
        world = f"/{view.root}world"
        hidden = ("travel/eyes", *(FIGURE if view.meshes else ()))
        return rrb.Spatial3DView(
            origin=f"{world}/travel",
            contents=[f"+ {world}/**", *(f"- {world}/{path}/**" for path in hidden)],
            name=view.label,
            background=BACKGROUND,
            line_grid=rrb.LineGrid3D(spacing=0.1, color=[190, 190, 190]),
            eye_controls=rrb.EyeControls3D(
                position=(0.85 * size, -1.0 * size, 0.65 * size),
                look_target=(0.0, 0.0, 0.22 * size),
                eye_up=(0.0, 0.0, 1.0),
            ),
        )

    def sides(self) -> Panel:
        """Make the views of a walking machine from the front, the right and above."""
        paths = "travel/body/path"
        return rrb.Horizontal(
            self._from_side("front", "from the front", (paths,)),
            self._from_side("right side", "from the right", (paths,)),
            self._from_side("top", "from above", (paths, "travel/body/plate")),
        )

    def events(self) -> Panel:
        """Make the log of events; a click on the time of an event moves the viewer to it."""
        return rrb.TextLogView(
            origin=f"/{self.view.root}{EVENTS}",
            name="events: click a time to jump to it",
            columns=rrb.TextLogColumns(timeline_columns=["time"], text_log_columns=["body"]),
        )


def describe_key(views: Sequence[RunView]) -> str:
    """Describe the meaning of the colours in the scenes of these runs, as Markdown."""
    walking = [
        "**feet that support** joined by a green line; **centre of gravity** and its plumb line pink",
        "**stability margin** of the centre of gravity to the edges of the polygon of the feet planned to be "
        "down (planned) or that carry load (true): below 0 the machine tips",
    ]
    scales = sorted({view.depression_scale for view in views})
    deeper = [f"ground pressed down {' or '.join(map(str, scales))} times deeper"]
    entries = [
        "**foot path** desired in the current cycle grey, in the first cycle orange, in the last whole one green",
        "**force** desired grey, actual blue",
        "**foot** supporting yellow, in transfer light blue",
        *(walking if any(view.walks for view in views) else []),
        *(deeper if scales != [1] else []),
        "**events** a foot lifts off or touches down, a cycle begins: a click on a time jumps to it",
    ]
    return " · ".join(entries)


def _add_key(scenes: Panel) -> Panel:
    """Add the text that explains the colours below the scenes."""
    key = rrb.TextDocumentView(origin=KEY, titlebar=False)
    return rrb.Vertical(scenes, key, row_shares=[1.0 - KEY_SHARE, KEY_SHARE])


def _lay_out_run(panels: Panels) -> Panel:
    """Lay out a single run: the machine on the left, tabs of plots on the right.

    The first tab compares the first cycle with the last complete one; the others show the whole run and its events.
    """
    view = panels.view
    first, last = view.whole_cycles()
    names = ("leg_*/force",) if view.walks else ("leg_*/force", "leg_*/error", "leg_*/torque_*")
    tabs: list[Panel] = []
    if first < last:
        both = [Panels(view, panels.ranges, panels.times, cycle).stack(names) for cycle in (first, last)]
        tabs.append(rrb.Horizontal(*both, name=f"cycles {first} and {last}"))
    if view.walks:
        legs = [rrb.Horizontal(*panels.plots(f"leg_{leg}/[et]*")) for leg in range(1, view.trace.legs + 1)]
        walk = panels.stack((GAIT, "body/tilt", "body/height", "body/margins"), "walk")
        tabs += [walk, rrb.Vertical(*legs, name="whole run")]
    else:
        tabs.append(panels.stack(names, "whole run"))
    tabs.append(panels.stack(("events",), "events"))
    scenes = _add_key(panels.stack(("scene", "sides") if view.walks else ("scene",)))
    return rrb.Horizontal(scenes, rrb.Tabs(*tabs), column_shares=[1.15 if view.walks else 0.77, 1.0])


def _select_panels(view: RunView, runs: int) -> tuple[str, ...]:
    """Select the panels of a run in a column beside others; many columns are too narrow for a plot of each leg."""
    if not view.walks:
        return ("scene", "leg_*/force", "leg_*/error")
    return ("scene", "leg_*/force" if runs <= 3 else "body/margins", "body/tilt", "body/height")


def make_layout(views: Sequence[RunView]) -> rrb.Blueprint:
    """Make the blueprint of a recording, with collapsed side panels, played in a loop.

    A single run has all plots; several runs have a column each and share the ranges of their axes.
    """
    times = min(float(view.time[0]) for view in views), max(float(view.time[-1]) for view in views)
    ranges = find_ranges(views)
    panels = [Panels(view, ranges, times) for view in views]
    if len(panels) == 1:
        content = _lay_out_run(panels[0])
    else:
        columns = [run_panels.stack(_select_panels(run_panels.view, len(panels))) for run_panels in panels]
        content = _add_key(rrb.Horizontal(*columns))
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline="time", state="collapsed", play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
