"""The layout of the viewer: views of machines, plots with room for numbers and legends, what colours mean."""

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
"""Heights of panels above each other, by the methods that make them, or the plots in them."""
MOVING = ("force", "margins", GAIT)
"""Plots of a walk that show the time about now."""
KEY = "key"
"""The entity of the text that explains the colours."""
KEY_SHARE = 0.1
"""Height of the key as part of that of the scenes."""
BACKGROUND = [245, 245, 245]
BORDER = 60.0
"""Seen around the machine from its sides, mm."""
MARK_ROOM = 0.15
"""Room for a number beyond its mark, as part of the distance of marks."""
REFERENCE_SIZE = 0.95
"""Length and height of the paper's quadruped, for which the eye is placed, m."""


def widen_range(low: float, high: float) -> Range:
    """A range with a margin in which the viewer puts a number on at least two marks, which are at powers of ten."""
    span = high - low or abs(high) or 1.0
    low, high = low - 0.05 * span, high + 0.05 * span
    mark = 10.0 ** np.ceil(np.log10((high - low) / 5.0))  # even a low plot has numbers at five marks
    first = np.arange(np.floor(low / mark), np.ceil(high / mark)) * mark  # of two marks that can be seen
    lows = np.minimum(low, first - MARK_ROOM * mark)
    highs = np.maximum(high, first + mark + MARK_ROOM * mark)
    narrowest = np.argmin(highs - lows)
    return float(lows[narrowest]), float(highs[narrowest])


def find_ranges(views: Sequence[RunView]) -> dict[str, Range]:
    """The vertical axis of each plot, by its path: runs side by side share it."""
    own = [{path: span for path, plot in list_plots(view).items() if (span := plot.find_range())} for view in views]
    spans = {path: np.array([ranges[path] for ranges in own if path in ranges]) for path in set().union(*own)}
    return {path: widen_range(float(span[:, 0].min()), float(span[:, 1].max())) for path, span in spans.items()}


class Panels:
    """Makes the panels of one run; ``ranges`` are those of vertical axes by plot, ``times`` first and last, s.

    Of one ``cycle`` the plots are of its times, and so named.
    """

    def __init__(self, view: RunView, ranges: Mapping[str, Range], times: Range, cycle: int | None = None):
        self.view, self.ranges = view, ranges
        self.times: Range = times if cycle is None else tuple(view.time[view.cycle == cycle][[0, -1]])
        self._plots = list_plots(view)
        self._cycle = "" if cycle is None else f", cycle {cycle}"
        self._now = float(view.run.config["gait"]["cycle_time"]) if view.walks and cycle is None else None

    def stack(self, names: Sequence[str], title: str | None = None) -> Panel:
        """Panels above each other: what the method of a name makes, or the plots in a grid that a pattern matches."""
        panels = [self._grid(name) if "/" in name else getattr(self, name)() for name in names]
        return rrb.Vertical(*panels, row_shares=[SHARES[name] for name in names], name=title)

    def plots(self, pattern: str) -> list[rrb.TimeSeriesView]:
        """The plots whose paths match."""
        return [self._plot(path) for path in self._plots if fnmatch(path, pattern)]

    def _grid(self, pattern: str) -> Panel:
        """These above each other, those of four legs in two columns."""
        plots = self.plots(pattern)
        return rrb.Grid(*plots, grid_columns=2 if len(plots) == len(LEG_NAMES) and not self._cycle else 1)

    def _from_side(self, eye: str, name: str, without: tuple[str, ...] = ()) -> rrb.Spatial2DView:
        """The machine as one of :data:`EYES` sees it, of everything but the entities ``without``; mm."""
        world, meshes = f"/{self.view.root}world", (MESHES,) if self.view.meshes else ()
        seen = self._find_extent() @ np.array(EYES[eye][:2]).T * MM
        low, high = seen.min(axis=0) - BORDER, seen.max(axis=0) + BORDER
        return rrb.Spatial2DView(
            origin=f"/{self.view.root}{name_eye(eye)}",
            contents=[f"+ {world}/**", *(f"- {world}/{path}/**" for path in ("travel/eyes", *without, *meshes))],
            name=name,
            background=BACKGROUND,
            visual_bounds=rrb.VisualBounds2D(x_range=(low[0], high[0]), y_range=(low[1], high[1])),
        )

    def _find_extent(self) -> Array:
        """Two corners of what the machine takes up, in the frame that moves with it, m."""
        view = self.view
        middle, half = view.trunk
        points = np.concatenate([view.joints.reshape(-1, 3), [middle + half] if view.robot else np.empty((0, 3))])
        points[:, 2] += float(view.body["height"].mean()) + view.foot_radius
        lowest = points.min(axis=0) - [0.0, 0.0, -LOWEST_NUMBER if view.walks else 0.0]
        return np.array([lowest, np.maximum(points.max(axis=0), [0.0, 0.0, FORCE_LENGTH])])

    def _plot(self, path: str) -> rrb.TimeSeriesView:
        """A plot of all times, or of a walk's MOVING quantities from 1.6 to 0.2 cycles about now."""
        entity, (title, unit, _, lines) = f"/{self.view.root}{SERIES}", self._plots[path]
        names, colours = [line.name for line in lines], [line.colour for line in lines]
        style = rr.SeriesLines(names=names, colors=colours, widths=[9.0 if path == GAIT else 1.5] * len(names))
        drawn = VisualizerComponentMapping(
            "Scalars:scalars", ComponentSourceKind.SourceComponent, source_component=name_component(path)
        )
        shown, drawn_times = self._make_time_axis(self._now if path.endswith(MOVING) else None)
        return rrb.TimeSeriesView(
            origin=entity,
            contents=[f"+ {entity}"],
            name=f"{title}, {unit}{self._cycle}",
            overrides={entity: style.visualizer(mappings=[drawn])},
            axis_y=rrb.ScalarAxis(range=self.ranges.get(path)),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop, visible=path.startswith(("leg_1/", "body/"))),
            axis_x=shown,
            time_ranges=drawn_times,
        )

    def _make_time_axis(self, around: float | None) -> tuple[rrb.TimeAxis, list[rrb.VisibleTimeRange]]:
        """The time axis of a plot, and which times it draws: lines end before the right edge, where the legend is."""
        if around:
            start, until, end = (rrb.TimeRangeBoundary.cursor_relative(seconds=n * around) for n in (-1.6, 0.2, 1.0))
        else:
            first, last = self.times
            times = first, last, last + 0.3 * (last - first)
            start, until, end = (rrb.TimeRangeBoundary.absolute(seconds=time) for time in times)
        drawn = rrb.VisibleTimeRange("time", start=start, end=until)
        return rrb.TimeAxis(view_range=rrb.TimeRange(start, end)), [drawn]

    def scene(self) -> Panel:
        """A walk in space, where the eye goes along with it; one leg, which moves in a plane, from its right side."""
        view = self.view
        if not view.walks:
            return self._from_side("right side", view.label)
        size = float(2.0 * view.trunk[1][0] + view.body["height"].mean()) / REFERENCE_SIZE
        world, figure = f"/{view.root}world", FIGURE if view.meshes else ()
        eye, target = (0.85 * size, -1.0 * size, 0.65 * size), (0.0, 0.0, 0.22 * size)
        return rrb.Spatial3DView(
            origin=f"{world}/travel",
            contents=[f"+ {world}/**", *(f"- {world}/{path}/**" for path in ("travel/eyes", *figure))],
            name=view.label,
            background=BACKGROUND,
            line_grid=rrb.LineGrid3D(spacing=0.1, color=[190, 190, 190]),
            eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0)),
        )

    def sides(self) -> Panel:
        """A walk from front, side and top."""
        paths = "travel/body/path"
        return rrb.Horizontal(
            self._from_side("front", "from the front", (paths,)),
            self._from_side("right side", "from the right", (paths,)),
            self._from_side("top", "from above", (paths, "travel/body/plate")),
        )

    def events(self) -> Panel:
        """Lift-offs, touch-downs and critical moments; a click on the time of one goes there."""
        return rrb.TextLogView(
            origin=f"/{self.view.root}{EVENTS}",
            name="events: click a time to jump to it",
            columns=rrb.TextLogColumns(timeline_columns=["time"], text_log_columns=["body"]),
        )


def describe_key(views: Sequence[RunView]) -> str:
    """The meaning of the colours of the scenes of several runs, as Markdown."""
    of_walks = [
        "**feet that support** joined by a green line; **centre of gravity** and its plumb line pink",
        "**stability margin** of the centre of gravity to the edges of the polygon of the feet planned to be "
        "down (planned) or that carry load (true): below 0 the machine tips",
    ]
    scales = sorted({view.depression_scale for view in views})
    deeper = [f"ground pressed down {' or '.join(map(str, scales))} times deeper"]
    parts = [
        "**foot path** desired in the current cycle grey, in the first cycle orange, in the last whole one green",
        "**force** desired grey, actual blue",
        "**foot** supporting yellow, in transfer light blue",
        *(of_walks if any(view.walks for view in views) else []),
        *(deeper if scales != [1] else []),
        "**moments** a foot lifts or touches down, a cycle begins: a click on a time goes there",
    ]
    return " · ".join(parts)


def _add_key(scenes: Panel) -> Panel:
    """Scenes above the text that explains their colours."""
    key = rrb.TextDocumentView(origin=KEY, titlebar=False)
    return rrb.Vertical(scenes, key, row_shares=[1.0 - KEY_SHARE, KEY_SHARE])


def _lay_out_run(panels: Panels) -> Panel:
    """The machine on the left; on the right plots of its first cycle beside those of the last whole one, of all."""
    view, (first, last) = panels.view, panels.view.whole_cycles()
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
    tabs.append(panels.stack(("events",), "moments"))
    scenes = _add_key(panels.stack(("scene", "sides") if view.walks else ("scene",)))
    return rrb.Horizontal(scenes, rrb.Tabs(*tabs), column_shares=[1.15 if view.walks else 0.77, 1.0])


def _select_panels(view: RunView, runs: int) -> tuple[str, ...]:
    """The panels of a run beside others; of many walks each column is too narrow for a plot for each leg."""
    if not view.walks:
        return ("scene", "leg_*/force", "leg_*/error")
    return ("scene", "leg_*/force" if runs <= 3 else "body/margins", "body/tilt", "body/height")


def make_layout(views: Sequence[RunView]) -> rrb.Blueprint:
    """A blueprint with the side panels out of the way, which plays a recording again and again.

    Of one run it shows everything; several have a column each, under the name of the scene, and share axes.
    """
    times = min(float(view.time[0]) for view in views), max(float(view.time[-1]) for view in views)
    ranges = find_ranges(views)
    panels = [Panels(view, ranges, times) for view in views]
    if len(panels) == 1:
        content = _lay_out_run(panels[0])
    else:
        columns = [each.stack(_select_panels(each.view, len(panels))) for each in panels]
        content = _add_key(rrb.Horizontal(*columns))
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline="time", state="collapsed", play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
