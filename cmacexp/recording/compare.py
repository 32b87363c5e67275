"""Several runs side by side in one recording: one column for each."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import rerun.blueprint as rrb

from cmacexp.recording.axes import find_times, value_ranges
from cmacexp.recording.blueprint import make_blueprint, stack, with_key
from cmacexp.recording.panels import SPACE, Panel, Panels, panel_names
from cmacexp.recording.run_view import RunView
from cmacexp.recording.write import write_views

MOST_RUNS = 6
"""Runs side by side at the most."""
FEW = 3
"""Of more walks side by side each column is too narrow for a plot for each leg."""
LABEL = "label"
"""The entity of the text that names the run of a column."""


def _usual(view: RunView, runs: int) -> tuple[str, ...]:
    if not view.walks:
        return ("scene", "force", "error")
    return ("scene", "force", "posture") if runs <= FEW else ("scene", "posture", "margins")


def _column(view: RunView, panels: Panels, names: Sequence[str]) -> Panel:
    """Panels above each other under the label of the run: the title of a scene, or a text above all panels."""
    if names[:1] == ["scene"]:
        return stack(panels, names)
    title = rrb.TextDocumentView(origin=f"{view.root}{LABEL}", titlebar=False)
    return rrb.Vertical(title, *([stack(panels, names)] if names else []), row_shares=[1.0, 20.0][: 1 + bool(names)])


def _layout(views: Sequence[RunView], names: Sequence[str] | None) -> rrb.Blueprint:
    """One column for each run, of those of the panels ``names`` that it has; None: the usual ones."""
    times = find_times(views)
    columns = []
    for view, ranges in zip(views, value_ranges(views), strict=True):
        shown = [name for name in names or _usual(view, len(views)) if name in panel_names(view.walks)]
        columns.append(_column(view, Panels(view, ranges, times), shown))
    content = rrb.Horizontal(*columns)
    drawn = names is None or set(names) & set(SPACE)
    return make_blueprint(with_key(content) if drawn else content)


def write_comparison(runs: Mapping[Path, RunView], path: Path, names: Sequence[str] | None = None) -> str:
    """Write several runs into one recording, whole or not at all.

    Args:
        runs: at least two by their folders, each with a label and a root of its own.
        path: of the ``.rrd`` file.
        names: of the panels to show; None: the default ones.

    Returns:
        The name of the recording, which describes its content.
    """
    views = list(runs.values())
    if len({view.window for view in views}) == 1:
        name = f"{' | '.join(view.label for view in views)}, {views[0].window}"
    else:
        name = " | ".join(f"{view.label}, {view.window}" for view in views)
    labels = {view.root + LABEL: f"**{view.label}**" for view in views}
    write_views(runs, _layout(views, names), name, path, labels)
    return name
