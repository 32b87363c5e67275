"""Several runs side by side in one recording: one column for each."""

import re
from collections.abc import Sequence
from pathlib import Path

import rerun.blueprint as rrb

from cmacexp.recording.axes import find_times, value_ranges
from cmacexp.recording.blueprint import make_blueprint, stack, with_key
from cmacexp.recording.key import describe_depression
from cmacexp.recording.panels import SPACE, Panel, Panels, panel_names
from cmacexp.recording.run_view import RunView
from cmacexp.recording.write import RunEntry, write_views

MOST_RUNS = 6
"""Runs side by side at the most."""
FEW = 3
"""Of more walks side by side each column is too narrow for a plot for each leg."""
WIDE = 4
"""Of more runs side by side each column is too narrow for the usual distance of the eye."""
LABEL = "label"
"""The entity of the text that names the run of a column."""


def _one_depression(views: Sequence[RunView]) -> bool:
    return len({describe_depression(view) for view in views}) == 1


def _title(view: RunView, views: Sequence[RunView]) -> str:
    """The label of a run; where the runs differ in it, how deep its ground is drawn."""
    return view.label if _one_depression(views) else "; ".join(filter(None, (view.label, describe_depression(view))))


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
    times, ranges = find_times(views), value_ranges(views)
    columns = []
    for number, view in enumerate(views):
        first = view.walks not in [earlier.walks for earlier in views[:number]]
        shown = [name for name in names or _usual(view, len(views)) if name in panel_names(view.walks)]
        away = max(1.0, len(views) / WIDE)
        columns.append(_column(view, Panels(view, _title(view, views), ranges[number], times, away, first), shown))
    content = rrb.Horizontal(*columns)
    drawn = names is None or set(names) & set(SPACE)
    return make_blueprint(with_key(content) if drawn else content, times)


def make_root(number: int, label: str) -> str:
    """Prefix of the paths of the entities of a run; ``1_feedforward_cmac/``."""
    return f"{number}_{re.sub('[^A-Za-z0-9.-]+', '_', label)}/"


def write_comparison(entries: Sequence[RunEntry], path: Path, names: Sequence[str] | None = None) -> str:
    """Write several runs into one recording, whole or not at all.

    Args:
        entries: at least two, each with a view of its own label and root.
        path: of the ``.rrd`` file.
        names: of the panels to show; None: the default ones.

    Returns:
        The name of the recording, which describes its content.
    """
    views = [entry.view for entry in entries]
    if len({view.window for view in views}) == 1:
        name = f"{' | '.join(view.label for view in views)}, {views[0].window}"
    else:
        name = " | ".join(f"{view.label}, {view.window}" for view in views)
    labels = {view.root + LABEL: f"**{view.label}**" for view in views}
    write_views(entries, _layout(views, names), name, path, labels)
    return name
