"""What a figure shows, in words, for readers who do not see it."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOUR_BAR = "<colorbar>"
"""Label that matplotlib gives to the axes of a colour bar."""


def describe(figure: "Figure") -> str:
    """Its panels with their axes, and the names in its legends.

    >>> from cmacexp.report.figures import Panel, Series, draw
    >>> describe(draw([Panel("foot", "time, s", "depth, mm", [Series("a", [0], [1]), Series("b", [0], [2])])]))
    'foot: depth, mm over time, s. Legend: a; b.'
    """
    panels = [_describe_axes(axes) for axes in figure.axes if axes.get_label() != COLOUR_BAR and axes.axison]
    legends = [*figure.legends, *(own for axes in figure.axes if (own := axes.get_legend()))]
    names = dict.fromkeys(text.get_text() for legend in legends for text in legend.get_texts())
    count = f"{len(panels)} panels. " if len(panels) > 1 else ""
    return count + "; ".join(filter(None, panels)) + "." + (f" Legend: {'; '.join(names)}." if names else "")


def _describe_axes(axes: "Axes") -> str:
    title = axes.get_title(loc="left") or axes.get_title()
    x, y = axes.get_xlabel(), axes.get_ylabel()
    plane = f"{y} over {x}" if x and y else x or y
    return ": ".join(filter(None, (title, plane))).replace("\n", " ")
