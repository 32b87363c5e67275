"""How the viewer is laid out when a recording is opened."""

import rerun.blueprint as rrb

from cmacexp.recording.ground import depression_scale
from cmacexp.recording.view import RunView

Point = tuple[float, float, float]
LEGEND = "path: desired grey, first cycle orange, last green; force: desired grey, actual yellow"


def _scene(
    name: str,
    position: Point,
    target: Point,
    *,
    up: Point = (0.0, 0.0, 1.0),
    grid: bool = False,
    without: tuple[str, ...] = (),
) -> rrb.Spatial3DView:
    """A view that goes along with the machine, of everything but the entities ``without``."""
    return rrb.Spatial3DView(
        origin="world/travel",
        contents=["+ /world/**", *(f"- /world/{entity}/**" for entity in without)],
        name=name,
        background=[245, 245, 245],
        line_grid=rrb.LineGrid3D(visible=grid, spacing=0.1, color=[190, 190, 190]),
        eye_controls=rrb.EyeControls3D(position=position, look_target=target, eye_up=up),
    )


def _around_now(cycle_time: float) -> list[rrb.VisibleTimeRange]:
    """From a cycle and a half before the moment that is shown to half a cycle after it."""
    start = rrb.TimeRangeBoundary.cursor_relative(seconds=-1.5 * cycle_time)
    end = rrb.TimeRangeBoundary.cursor_relative(seconds=0.5 * cycle_time)
    return [rrb.VisibleTimeRange("time", start=start, end=end)]


def _plot(origin: str, name: str, cycle_time: float | None = None) -> rrb.TimeSeriesView:
    """A plot of all times, or of those around now."""
    return rrb.TimeSeriesView(
        origin=f"series/{origin}",
        name=name,
        plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop if cycle_time else rrb.Corner2D.RightTop),
        time_ranges=_around_now(cycle_time) if cycle_time else None,
    )


def _torque_names(view: RunView) -> tuple[str, str]:
    if view.legs[0].lengths is None:
        return "Cartesian force along x, N", "Cartesian force along y, N"
    return "torque of joint 1, N m", "torque of joint 2, N m"


def _one_leg(view: RunView) -> rrb.Container:
    """The leg from its side, beside force, tracking error and torques."""
    height = 0.4 * float(view.body["height"][0])
    first, second = _torque_names(view)
    series = rrb.Vertical(
        _plot("leg_1/force", "contact force, N"),
        _plot("leg_1/error", "foot, actual minus desired, mm"),
        _plot("leg_1/torque_1", first),
        _plot("leg_1/torque_2", second),
    )
    scene = _scene(LEGEND, (0.1, -0.95, height + 0.16), (0.0, 0.0, height))
    return rrb.Horizontal(scene, series, column_shares=[1.0, 1.3])


def _walk(view: RunView) -> rrb.Container:
    """The walk in space and from front, side and top, beside its gait, forces, posture and stability."""
    times = depression_scale(view)
    middle = (0.0, 0.0, 0.25)
    main = _scene(f"{LEGEND}; depression x {times}", (0.85, -1.0, 0.65), (0.0, 0.0, 0.22), grid=True)
    paths = tuple(f"travel/body/leg_{leg.number}/path" for leg in view.legs)
    small = rrb.Horizontal(
        _scene("front", (1.3, 0.0, 0.27), middle, without=paths),
        _scene("right side", (0.0, -1.35, 0.27), middle, without=paths),
        _scene("top", (0.0, -0.01, 1.35), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), without=(*paths, "travel/body/plate")),
    )
    now = float(view.config["gait"]["cycle_time"])
    walk = rrb.Vertical(
        rrb.StateTimelineView(origin="gait", name="gait diagram"),
        rrb.Grid(
            *[_plot(f"leg_{leg.number}/force", f"force of {leg.name}, N", now) for leg in view.legs], grid_columns=2
        ),
        _plot("body/tilt", "tilt of the body, mrad"),
        _plot("body/height", "height of the body, mm"),
        _plot("body/margins", "stability margins, mm", now),
        row_shares=[1.7, 2.1, 0.9, 0.8, 0.9],
        name="walk",
    )
    first, second = _torque_names(view)
    rows = [
        rrb.Horizontal(
            _plot(f"leg_{leg.number}/error", f"{leg.name}: actual minus desired, mm"),
            _plot(f"leg_{leg.number}/torque_1", f"{leg.name}: {first}"),
            _plot(f"leg_{leg.number}/torque_2", f"{leg.name}: {second}"),
        )
        for leg in view.legs
    ]
    learning = rrb.Vertical(*rows, name="learning")
    return rrb.Horizontal(
        rrb.Vertical(main, small, row_shares=[1.9, 1.0]), rrb.Tabs(walk, learning), column_shares=[1.15, 1.0]
    )


def layout(view: RunView) -> rrb.Blueprint:
    """The blueprint that goes into a recording."""
    return rrb.Blueprint(
        _walk(view) if view.walks else _one_leg(view),
        rrb.TimePanel(timeline="time", state="collapsed", play_state="playing"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
