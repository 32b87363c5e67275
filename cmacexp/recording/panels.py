"""The panels that show a run, under the names that ``--views`` takes."""

from collections.abc import Mapping

import rerun.blueprint as rrb

from cmacexp.recording.ground import depression_scale
from cmacexp.recording.run_view import RunView

Point = tuple[float, float, float]
Panel = rrb.Container | rrb.View
WALK = ("scene", "sides", "gait", "force", "posture", "margins", "error", "torque")
ONE_LEG = ("scene", "gait", "force", "error", "torque")
SPACE = ("scene", "sides")
"""Panels that show the machine itself."""
SHARES = {
    **{"scene": 3.0, "sides": 1.6, "gait": 1.7, "force": 2.1},
    **{"posture": 1.7, "margins": 0.9, "error": 2.1, "torque": 4.2},
}
"""Heights of the panels of a walk; those of one leg are 1 for each plot."""
COLOURS = "path: desired grey, {}; force: desired grey, actual yellow"
MIDDLE = (0.0, 0.0, 0.25)


def panel_names(walks: bool) -> tuple[str, ...]:
    """The panels of a run, of a walk or of one leg."""
    return WALK if walks else ONE_LEG


def describe_colours(view: RunView) -> str:
    """The meaning of the colours of its scene."""
    first, last = view.whole_cycles()
    cycles = f"cycle {first} orange, cycle {last} green" if first < last else f"cycle {last} green"
    return COLOURS.format(cycles)


def describe_depression(view: RunView) -> str:
    """How much deeper than they are depressions are drawn, if they are."""
    times = depression_scale(view)
    return f"; depression x {times}" if times > 1 else ""


class Panels:
    """Makes the panels of one run.

    Args:
        view: the run.
        title: of its scene.
        ranges: of the vertical axes of plots that several runs share, by the name of the plot.
        times: first and last moment of plots of all times that several runs share, s.
        away: how many times further than usual the eye is from the machine.
        legends: whether plots have one; of the same plot for each leg the first has it.
    """

    def __init__(
        self,
        view: RunView,
        title: str,
        ranges: Mapping[str, tuple[float, float]] | None = None,
        times: tuple[float, float] | None = None,
        away: float = 1.0,
        legends: bool = True,
    ):
        self._view = view
        self._title = title
        self._ranges = ranges or {}
        self._times = times
        self._away = away
        self._legends = legends
        self._now = float(view.config["gait"]["cycle_time"]) if view.walks else None

    def make(self, name: str) -> Panel:
        """The panel of that name."""
        panel: Panel = getattr(self, name)()
        return panel

    def share(self, name: str) -> float:
        """How much of the height of a column a panel takes."""
        if self._view.walks:
            return SHARES[name]
        return {"scene": 3.0, "torque": 2.0}.get(name, 1.0)

    def spatial(
        self,
        name: str,
        position: Point,
        target: Point,
        *,
        up: Point = (0.0, 0.0, 1.0),
        grid: bool = False,
        without: tuple[str, ...] = (),
    ) -> rrb.Spatial3DView:
        """A view that goes along with the machine, of everything but the entities ``without``."""
        world = f"/{self._view.root}world"
        eye = [end + self._away * (start - end) for start, end in zip(position, target, strict=True)]
        return rrb.Spatial3DView(
            origin=f"{world}/travel",
            contents=[f"+ {world}/**", *(f"- {world}/{entity}/**" for entity in without)],
            name=name,
            background=[245, 245, 245],
            line_grid=rrb.LineGrid3D(visible=grid, spacing=0.1, color=[190, 190, 190]),
            eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=up),
        )

    def plot(self, path: str, name: str, around: float | None = None) -> rrb.TimeSeriesView:
        """A plot of all times, or of those from 1.5 to 0.5 times ``around`` seconds about now."""
        shown, horizontal = None, None
        if around:
            start = rrb.TimeRangeBoundary.cursor_relative(seconds=-1.5 * around)
            end = rrb.TimeRangeBoundary.cursor_relative(seconds=0.5 * around)
            shown = [rrb.VisibleTimeRange("time", start=start, end=end)]
        elif self._times:
            first, last = (rrb.TimeRangeBoundary.absolute(seconds=time) for time in self._times)
            horizontal = rrb.TimeAxis(view_range=rrb.TimeRange(first, last))
        corner = rrb.Corner2D.LeftTop if around else rrb.Corner2D.RightTop
        return rrb.TimeSeriesView(
            origin=f"{self._view.root}series/{path}",
            name=name,
            axis_x=horizontal,
            axis_y=rrb.ScalarAxis(range=self._ranges[path]) if path in self._ranges else None,
            plot_legend=rrb.PlotLegend(corner=corner, visible=self._legends and path.startswith(("leg_1/", "body/"))),
            time_ranges=shown,
        )

    def _each_leg(self, quantity: str, of_one: str, of_leg: str, around: float | None = None) -> Panel:
        if not self._view.walks:
            return self.plot(f"leg_1/{quantity}", of_one)
        plots = [
            self.plot(f"leg_{leg.number}/{quantity}", of_leg.format(leg.name), around) for leg in self._view.legs
        ]
        return rrb.Grid(*plots, grid_columns=2)

    def scene(self) -> Panel:
        """The machine in space."""
        if self._view.walks:
            return self.spatial(self._title, (0.85, -1.0, 0.65), (0.0, 0.0, 0.22), grid=True)
        height = 0.4 * float(self._view.body["height"][0])
        return self.spatial(self._title, (0.1, -0.95, height + 0.16), (0.0, 0.0, height))

    def sides(self) -> Panel:
        """A walk from front, side and top."""
        paths = tuple(f"travel/body/leg_{leg.number}/path" for leg in self._view.legs)
        covering = (*paths, "travel/body/plate")
        return rrb.Horizontal(
            self.spatial("front", (1.3, 0.0, 0.27), MIDDLE, without=paths),
            self.spatial("right side", (0.0, -1.35, 0.27), MIDDLE, without=paths),
            self.spatial("top", (0.0, -0.01, 1.35), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), without=covering),
        )

    def gait(self) -> Panel:
        """Which foot supports when (Lin & Song 1997, Fig. 14)."""
        return rrb.StateTimelineView(origin=f"{self._view.root}gait", name="gait diagram")

    def force(self) -> Panel:
        """Contact forces."""
        return self._each_leg("force", "contact force, N", "{}: force, N", self._now)

    def posture(self) -> Panel:
        """Tilt and height of the body."""
        tilt = self.plot("body/tilt", "tilt of the body, mrad")
        return rrb.Vertical(tilt, self.plot("body/height", "height of the body, mm"), row_shares=[0.9, 0.8])

    def margins(self) -> Panel:
        """Stability margins: the planned one, and those of the feet that carry load."""
        return self.plot("body/margins", "stability margins, planned and true, mm", self._now)

    def error(self) -> Panel:
        """Tracking errors of the feet."""
        return self._each_leg("error", "foot, actual minus desired, mm", "{}: actual minus desired, mm")

    def torques(self, number: int, before: str = "") -> list[rrb.TimeSeriesView]:
        """Feedback and feedforward of both joints of one leg."""
        names = ("torque of joint 1, N m", "torque of joint 2, N m")
        if self._view.legs[0].lengths is None:
            names = ("Cartesian force along x, N", "Cartesian force along y, N")
        return [self.plot(f"leg_{number}/torque_{i}", before + name) for i, name in enumerate(names, start=1)]

    def torque(self) -> Panel:
        """Feedback and feedforward torques."""
        if not self._view.walks:
            return rrb.Vertical(*self.torques(1))
        plots = [plot for leg in self._view.legs for plot in self.torques(leg.number, f"{leg.name}: ")]
        return rrb.Grid(*plots, grid_columns=2)
