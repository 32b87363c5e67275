"""The layout of the viewer for the recording of a run, and what its colours mean."""

from collections.abc import Sequence

import rerun.blueprint as rrb

from cmacexp.recording.axes import find_times, value_ranges
from cmacexp.recording.ground import depression_scale
from cmacexp.recording.panels import SHARES, SPACE, Panel, Panels
from cmacexp.recording.run_view import RunView

KEY = "key"
KEY_SHARE = 0.1
"""Height of the key as part of that of the scenes."""


def _describe_cycles(view: RunView) -> str:
    first, last = view.whole_cycles()
    return f"cycle {first} orange, cycle {last} green" if first < last else f"cycle {last} green"


def describe_key(views: Sequence[RunView]) -> str:
    """The meaning of the colours of the scenes of several runs, as Markdown."""
    cycles = {_describe_cycles(view) for view in views}
    paths = cycles.pop() if len(cycles) == 1 else "first cycle orange, last green"
    parts = [
        f"**foot path** desired in the current cycle grey, {paths}",
        "**force** desired grey, actual blue",
        "**foot** supporting yellow, in transfer light blue",
    ]
    if any(view.walks for view in views):
        parts.append("**feet that support** joined by a green line; **centre of gravity** and its plumb line pink")
        parts.append(
            "**stability margin** of the centre of gravity to the edges of the polygon of the feet planned to be "
            "down (planned) or that carry load (true): below 0 the machine tips"
        )
    scales = sorted({depression_scale(view) for view in views})
    if scales != [1]:
        parts.append(f"ground pressed down {' or '.join(map(str, scales))} times deeper")
    parts.append("**moments** a foot lifts or touches down, a cycle begins: a click on a time goes there")
    return " · ".join(parts)


def stack(panels: Panels, names: Sequence[str], name: str | None = None) -> Panel:
    """Panels above each other."""
    return rrb.Vertical(*map(panels.make, names), row_shares=[SHARES[name] for name in names], name=name)


def with_key(content: Panel) -> Panel:
    """Scenes above the text that explains their colours."""
    return rrb.Vertical(
        content, rrb.TextDocumentView(origin=KEY, titlebar=False), row_shares=[1.0 - KEY_SHARE, KEY_SHARE]
    )


def _first_beside_last(view: RunView) -> list[Panel]:
    """What learning changed: plots of the first cycle beside those of the last whole one; none if it is the same."""
    first, last = view.whole_cycles()
    if first == last:
        return []
    ranges, times, names = value_ranges([view])[0], find_times([view]), ("force", "error", "torque")
    both = [stack(Panels(view, ranges, times, cycle), names[: 1 if view.walks else 3]) for cycle in (first, last)]
    return [rrb.Horizontal(*both, name=f"cycles {first} and {last}")]


def _plots(panels: Panels, view: RunView) -> Panel:
    compared, moments = _first_beside_last(view), stack(panels, ("events",), "moments")
    if not view.walks:
        return rrb.Tabs(*compared, stack(panels, ("force", "error", "torque"), "whole run"), moments)
    walk = stack(panels, ("gait", "posture", "margins"), "walk")
    rows = [
        rrb.Horizontal(
            panels.plot(f"leg_{leg.number}/error", f"{leg.number} {leg.name}: actual minus desired, mm"),
            *panels.torques(leg.number, f"{leg.number}: "),
        )
        for leg in view.legs
    ]
    return rrb.Tabs(*compared, walk, rrb.Vertical(*rows, name="whole run"), moments)


def make_blueprint(content: Panel) -> rrb.Blueprint:
    """A blueprint with the side panels out of the way, which plays a recording again and again."""
    return rrb.Blueprint(
        content,
        rrb.TimePanel(timeline="time", state="collapsed", play_state="playing", loop_mode="all"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def layout(view: RunView) -> rrb.Blueprint:
    """The blueprint of the recording of one run: the machine on the left, the plots on the right."""
    panels = Panels(view, value_ranges([view])[0], find_times([view]))
    space = with_key(stack(panels, SPACE if view.walks else ("scene",)))
    shares = [1.15 if view.walks else 0.77, 1.0]
    return make_blueprint(rrb.Horizontal(space, _plots(panels, view), column_shares=shares))
