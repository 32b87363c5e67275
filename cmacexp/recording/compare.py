"""Several runs side by side in one recording: one column for each."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from cmacexp.recording.blueprint import make_blueprint, stack
from cmacexp.recording.panels import COLOURS, SPACE, Panel, Panels, describe_colours, describe_depression, panel_names
from cmacexp.recording.run_view import RunView
from cmacexp.recording.series import collect_series
from cmacexp.recording.write import write_views

MOST_RUNS = 6
"""Runs side by side at the most."""
FEW = 3
"""Of more walks side by side each column is too narrow for a plot for each leg."""
WIDE = 4
"""Of more runs side by side each column is too narrow for the usual distance of the eye."""
KEY, LABEL = "key", "label"
"""Entities of the texts that explain the colours and name the run of a column."""
ALIKE = 10.0
"""Plots share their vertical axis unless the range of one is so many times that of another."""


def shared_ranges(views: Sequence[RunView]) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of the plots that several runs have, by the name of the plot."""
    found: dict[str, list[tuple[float, float]]] = {}
    for view in views:
        for path, lines in collect_series(view).items():
            values = np.concatenate([line[1] for line in lines])
            values = values[np.isfinite(values)]
            if values.size:
                found.setdefault(path, []).append((float(values.min()), float(values.max())))
    shared = {}
    for path, ranges in found.items():
        spans = [high - low for low, high in ranges if high > low]
        if len(ranges) > 1 and spans and max(spans) <= ALIKE * min(spans):
            low, high = min(low for low, _ in ranges), max(high for _, high in ranges)
            shared[path] = (low - 0.05 * (high - low), high + 0.05 * (high - low))
    return shared


def _key(views: Sequence[RunView]) -> str:
    """The meaning of the colours and depressions of the scenes."""
    meanings = {describe_colours(view) for view in views}
    meaning = meanings.pop() if len(meanings) == 1 else COLOURS.format("first cycle orange, last cycle green")
    return meaning + (describe_depression(views[0]) if _one_depression(views) else "")


def _one_depression(views: Sequence[RunView]) -> bool:
    return len({describe_depression(view) for view in views}) == 1


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
    ranges = shared_ranges(views)
    times = min(float(view.time[0]) for view in views), max(float(view.time[-1]) for view in views)
    columns = []
    for number, view in enumerate(views):
        first = view.walks not in [earlier.walks for earlier in views[:number]]
        title = view.label if _one_depression(views) else view.label + describe_depression(view)
        shown = [name for name in names or _usual(view, len(views)) if name in panel_names(view.walks)]
        columns.append(_column(view, Panels(view, title, ranges, times, max(1.0, len(views) / WIDE), first), shown))
    content = rrb.Horizontal(*columns)
    if names is not None and not set(names) & set(SPACE):
        return make_blueprint(content)
    return make_blueprint(
        rrb.Vertical(rrb.TextDocumentView(origin=KEY, titlebar=False), content, row_shares=[1.0, 20.0])
    )


def make_root(number: int, label: str) -> str:
    """Prefix of the paths of the entities of a run; ``1_feedforward_cmac/``."""
    return f"{number}_{re.sub('[^A-Za-z0-9.-]+', '_', label)}/"


def write_comparison(views: Sequence[RunView], path: Path, names: Sequence[str] | None = None) -> str:
    """Write several runs into one recording, whole or not at all.

    Args:
        views: at least two, each with its own label and root.
        path: of the ``.rrd`` file.
        names: of the panels to show; None: the default ones.

    Returns:
        The name of the recording, which describes its content.
    """
    if len({view.window for view in views}) == 1:
        name = f"{' | '.join(view.label for view in views)}, {views[0].window}"
    else:
        name = " | ".join(f"{view.label}, {view.window}" for view in views)
    texts = {KEY: _key(views), **{view.root + LABEL: f"**{view.label}**" for view in views}}
    write_views(views, _layout(views, names), name, path, texts)
    return name
