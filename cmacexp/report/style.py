"""Style of all figures, legible in print and for colour-blind readers (Okabe & Ito 2008): axes, legends, machines."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cmacexp.recording import palette
from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array, Axes, Figure, Mask

WIDTH = 7.2
"""Width of a figure, inches; equals the text width of a page."""
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
    "svg.hashsalt": "cmacexp",
    "svg.fonttype": "none",  # text stays text: it can be searched, read aloud and edited
    "path.simplify_threshold": 0.2,
}

SERIES = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of lines in one figure; each line also has its own dash or marker."""
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 1)), (0, (7, 2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
LEAST_SPAN = 0.05
"""Smallest span of an axis that does not include zero, as a fraction of the largest absolute value."""
DECADES = 20.0
"""Ratio of largest to smallest positive value above which an axis is logarithmic."""
LEAST_RATIO = 5.0
"""Ratio below which a logarithmic axis has evenly spaced ticks, since ticks at 1, 2 and 5 would be too few."""
LINE_CHARACTERS = 76
"""Characters in a line of a legend, about as wide as a panel of half the page, or as the page on a phone."""


def colour(rgb: tuple[int, ...]) -> str:
    """Return a colour of the palette, RGB from 0 to 255, in the notation of matplotlib."""
    return "#" + "".join(f"{channel:02X}" for channel in rgb)


DESIRED = colour(palette.DESIRED)
GROUND = colour(palette.GROUND)
MM = 1e3
DENT = 26.0
"""Half the length of the dent below a foot, mm."""
NEAR = colour(palette.THIGH)
FAR = "#AEB9C6"
ALOFT = colour(palette.TRANSFER)
BODY_THICKNESS = 24.0
"""Thickness of the body in a drawing, mm."""


def mark(index: int) -> dict[str, Any]:
    """Return colour and dash of line number ``index``; the first 49 lines all differ."""
    return {"color": SERIES[index % 7], "linestyle": DASHES[(index + index // 7) % 7]}


def nested(index: int, count: int) -> dict[str, Any]:
    """Return the width of line ``index`` of ``count``; the first is the widest, to show behind the others."""
    return {"linewidth": 1.2 + 2.0 * (count - 1 - index) / max(count - 1, 1)}


def _select_finite(values: Sequence[float] | Array) -> Array:
    """Select the values that are neither NaN nor infinite."""
    array = np.asarray(values, dtype=float)
    return array[np.isfinite(array)]


def include_zero(axes: Axes, values: Sequence[float] | Array, from_zero: bool = True) -> None:
    """Extend a linear y axis so that it does not exaggerate differences between the ``values``.

    It then includes zero or, if not ``from_zero``, spans at least :data:`LEAST_SPAN` of the largest absolute value.
    """
    finite = _select_finite(values)
    if not finite.size or axes.get_yscale() != "linear":
        return
    middle = (finite.min() + finite.max()) / 2.0
    half = LEAST_SPAN * np.abs(finite).max() / 2.0
    included = [0.0] if from_zero else [middle - half, middle + half]
    axes.update_datalim([(0.0, value) for value in included], updatex=False)
    axes.autoscale_view(scalex=False)


def spans_decades(values: Sequence[float] | Array) -> bool:
    """Check whether no value is negative, and the positive ones span a ratio of more than :data:`DECADES`."""
    finite = _select_finite(values)
    positive = finite[finite > 0]
    return bool(positive.size and finite.min() >= 0 and positive.max() > DECADES * positive.min())


def logarithmic(axes: Axes, which: str, values: Sequence[float] | Array) -> None:
    """Make the ``x`` or ``y`` axis logarithmic, with plain numbers at its ticks; only positive values are drawn."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

    finite = _select_finite(values)
    ratio = finite.max() / finite[finite > 0].min()
    (axes.set_xscale if which == "x" else axes.set_yscale)("log", nonpositive="mask")
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if ratio < 1e2 else (1.0,)))
    if ratio < LEAST_RATIO:
        axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10]))
        axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def as_plain(text: str) -> str:
    """Escape ``$`` in a text, so that matplotlib does not parse a formula, which could fail."""
    return text.replace("$", r"\$")


def add_legend(figure: Figure, axes: Sequence[Axes], title: str = "") -> None:
    """Add a legend of all names in ``axes`` below the figure, unless there is only one name and no title."""
    handles = {name: handle for ax in axes for handle, name in zip(*ax.get_legend_handles_labels(), strict=True)}
    if len(handles) < 2 and not title:
        return
    most = max(1, min(7, LINE_CHARACTERS // (8 + max(map(len, handles), default=1))))
    columns = -(-len(handles) // max(-(-len(handles) // most), 1))  # rows of equal length
    layout: dict[str, Any] = {"loc": "outside lower center", "ncols": max(columns, 1), "handlelength": 3}
    figure.legend(list(handles.values()), list(map(as_plain, handles)), title=as_plain(title) or None, **layout)


def in_travel(view: RunView, points: Array) -> Array:
    """Transform points (steps, ..., 3), m, from the body frame to a level frame that moves with the body; mm.

    Its origin is the projection of the body on the plane z = 0.
    """
    travel = (view.compute_position() * [1.0, 1.0, 0.0]).reshape(-1, *[1] * (points.ndim - 2), 3)
    return MM * (view.in_world(points) - travel)


def joints(view: RunView) -> Array:
    """Return joints and foot of each leg, (steps, legs, joints + 1, 3), in the frame of :func:`in_travel`, mm."""
    return in_travel(view, view.joints)


def draw_machine(axes: Axes, legs: Array, near: Mask, aloft: Mask) -> None:
    """Draw a machine from its right side, with a body if it has several legs.

    Args:
        axes: axes with equal scales, mm.
        legs: joints and foot of each leg, (L, n, 2), mm.
        near: mask (L,) of the legs on the near side; the others are paler.
        aloft: mask (L,) of the legs in transfer, which are light blue.
    """
    for points, is_near, is_aloft in zip(legs, near, aloft, strict=True):
        ink = ALOFT if is_aloft else NEAR if is_near else FAR
        order = 4 if is_near else 2
        axes.plot(*points.T, color=ink, lw=3.0 if is_near else 2.4, solid_capstyle="round", zorder=order)
        axes.plot(*points[:-1].T, "o", ms=4.5, color="white", mec=ink, mew=1.3, zorder=order + 0.5)
        axes.plot(*points[-1], "o", ms=5.5, color=ink, zorder=order + 0.5)
    if len(legs) > 1:
        hips = legs[:, 0]
        ends = hips[[hips[:, 0].argmin(), hips[:, 0].argmax()]] + [0.0, BODY_THICKNESS / 2.0]
        for ink, width in ((NEAR, 9.0), (colour(palette.BODY_COLOR), 7.0)):
            axes.plot(*ends.T, color=ink, lw=width, solid_capstyle="round", zorder=3.5)
