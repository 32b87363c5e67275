"""How the viewer is laid out when a recording is opened."""

import rerun.blueprint as rrb

from cmacexp.recording.view import RunView


def one_leg(view: RunView) -> rrb.Blueprint:
    """The leg from its side, beside force, tracking error and torques."""
    unit = "N m" if view.legs[0].lengths else "N"
    what = "torque" if view.legs[0].lengths else "Cartesian force"
    axes = ("joint 1", "joint 2") if view.legs[0].lengths else ("along x", "along y")
    scene = rrb.Spatial3DView(
        origin="world",
        name="path: desired grey, first cycle orange, last green; force: desired grey, actual yellow",
        background=[245, 245, 245],
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(0.1, -0.95, 0.36), look_target=(0.0, 0.0, 0.2), eye_up=(0.0, 0.0, 1.0)
        ),
    )
    named = {
        "force": "contact force, N",
        "error": "foot, actual minus desired, mm",
        "torque_1": f"{what} {axes[0]}, {unit}",
        "torque_2": f"{what} {axes[1]}, {unit}",
    }
    legend = rrb.PlotLegend(corner=rrb.Corner2D.RightTop)
    series = [
        rrb.TimeSeriesView(origin=f"series/leg_1/{entity}", name=name, plot_legend=legend)
        for entity, name in named.items()
    ]
    return rrb.Blueprint(
        rrb.Horizontal(scene, rrb.Vertical(*series), column_shares=[1.0, 1.3]),
        rrb.TimePanel(timeline="time", state="collapsed", play_state="playing"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
