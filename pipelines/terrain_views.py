"""What the study of changing ground measures, draws and tabulates."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.study import Panel, Results, draw, over_cycles, over_setting
from cmacexp.study.interval import estimate
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

CMAC, FEEDBACK = "CMAC", "feedback alone"
UNCHANGED, INFORMED = "CMAC, no change", "CMAC, plan knows"
"""The walks of a change, by the label ``walk``."""
WITHIN = 1.2
"""An error that stays within this factor of a level has come back to it."""
METRICS = {
    "force_rmse": ("force error in support", "N", 1.0),
    "force_rmse_cycle": ("force error", "N", 1.0),
    "transfer_rmse_x": ("transfer error in x", "mm", 1e3),
    "transfer_rmse_y": ("transfer error in y", "mm", 1e3),
    "tilt_max": ("tilt", "mrad", 1e3),
}
"""Words, unit and factor from SI units."""
LEG_METRICS = ("transfer_rmse_x", "transfer_rmse_y", "force_rmse")
WALK_METRICS = ("force_rmse_cycle", "transfer_rmse_y", "tilt_max")
GROUND_METRICS = ("force_rmse_cycle", "tilt_max")


def walked(run: StoredRun) -> float:
    """Share of the planned time that a run lasted."""
    return float(run.manifest["steps"] / (run.steps_per_cycle * run.config["cycles"]))


def force_metric(results: Results) -> str:
    """The force error of one leg in support, or of a quadruped over the cycle."""
    return "force_rmse" if results.value("scenario") == "one_leg" else "force_rmse_cycle"


def end_ratio(results: Results, metric: str, other: str) -> Array:
    """(seeds,): a metric at the end of the walks with CMAC over that of other walks; both by seed, or one for all."""
    ratio: Array = results.select(walk=CMAC).end(metric) / results.select(walk=other).end(metric)
    return ratio


def cycles_until(errors: Array, level: float, change: int) -> float:
    """Cycles after the first ``change`` until an error (cycles,) stays within WITHIN times a level; inf: never.

    >>> cycles_until(np.array([1.0, 8.0, 1.1, 4.0, 1.1, 1.0]), 1.0, 1)
    3.0
    """
    outside = np.flatnonzero(~(errors[change:] <= WITHIN * level))
    if not len(outside):
        return 0.0
    return float(outside[-1] + 1) if outside[-1] + 1 < len(errors) - change else np.inf


def change_cycle(changed: Results) -> int:
    """Cycles before the change of a run."""
    config = changed.run.config
    step = config["terrain"]["step_time"]
    time = config["payload"]["time"] if step is None else step
    return round(float(time) / float(config["gait"]["cycle_time"]))


def _over_cycles(results: Results, metric: str, title: str) -> Panel:
    words, unit, _ = METRICS[metric]
    shown = results.select(walk=[CMAC, FEEDBACK, UNCHANGED])
    panel = over_cycles(shown, metric, "walk", log="y")
    return replace(panel, title=title, y=f"{words}, {unit}", x_limits=[change_cycle(shown.select(walk=CMAC)) + 0.5])


def draw_leg(results: Results) -> "Figure":
    """One leg: errors over the cycles around the change of its ground."""
    leg = results.select(change="leg")
    return draw([_over_cycles(leg, metric, METRICS[metric][0]) for metric in LEG_METRICS], columns=3)


def draw_walk(results: Results, titles: dict[str, str]) -> "Figure":
    """The quadruped: a row for each error, a column for each change, with its title."""
    panels = [
        _over_cycles(results.select(change=change), metric, title)
        for metric in WALK_METRICS
        for change, title in titles.items()
    ]
    return draw(panels, columns=len(titles), height=1.9)


def _end(results: Results, metric: str) -> Array:
    """(runs,): a metric at the end, in the unit that is shown."""
    return METRICS[metric][2] * results.end(metric)


def draw_ground(results: Results, ground: str, key: str, name: str, tilt: float | None = None) -> "Figure":
    """Force error and tilt at the end over what the ground is like; a dotted line at a tilt, rad."""
    own = results.select(ground=ground)
    panels = []
    for metric in GROUND_METRICS:
        words, unit, factor = METRICS[metric]
        panel = over_setting(own, key, f"{words}, {unit}", partial(_end, metric=metric), by="walk", title=words)
        limits = [factor * tilt] if tilt and metric == "tilt_max" else []
        panels.append(replace(panel, x=name, y_limits=limits))
    return draw(panels)


def table_changes(results: Results, words: dict[str, str]) -> "pd.DataFrame":
    """Every error around every change: of the CMAC, and of the walks that it is compared with."""
    import pandas as pd

    rows = []
    for change, title in words.items():
        walks = results.select(change=change).by("walk")
        before, changed = change_cycle(walks[CMAC]), walks[CMAC]
        for metric in LEG_METRICS if change == "leg" else WALK_METRICS:
            name, unit, factor = METRICS[metric]
            ends = {walk: factor * estimate(own.end(metric)).value for walk, own in walks.items()}
            histories = [factor * history for history in changed.history(metric)]
            slowest = max(cycles_until(each, ends[UNCHANGED], before) for each in histories)
            rows.append(
                {
                    "change": title,
                    "error": f"{name}, {unit}",
                    "largest since": max(float(np.max(each[before:], initial=0.0)) for each in histories),
                    **{walk: ends.get(walk) for walk in (CMAC, UNCHANGED, INFORMED, FEEDBACK)},
                    "cycles to recover": f"{slowest:g}" if np.isfinite(slowest) else "never",
                    "completed": f"{sum(changed.completed)} of {len(changed)}",
                }
            )
    return pd.DataFrame(rows)


def table_ground(results: Results, ground: str, key: str, name: str) -> "pd.DataFrame":
    """How walks end on each ground."""
    import pandas as pd

    rows = []
    for value, group in sorted(results.select(ground=ground).by(key).items()):
        for walk, own in group.by("walk").items():
            force, tilt = (estimate(_end(own, metric)) for metric in GROUND_METRICS)
            rows.append(
                {
                    name: f"{value:g}",
                    "walk": walk,
                    "completed": f"{sum(own.completed)} of {len(own)}",
                    "planned time walked, %": 100.0 * float(own.measure("walked").mean()),
                    "force error, N": force.value,
                    "tilt, mrad": tilt.value,
                }
            )
    return pd.DataFrame(rows)
