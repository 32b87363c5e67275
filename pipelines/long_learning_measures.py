"""What the study of long learning measures: errors at the end, how runs end, drift, and predicted growth."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from cmacexp.data.run import Run, read_config
from cmacexp.metrics.final import TRANSFER
from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import (
    GROWTH_CYCLES,
    MAX_CYCLES_BEFORE,
    SETTLING_CYCLES,
    calmest,
    fitted_growth,
    predicted_growth,
)
from cmacexp.study import DataFrame, Results
from cmacexp.study.quantity import compute_quantity
from cmacexp.study.results import RunRow
from cmacexp.typing import Array

SMOOTHED = 10
"""Cycles of each median of which errors vary."""
LAST = 100
"""Cycles whose median is the error at the end."""
FORCE = "force_rmse_cycle"
MIN_GROWTH_RATIO = 2.0
"""A change at least this many times the least one counts as growth."""
SHARE_LEFT_OUT = 0.05
"""Share of the cycles that are left out at the end of a run that did not complete: nothing is small there."""
PAPER = {"learning.rule": "paper"}
LEG, WALK, GRID = "one leg", "quadruped", "paper's world"


def final(results: Results, name: str = TRANSFER) -> Array:
    """(runs,): final value of an error; infinite of a run that ended before."""
    return results.end(name, LAST)


def variation(results: Results, name: str = TRANSFER) -> Array:
    """(runs,): largest error over the least in the second half; infinite of a run that ended before.

    Of medians over :data:`SMOOTHED` cycles, since noise alone varies the error of single cycles.
    """
    halves = [row.history(name)[row.run.cycles_done // 2 :] if row.run.completed else None for row in results.rows]
    return np.array([np.inf if half is None else _spread(half) for half in halves])


def _spread(errors: Array) -> float:
    medians = np.median(sliding_window_view(errors, min(SMOOTHED, len(errors))), axis=1)
    return float(medians.max() / medians.min())


def learning_lead(run: Run) -> float:
    """The lead that a run learnt with, also where the config says ``auto``; NaN if nothing learnt."""
    lead = run.manifest.get("learning_lead")
    return np.nan if lead is None else float(lead)


def one_too_short(results: Results) -> Array:
    """(runs,): share done by runs whose lead is one less than the ``auto`` of their world and delay."""
    right = {_place(row): row.measures["lead"] for row in results.select({"learning.lead": "auto"}).rows}
    fixed = [row for row in results.rows if row.settings["learning.lead"] != "auto"]
    return compute_quantity("done", Results([row for row in fixed if row.measures["lead"] == right[_place(row)] - 1]))


def _place(row: RunRow) -> tuple[int, int]:
    return int(row.settings["seed"]), int(row.settings["actuator.delay"])


def detected(run: Run) -> float:
    """Cycle in which drift was detected; infinite if it was not."""
    drift = run.manifest["drift"]
    return float(drift["named"]) if drift else np.inf


def detected_if_ended(results: Results) -> list[bool]:
    """Of each run that ended before its time, whether drift was detected."""
    return [bool(np.isfinite(row.measures["detected"])) for row in results.rows if not row.run.completed]


def error_when_detected(results: Results) -> list[float]:
    """Of each such run with drift: the error in the cycle of detection over the least up to it."""
    drifted = [row for row in results.rows if not row.run.completed and np.isfinite(row.measures["detected"])]
    errors = [row.history(TRANSFER)[: int(row.measures["detected"])] for row in drifted]
    return [float(each[-1] / each.min()) for each in errors]


def growth(results: Results) -> DataFrame:
    """Growth of the feedback per cycle, ``predicted`` and ``measured``; NaN where a run is too short for it.

    In the paper's world: of its rule for every machine, lead and seed; of other rules for one leg and one seed.
    """
    import pandas as pd

    chosen = results.select(part=GRID).rows
    keys = {"machine": "machine", "rule": "learning.rule", "lead": "learning.lead", "seed": "seed"}
    return pd.DataFrame(
        {name: row.settings[key] for name, key in keys.items()}
        | dict(zip(("predicted", "measured"), predict_and_measure(row), strict=True))
        for row in chosen
    )


class Stretch(NamedTuple):
    """The cycles over which growth is read."""

    calm: int
    """The cycle before them where the loop is linearised, in cycles done."""
    first: int
    last: int


def stretch(sizes: Sequence[float] | Array, first: int, completed: bool) -> Stretch:
    """Choose where to read growth: from the calmest cycle on if changes grow after it, else early on.

    Args:
        sizes: (n,), of the change from each cycle to the next, the first that of cycle 1.
        first: cycle in which the feedforward begins to act.
        completed: whether the run reached its end.
    """
    last = len(sizes) if completed else len(sizes) - max(2, round(SHARE_LEFT_OUT * len(sizes)))
    calm = calmest(sizes[:last], first) if last > first else first
    grows = last > calm and bool(sizes[last - 1] > MIN_GROWTH_RATIO * sizes[calm - 1])
    if not grows:
        calm = min(first + MAX_CYCLES_BEFORE, (first + last) // 2)
    start = calm + SETTLING_CYCLES if last > calm + 2 * SETTLING_CYCLES else calm + 1
    return Stretch(calm, start, min(start + GROWTH_CYCLES, last))


def growth_over(sizes: Sequence[float] | Array, place: Stretch) -> float:
    """Growth per cycle of the changes over a stretch; NaN where it is too short."""
    return fitted_growth(sizes[place.first - 1 : place.last])


def predict_and_measure(row: RunRow) -> tuple[float, float]:
    """Growth per cycle, predicted and measured, of the change of the feedback up to where it is rounding."""
    change = row.history("feedback_change")[1:]
    still = np.flatnonzero(change < 1e-9 * change.max(initial=0.0))  # below it is rounding
    change = change[: still[0]] if len(still) else change
    first = int(row.settings["learning.start_cycle"])
    if len(change) < first + 3:
        return np.nan, np.nan
    place = stretch(change, first, row.run.completed)
    try:
        prediction = predicted_growth(read_config(row.run), place.calm)
    except NotPredictable:
        return np.nan, growth_over(change, place)
    return prediction.over(place.first, place.last), growth_over(change, place)


def growth_known(results: Results, machine: str) -> DataFrame:
    """Growths of a machine that are both predicted and measured, and how far the prediction ``misses``."""
    known = results.computed["growth"].dropna(subset=["predicted", "measured"])
    return known[known["machine"] == machine].assign(misses=known["predicted"] - known["measured"])


def growth_miss(results: Results, machine: str) -> list[float]:
    """(seeds,): largest distance of predicted from measured growth over the leads, under the paper's rule."""
    known = growth_known(results, machine)
    own = known[known["rule"] == PAPER["learning.rule"]]
    missed: list[float] = own["misses"].abs().groupby(own["seed"]).max().tolist()
    return missed
