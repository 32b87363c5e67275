"""Figures and table of the study of CMAC sizes: errors over layers, width of a cell, memory and collisions."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study import Results
from cmacexp.study.interval import estimate
from cmacexp.typing import Array
from pipelines.cmac_size_measures import ELEMENTS, LAYERS, MEMORY, SIDES, SIZE

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SHOWN = (5, 10, 20)
"""Cycles whose errors are shown, as far as they are run."""
KILOBYTE = 1024.0
AXES: dict[str, tuple[str, Callable[[Results], float]]] = {
    LAYERS: ("layers", lambda group: float(group.value(LAYERS))),
    ELEMENTS: (
        "width of a cell / planned span",
        lambda group: float(group.value("cmac.range_factor") / (group.value(ELEMENTS) - 1)),
    ),
    MEMORY: ("memory of a leg, KB", lambda group: group.value(MEMORY) / KILOBYTE),
}
"""Name and value of the axis of what is varied."""
Groups = Sequence[tuple[float, Results]]


def _series(name: str, groups: Groups, sample: Callable[[Results], Array]) -> Series:
    """Estimates with their intervals, if they have one; infinite ones, of runs that ended early, are left out."""
    found = [(x, estimate(sample(group))) for x, group in sorted(groups, key=lambda pair: pair[0])]
    kept = [(x, each) for x, each in found if np.isfinite([each.low, each.high]).all()]
    x, values = [x for x, _ in kept], [each for _, each in kept]
    spread = [each.method != "guard band" for each in values]
    low = [each.low if wide else each.value for each, wide in zip(values, spread, strict=True)]
    high = [each.high if wide else each.value for each, wide in zip(values, spread, strict=True)]
    band = (low, high) if any(spread) else (None, None)
    return Series(name, x, [each.value for each in values], *band)


def _over(results: Results, key: str) -> Groups:
    """The runs in which ``key`` is varied, by its value on the axis."""
    return [(AXES[key][1](group), group) for group in results.select(varied=key).by(key).values()]


def _at(cycle: int, name: str, results: Results) -> Array:
    return 1e3 * results.at(cycle, name)


def _end(name: str, results: Results) -> Array:
    return 1e3 * results.end(name)


def draw_sizes(results: Results, paper: Mapping[str, Any]) -> "Figure":
    """Errors in x and y over layers, width of a cell and memory; a line for each cycle."""
    cycles = [cycle for cycle in SHOWN if cycle <= results.value("cycles")]
    panels = []
    for side in SIDES:
        for key, (axis, place) in AXES.items():
            lines = [_series(f"cycle {c}", _over(results, key), partial(_at, c, side)) for c in cycles]
            limits = [place(results.select({"varied": key, key: paper[key]}))]
            panels.append(Panel(f"error in {side[-1]}", axis, "transfer error, mm", lines, log="xy", x_limits=limits))
    return draw(panels, columns=3, height=2.2)


def draw_collisions(results: Results) -> "Figure":
    """Share of cells that collide over memory, and errors over rows for each cell; a series for each layer count."""
    shares: list[Series] = []
    errors: dict[str, list[Series]] = {side: [] for side in SIDES}
    for layers, own in sorted(results.select(varied=[MEMORY, SIZE]).by(LAYERS).items()):
        groups, name = list(own.by(MEMORY).values()), f"{layers} layers"
        memories = [(AXES[MEMORY][1](group), group) for group in groups]
        shares.append(_series(name, memories, lambda r: 100.0 * r.measure("colliding")))
        rows = [(float(group.measure("rows_per_cell").mean()), group) for group in groups]
        for side in SIDES:
            errors[side].append(_series(name, rows, partial(_end, side)))
    panels = [Panel("collisions", AXES[MEMORY][0], "visited cells that collide, %", shares, log="x")]
    for side, lines in errors.items():
        axes = ("rows per visited cell", "error at the end, mm")
        panels.append(Panel(f"error in {side[-1]}", *axes, lines, log="xy", x_limits=[1.0]))
    return draw(panels, columns=3)


def draw_walk(results: Results, paper: Mapping[str, Any]) -> "Figure":
    """Errors and tilt at the end over memory."""
    panels = []
    for name, title, y in (
        (SIDES[0], "error in x", "error at the end, mm"),
        (SIDES[1], "error in y", "error at the end, mm"),
        ("tilt_max", "largest tilt", "tilt at the end, mrad"),
    ):
        line, limits = _series("", _over(results, MEMORY), partial(_end, name)), [paper[MEMORY] / KILOBYTE]
        panels.append(Panel(title, AXES[MEMORY][0], y, [line], log="xy", x_limits=limits))
    return draw(panels, columns=3)


def size_table(results: Results, early: int) -> "pd.DataFrame":
    """Every size: errors early and at the end, share of the torque, use of memory; means over seeds."""
    import pandas as pd

    names = []
    for row in results.rows:
        varied = row.settings["varied"]
        keys = [LAYERS, MEMORY] if varied == SIZE else [varied] if varied in row.settings else []
        size = ", ".join(f"{key}={row.settings[key]}" for key in keys) or varied
        names.append(size.replace("cmac.", ""))
    columns = {
        **{f"{side[-1]}, cycle {early}, mm": _at(early, side, results) for side in SIDES},
        **{f"{side[-1]}, end, mm": _end(side, results) for side in SIDES},
        "share of the CMAC, %": 100.0 * results.end("feedforward_share"),
        "rows per visited cell": results.measure("rows_per_cell"),
        "colliding, %": 100.0 * results.measure("colliding"),
    }
    return pd.DataFrame({"size": names, **columns}).groupby("size", sort=False).mean().reset_index()
