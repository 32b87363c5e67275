"""The layout of the viewer for the recording of a run."""

from collections.abc import Sequence

import rerun.blueprint as rrb

from cmacexp.recording.panels import SPACE, Panel, Panels, describe_colours, describe_depression
from cmacexp.recording.run_view import RunView


def stack(panels: Panels, names: Sequence[str]) -> Panel:
    """Panels above each other."""
    return rrb.Vertical(*map(panels.make, names), row_shares=[panels.share(name) for name in names])


def _walk(panels: Panels, view: RunView) -> rrb.Container:
    """The walk in space and from front, side and top, beside its gait, forces, posture and stability."""
    names = ("gait", "force", "posture", "margins")
    walk = rrb.Vertical(*map(panels.make, names), row_shares=[panels.share(name) for name in names], name="walk")
    rows = [
        rrb.Horizontal(
            panels.plot(f"leg_{leg.number}/error", f"{leg.name}: actual minus desired, mm"),
            *panels.torques(leg.number, f"{leg.name}: "),
        )
        for leg in view.legs
    ]
    learning = rrb.Vertical(*rows, name="learning")
    return rrb.Horizontal(stack(panels, SPACE), rrb.Tabs(walk, learning), column_shares=[1.15, 1.0])


def _chosen(panels: Panels, names: Sequence[str], width: float) -> Panel:
    """The machine on the left, so many times as wide as the plots on the right; or whichever of them is asked for."""
    left, right = ([name for name in names if (name in SPACE) == space] for space in (True, False))
    columns = [stack(panels, column) for column in (left, right) if column]
    return rrb.Horizontal(*columns, column_shares=[width, 1.0][: len(columns)])


def make_blueprint(content: Panel) -> rrb.Blueprint:
    """A blueprint with the side panels out of the way."""
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline="time", state="collapsed", play_state="playing"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def layout(view: RunView, names: Sequence[str] | None = None) -> rrb.Blueprint:
    """The blueprint of the recording of one run.

    Args:
        view: the run.
        names: of the panels to show, from top to bottom; None: the usual ones.
    """
    panels = Panels(view, describe_colours(view) + describe_depression(view))
    if names is None and view.walks:
        return make_blueprint(_walk(panels, view))
    return make_blueprint(
        _chosen(panels, names or ("scene", "force", "error", "torque"), 1.15 if view.walks else 0.77)
    )
