"""A figure in pieces for a page: its legends and each of its panels, which stand side by side or below each other.

A narrow screen then shows one panel in a row, and print can break a figure between two rows.
"""

import re
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GROUPS = re.compile(r'^  <g id="(?P<kind>axes|legend)_\d+">\n.*?^  </g>\n', re.DOTALL | re.MULTILINE)
DEFINITIONS = re.compile(r"^ <defs>.*?^ </defs>\n", re.DOTALL | re.MULTILINE)
POINTS = 72.0
"""In an inch; the unit of the drawing."""
PAD = 3.0
"""Around a piece, points."""


def _cells(figure: "Figure") -> list[tuple[Array, list[int]]]:
    """Extent (2, 2) of each panel of a grid, display units, and the numbers of its axes; one for what is no grid."""
    boxes = [np.asarray(axes.get_tightbbox()) for axes in figure.axes]
    places: dict[int, tuple[int, int]] = {}
    for number, axes in enumerate(figure.axes):
        if (spec := axes.get_subplotspec()) is not None:
            if len(spec.rowspan) > 1 or len(spec.colspan) > 1:
                return [(np.array([[0.0, 0.0], figure.bbox.max]), list(range(len(boxes))))]
            places[number] = spec.rowspan.start, spec.colspan.start
    own = {number: [number] for number in places}
    for number in set(range(len(boxes))) - set(places):  # a bar of colours, beside its map
        own[min(places, key=lambda main: abs(boxes[main] - boxes[number])[1].sum())].append(number)
    found = []
    for main, (row, column) in places.items():
        low, high = np.empty(2), np.empty(2)
        for axis, same in ((0, column), (1, row)):
            line = [n for other, place in places.items() if place[1 - axis] == same for n in own[other]]
            low[axis] = min(boxes[n][0, axis] for n in line)
            high[axis] = max(boxes[n][1, axis] for n in line)
        found.append((np.array([low, high]), own[main]))
    return found


def cut(figure: "Figure", drawn: str) -> str:
    """The pieces of a drawn figure as HTML; ``drawn`` is its SVG. Names of groups, which a page repeats, go."""
    plain = re.sub(r"<!--.*?-->", "", drawn, flags=re.DOTALL)
    groups = [(each["kind"], re.sub(r'<g id="[^"]*"', "<g", each[0])) for each in GROUPS.finditer(plain)]
    axes = [text for kind, text in groups if kind == "axes"]
    pieces = [
        (legend.get_window_extent().get_points(), "legend", text)
        for legend, text in zip(figure.legends, [t for kind, t in groups if kind == "legend"], strict=True)
    ]
    pieces += [(box, "panel", "".join(axes[number] for number in own)) for box, own in _cells(figure)]
    definitions = "".join(DEFINITIONS.findall(plain))
    width, height = figure.get_size_inches() * POINTS
    found = []
    for box, kind, text in pieces:
        (left, bottom), (right, top) = box * POINTS / figure.dpi + [[-PAD], [PAD]]
        view = f"{left:.1f} {height - top:.1f} {right - left:.1f} {top - bottom:.1f}"
        share = 100.0 * min((right - left) / width, 1.0)
        found.append(f'<svg class="{kind}" style="--width:{share:.1f}" viewBox="{view}">{definitions}{text}</svg>')
        definitions = ""
    return "\n".join(found)
