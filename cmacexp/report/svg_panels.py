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


def _find_panels(figure: "Figure") -> list[tuple[Array, list[int]]]:
    """Extent (2, 2) of each panel, display units, as wide as its column and as high as its row; and its axes."""
    boxes = [np.asarray(axes.get_tightbbox()) for axes in figure.axes]
    specs = {n: spec for n, axes in enumerate(figure.axes) if (spec := axes.get_subplotspec()) is not None}
    if not specs:
        return [(np.array([[0.0, 0.0], figure.bbox.max]), list(range(len(boxes))))]
    own = {n: [n] for n in specs}
    for n in set(range(len(boxes))) - set(specs):  # a bar of colours, beside its map
        own[min(specs, key=lambda main: abs(boxes[main] - boxes[n])[1].sum())].append(n)
    extents = {main: np.array([boxes[n] for n in numbers]) for main, numbers in own.items()}
    found = []
    for main, spec in specs.items():
        ratios = np.asarray(spec.get_gridspec().get_width_ratios(), dtype=float)
        least = 0.96 * figure.bbox.width * ratios[spec.colspan.start] / ratios.sum()
        column = np.concatenate([extents[n] for n in specs if specs[n].colspan.start == spec.colspan.start])[..., 0]
        row = np.concatenate([extents[n] for n in specs if specs[n].rowspan.start == spec.rowspan.start])[..., 1]
        found.append(
            (np.array([[column.min(), row.min()], [max(column.max(), column.min() + least), row.max()]]), own[main])
        )
    return found


def extract_panels(figure: "Figure", drawn: str) -> str:
    """The pieces of a drawn figure as HTML; ``drawn`` is its SVG. Names of groups, which a page repeats, go."""
    plain = re.sub(r"\s*<!--.*?-->", "", drawn, flags=re.DOTALL)  # a blank line would end HTML in Markdown
    texts: dict[str, list[str]] = {"axes": [], "legend": []}
    for found in GROUPS.finditer(plain):
        texts[found["kind"]].append(re.sub(r'<g id="[^"]*"', "<g", found[0]))
    boxes = [legend.get_window_extent().get_points() for legend in figure.legends]
    pieces = [(box, "legend", text) for box, text in zip(boxes, texts["legend"], strict=True)]
    panels = _find_panels(figure)
    pieces += [(box, "panel", "".join(texts["axes"][n] for n in own)) for box, own in panels]
    definitions = "".join(DEFINITIONS.findall(plain))
    width, height = figure.get_size_inches() * POINTS
    columns = {round(box[0, 0]): np.ptp(box[:, 0]) * POINTS / figure.dpi + 2.0 * PAD for box, _ in panels}
    percent = 100.0 / max(width, 1.01 * sum(columns.values()))  # all columns fit into a row
    drawings = []
    for box, kind, text in pieces:
        (left, bottom), (right, top) = box * POINTS / figure.dpi + [[-PAD], [PAD]]
        view = f"{left:.1f} {height - top:.1f} {right - left:.1f} {top - bottom:.1f}"
        share = min(percent * (right - left), 100.0)
        drawings.append(f'<svg class="{kind}" style="--width:{share:.1f}" viewBox="{view}">{definitions}{text}</svg>')
        definitions = ""
    return "\n".join(drawings)
