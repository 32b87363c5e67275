"""Several runs side by side in one recording: one column for each."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import rerun.blueprint as rrb

from cmacexp.recording.axes import find_times, value_ranges
from cmacexp.recording.blueprint import make_blueprint, stack, with_key
from cmacexp.recording.panels import Panels
from cmacexp.recording.run_view import RunView
from cmacexp.recording.write import write_views

MOST_RUNS = 6


def _list_panels(view: RunView, runs: int) -> tuple[str, ...]:
    if not view.walks:
        return ("scene", "force", "error")
    # Of more walks side by side each column is too narrow for a plot for each leg.
    return ("scene", "force", "posture") if runs <= 3 else ("scene", "posture", "margins")


def _layout(views: Sequence[RunView]) -> rrb.Blueprint:
    """One column for each run, under the name of its scene."""
    times = find_times(views)
    columns = [
        stack(Panels(view, ranges, times), _list_panels(view, len(views)))
        for view, ranges in zip(views, value_ranges(views), strict=True)
    ]
    return make_blueprint(with_key(rrb.Horizontal(*columns)))


def write_comparison(runs: Mapping[Path, RunView], path: Path) -> str:
    """Write several runs, each with a label and a root of its own, into one recording; describes it."""
    views = list(runs.values())
    if len({view.window for view in views}) == 1:
        name = f"{' | '.join(view.label for view in views)}, {views[0].window}"
    else:
        name = " | ".join(f"{view.label}, {view.window}" for view in views)
    write_views(runs, _layout(views), name, path)
    return name
