"""The layout of the viewer for the recording of a run."""

from collections.abc import Sequence

import rerun.blueprint as rrb
from rerun.blueprint.components import AbsoluteTimeRange

from cmacexp.recording.axes import Times, find_times, value_ranges
from cmacexp.recording.key import KEY
from cmacexp.recording.panels import SPACE, Panel, Panels
from cmacexp.recording.run_view import RunView

KEY_SHARE = 0.07
"""Height of the key as part of that of the scenes."""


def stack(panels: Panels, names: Sequence[str], name: str | None = None) -> Panel:
    """Panels above each other."""
    return rrb.Vertical(*map(panels.make, names), row_shares=[panels.share(name) for name in names], name=name)


def with_key(content: Panel) -> Panel:
    """Scenes above the text that explains their colours."""
    return rrb.Vertical(
        content, rrb.TextDocumentView(origin=KEY, titlebar=False), row_shares=[1.0 - KEY_SHARE, KEY_SHARE]
    )


def _plots(panels: Panels, view: RunView) -> Panel:
    """The plots of a run in tabs."""
    if not view.walks:
        return rrb.Tabs(stack(panels, ("force", "error", "torque"), "plots"), stack(panels, ("events",), "moments"))
    walk = stack(panels, ("gait", "force", "posture", "margins"), "walk")
    rows = [
        rrb.Horizontal(
            panels.plot(f"leg_{leg.number}/error", f"{leg.number} {leg.name}: actual minus desired, mm"),
            *panels.torques(leg.number, f"{leg.number}: "),
        )
        for leg in view.legs
    ]
    return rrb.Tabs(walk, rrb.Vertical(*rows, name="learning"), stack(panels, ("events",), "moments"))


def _chosen(panels: Panels, names: Sequence[str]) -> Panel:
    """The machine on the left, the plots on the right; or whichever of them is asked for."""
    space, plots = ([name for name in names if (name in SPACE) == in_space] for in_space in (True, False))
    columns = [with_key(stack(panels, space))] if space else []
    return rrb.Horizontal(*columns, *([stack(panels, plots)] if plots else []))


def make_blueprint(content: Panel, times: Times) -> rrb.Blueprint:
    """A blueprint with the side panels out of the way, which plays these times again and again."""
    part = times.last < times.end
    first, last = (round(1e9 * time) for time in (times.first, times.last))
    return rrb.Blueprint(
        content,
        rrb.TimePanel(
            timeline="time",
            state="collapsed",
            play_state="playing",
            loop_mode="selection" if part else "all",
            time_selection=AbsoluteTimeRange(first, last) if part else None,
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def layout(view: RunView, names: Sequence[str] | None = None) -> rrb.Blueprint:
    """The blueprint of the recording of one run.

    Args:
        view: the run.
        names: of the panels to show, from top to bottom; None: the usual ones.
    """
    times = find_times([view])
    panels = Panels(view, view.label, value_ranges([view])[0], times)
    if names:
        return make_blueprint(_chosen(panels, names), times)
    space = with_key(stack(panels, SPACE if view.walks else ("scene",)))
    shares = [1.15 if view.walks else 0.77, 1.0]
    return make_blueprint(rrb.Horizontal(space, _plots(panels, view), column_shares=shares), times)
