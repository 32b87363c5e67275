"""What the colours of a scene mean, in words beside it."""

from collections.abc import Sequence

from cmacexp.recording.ground import depression_scale
from cmacexp.recording.run_view import RunView

KEY = "key"
"""The entity of the text."""


def _cycles(view: RunView) -> str:
    first, last = view.whole_cycles()
    return f"cycle {first} orange, cycle {last} green" if first < last else f"cycle {last} green"


def describe_depression(view: RunView) -> str:
    """How much deeper than they are depressions are drawn, if they are."""
    times = depression_scale(view)
    return f"ground pressed down {times} times deeper" if times > 1 else ""


def describe_key(views: Sequence[RunView]) -> str:
    """The meaning of the colours of the scenes of several runs, as Markdown."""
    cycles, depressions = {_cycles(view) for view in views}, {describe_depression(view) for view in views}
    parts = [
        "**foot path** desired grey, " + (cycles.pop() if len(cycles) == 1 else "first cycle orange, last green"),
        "**force** desired grey, actual blue",
        "**foot** supporting yellow, in transfer light blue",
    ]
    if any(view.walks for view in views):
        parts.append("**feet that support** joined by a green line; **centre of gravity** and its plumb line pink")
    if len(depressions) == 1 and (depression := depressions.pop()):
        parts.append(depression)
    return " · ".join(parts)
