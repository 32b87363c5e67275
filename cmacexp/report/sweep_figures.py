"""Figures of several runs: metrics over the cycles and over the swept keys, and the last cycles side by side."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.metrics.registry import JUDGED, MAIN
from cmacexp.metrics.text import format_number, format_setting
from cmacexp.report.curves import is_numeric, over_cycles, over_setting
from cmacexp.report.cycle_data import MOST_CYCLES, CycleData, read_cycle_data
from cmacexp.report.figures import DESIRED_LINE, STOPPED, Panel, Series, draw
from cmacexp.report.parts import Drawing
from cmacexp.report.run_figures import CLOCK
from cmacexp.report.run_summary import RunSummary
from cmacexp.typing import Array

MOST_LINES = 12
"""Runs that have a line each in learning curves; more are grouped by the swept value."""
MOST_FAMILY = 7
"""Values of a second key that have a line each."""
LARGER = 3.0
"""Curves that reach further than so many times the usual one are cut off, so that the others stay visible."""


def make_file_name(key: str) -> str:
    """A config key as part of the name of a file."""
    return key.replace(".", "-").replace("_", "-").strip("-")


def group_by(runs: Sequence[RunSummary], key: str) -> dict[Any, list[RunSummary]]:
    """Runs by the value of a config key; numbers in their order."""
    groups: dict[Any, list[RunSummary]] = {}
    for run in runs:
        groups.setdefault(run.config.get(key), []).append(run)
    return {value: groups[value] for value in sorted(groups)} if is_numeric(list(groups)) else groups


def draw_learning_curves(runs: Sequence[RunSummary], names: Sequence[str], keys: Sequence[str]) -> list[Drawing]:
    """The main metrics per cycle, a line for each run that has a whole one; none if no run has two.

    Args:
        runs: with results.
        names: of the runs, for the legend.
        keys: that were swept; of many runs each of the first two has a figure with a line for each of its values.
    """
    begun = {name: [run] for name, run in zip(names, runs, strict=True) if run.cycles}
    shown = [run for (run,) in begun.values()]
    if max((run.cycles for run in shown), default=0) < 2:
        return []
    if len(shown) > MOST_LINES:
        caption = "Metrics of each whole cycle: the median of all runs with the same"
        return [
            Drawing(f"learning-{make_file_name(key)}", _draw_learning(group_by(shown, key), key), f"{caption} {key}.")
            for key in keys[:2]
        ]
    stopped = any(run.status != "completed" for run in shown)
    crosses = " A cross: the run fell or diverged in the next cycle." if stopped else ""
    caption = f"Metrics of each whole cycle, one line for each run.{crosses}"
    return [Drawing("learning", _draw_learning(begun), caption)]


def _draw_learning(groups: Mapping[Any, Sequence[RunSummary]], title: str = "") -> Any:
    runs = [run for own in groups.values() for run in own]
    panels = []
    for name in JUDGED:
        if not any(run.shows(name) and np.isfinite(run.final(name)) for run in runs):
            continue
        histories = {value: [_history(run, name) for run in own] for value, own in groups.items()}
        panel = replace(over_cycles(name, histories), title=f"{MAIN[name].title} ({name})")
        ends = [] if title else [run for run in runs if run.status != "completed"]
        last = [MAIN[name].factor * _history(run, name)[-1] for run in ends]
        crosses = [Series("fell or diverged", [run.cycles for run in ends], last, style=STOPPED)] if ends else []
        panels.append(replace(panel, series=[*panel.series, *crosses]))
    return draw(panels, legend_title=title)


def _history(run: RunSummary, name: str) -> Array:
    undefined = np.full(run.cycles, np.nan)
    return run.metrics.get(name, undefined) if run.shows(name) else undefined


def _varies(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size and np.ptp(known) > 1e-9 * np.abs(known).max())


def draw_over_key(runs: Sequence[RunSummary], key: str, keys: Sequence[str]) -> list[Drawing]:
    """The main metrics over a swept key: final and best, or with a second key a line for each of its values.

    Args:
        runs: with results.
        key: the one on the axis.
        keys: all that were swept.
    """
    ended = [run for run in runs if run.status == "completed"]
    values = list(group_by(runs, key))
    others = [other for other in keys if other != key]
    second = others[0] if len(others) == 1 and len(group_by(ended, others[0])) <= MOST_FAMILY else ""
    lines = {"last cycle": RunSummary.final}
    if any(run.cycles > 1 for run in ended):
        lines["best cycle"] = RunSummary.best
    stopped: list[Any] = [run.config.get(key) for run in runs if run.status != "completed"]
    panels = []
    for name in JUDGED:
        if not all(run.shows(name) for run in ended) or not _varies(np.array([run.final(name) for run in ended])):
            continue
        if second:
            groups = {
                value: _over(own, key, name, RunSummary.final) for value, own in group_by(ended, second).items()
            }
        else:
            groups = {line: _over(ended, key, name, take) for line, take in lines.items()}
        shown, numeric = MAIN[name], is_numeric(values)
        labels = f"{shown.title} ({name})", f"{shown.title}, {shown.unit}"
        panel = over_setting(
            {line: samples for line, samples in groups.items() if samples}, key, labels[1],
            kind="lines" if numeric else "scatter", log=None, title=labels[0], order=values,
        )  # fmt: skip
        crosses = stopped if numeric else [panel.ticks.index(format_setting(value)) for value in stopped]
        panels.append(replace(panel, from_zero=shown.from_zero, crosses=crosses))
    if not panels:
        return []
    caption = f"Metrics of the last cycle over {key}, a line for each {second}" if second else f"Metrics over {key}"
    rest = [other for other in others if other != second]
    also = f"; {', '.join(rest)} also varies: values are means, bands are the range" if rest else ""
    return [Drawing(f"over-{make_file_name(key)}", draw(panels, legend_title=second), f"{caption}{also}.")]


def _over(runs: Sequence[RunSummary], key: str, name: str, take: Any) -> dict[Any, Array]:
    """Defined values of a metric in the unit that is shown, by the value of a key."""
    samples = {
        value: np.array([MAIN[name].factor * take(run, name) for run in own])
        for value, own in group_by(runs, key).items()
    }
    known = {value: sample[np.isfinite(sample)] for value, sample in samples.items()}
    return {value: sample for value, sample in known.items() if sample.size}


def shared_limits(curves: Sequence[Array]) -> tuple[float, float]:
    """Limits of an axis that shows all curves but those that reach :data:`LARGER` times as far as the usual one.

    >>> shared_limits([np.array([-1.0, 1.0]), np.array([0.0, 1.2]), np.array([-90.0, 90.0])])
    (-1.0, 1.2)
    """
    reach = [float(np.abs(curve).max()) for curve in curves]
    most = LARGER * sorted(reach)[(len(reach) - 1) // 2]
    shown = np.concatenate([curve for curve, far in zip(curves, reach, strict=True) if far <= most])
    return float(shown.min()), float(shown.max())


def draw_side_by_side(runs: Sequence[RunSummary], names: Sequence[str]) -> list[Drawing]:
    """Force and errors of leg 1 over the last whole cycle of each run; none for runs of different machines
    or too many runs for one figure.

    Args:
        runs: with results.
        names: of the runs.
    """
    begun = [(run, name) for run, name in zip(runs, names, strict=True) if run.cycles]
    machines = {(run.config["scenario"], run.config["gait.cycle_time"]) for run, _ in begun}
    if not 1 < len(begun) <= MOST_CYCLES or len(machines) > 1:
        return []
    shown = {}
    for run, name in begun:
        end = f", {run.status}" if run.status != "completed" else ""
        shown[f"{name} (cycle {run.cycles}{end})"] = read_cycle_data(StoredRun(run.folder), [run.cycles])
    axes = "yx" if any(data.moves_along_x for data in shown.values()) else "y"
    return [_draw_beside(shown, name) for name in ("force", *axes)]


def _draw_beside(shown: Mapping[str, CycleData], name: str) -> Drawing:
    title, y, unit = f"Error along {name}", f"{name} - desired", "mm"
    if name == "force":
        title, y, unit = "Contact force", "force", "N"
    rows = {run: data.select(data.cycles[0], 1) for run, data in shown.items()}
    curves = {
        run: np.asarray(own["force"]) if name == "force" else shown[run].error(own, name) for run, own in rows.items()
    }
    low, high = shared_limits(list(curves.values()))
    margin = 0.06 * (high - low or 1.0)
    x_range = (0.0, max(data.duration for data in shown.values()))
    y_range = (min(low, 0.0) - margin, max(high, 0.0) + margin)
    panels = []
    for run, data in shown.items():
        clock, far = data.time_in_cycle(rows[run]), float(np.abs(curves[run]).max())
        series = [Series("actual", clock, curves[run])]
        if name == "force":
            series.append(Series("desired", clock, rows[run]["force_desired"], style=DESIRED_LINE))
        note = f"cut off: reaches {format_number(far, unit)}" if far > max(abs(low), abs(high)) else ""
        panels.append(Panel(run, CLOCK, f"{y}, {unit}", series, x_range=x_range, y_range=y_range, note=note))
    leg = " of leg 1" if any(data.legs > 1 for data in shown.values()) else ""
    caption = f"{title}{leg} over the last whole cycle of each run, on the same axes."
    return Drawing(f"side-by-side-{name}", draw(panels, height=1.9, share="xy"), caption)
