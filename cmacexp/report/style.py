"""Style of all figures: legible in print and for colour-blind readers (Okabe & Ito 2008)."""

from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.recording import palette

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 7.2
"""Width of a figure, inches: the text width of a page."""
STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "figure.dpi": 160,
    "savefig.dpi": 160,
    "svg.hashsalt": "cmacexp",
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
}


def colour(rgb: tuple[int, ...]) -> str:
    """A colour of the palette in the notation of matplotlib."""
    return "#" + "".join(f"{part:02X}" for part in rgb)


DESIRED, GROUND = colour(palette.DESIRED), colour(palette.GROUND)
FEEDBACK, FEEDFORWARD = colour(palette.FEEDBACK), colour(palette.FEEDFORWARD)
SERIES = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of lines in one figure; each line also has its own dash or marker."""
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (7, 2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X")


def new_figure(rows: int = 1, columns: int = 1, height: float = 2.6, **options: Any) -> tuple["Figure", list["Axes"]]:
    """A figure in this style, and its axes row by row.

    Args:
        rows: of axes.
        columns: of axes.
        height: of one row, inches.
        options: of ``Figure.subplots``.
    """
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(STYLE)
    figure = Figure(figsize=(WIDTH, height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(np.ravel(axes))


def mark(index: int) -> dict[str, Any]:
    """Colour and dash of line number ``index``; no two of the first 49 are the same."""
    return {"color": SERIES[index % 7], "linestyle": DASHES[(index + index // 7) % 7]}


def label(axes: "Axes", title: str, x: str, y: str) -> None:
    """Title and named axes with their units, e.g. ``label(axes, "foot", "x forward, mm", "y down, mm")``."""
    axes.set_title(title)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
