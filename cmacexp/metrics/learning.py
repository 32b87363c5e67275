"""How fast the cycles improve, each against the first, and whether they get worse again.

No row depends on later ones.
"""

from collections.abc import Mapping

import numpy as np

from cmacexp.metrics.drift import DRIFT_RATIO
from cmacexp.metrics.measures import divide
from cmacexp.metrics.metric import BRISTOW, MANN, MEAN, NEITHER, SEN, SMALL, SMALLEST, Metric, worst
from cmacexp.models.trend import WINDOW
from cmacexp.typing import Array

LEARNED = (
    "transfer_rmse_x",
    "transfer_rmse_y",
    "support_rmse_x",
    "force_rmse",
    "force_rmse_three_feet",
    "force_steady_state_error",
    "feedback_rms",
)
"""Metrics that learning should reduce."""
LEARNED_IN_SPACE = ("transfer_rmse", "joint_rmse")
"""Likewise, of a robot alone."""


def ratio_to_first(value: Array) -> Array:
    """Absolute ``value`` (cycles, L) over that of the first cycle; NaN where that is NaN or 0."""
    size = np.abs(value)
    return divide(size, size[:1])


def cycles_to_1_e(value: Array) -> Array:
    """Cycles after the first until ``value`` (cycles, L) is at most 1/e of the first, as known in each cycle.

    NaN before that cycle, then constant. For an error that decays as exp(-n/c) it is c rounded up: its time constant.
    """
    cycles = np.arange(len(value), dtype=float)[:, None]
    reached = np.where(ratio_to_first(value) <= np.exp(-1.0), cycles, np.nan)
    return np.fmin.accumulate(reached, axis=0)


def _make_columns(name: str) -> dict[str, Metric[Mapping[str, Array]]]:
    """Both columns of one metric: of ratios the mean, as each leg has its own scale; of cycles the slowest leg's."""
    return {
        f"{name}_ratio": Metric(
            "",
            f"abs({name}) over that of cycle 1, same leg",
            "either is, or that of cycle 1 is 0",
            lambda known: ratio_to_first(known[name]),
            MEAN,
            SMALL,
            source=BRISTOW,
        ),
        f"{name}_cycles_to_1_e": worst(
            "",
            f"cycles after the first until {name}_ratio is first at most 1/e",
            "not reached up to this cycle",
            lambda known: cycles_to_1_e(known[name]),
            source="time constant: Ogata 2010, section 5-2",
        ),
    }


LEARNING: dict[str, Metric[Mapping[str, Array]]] = {
    **{column: metric for name in LEARNED for column, metric in _make_columns(name).items()},
    "feedback_growth": worst(
        "",
        f"factor by which feedback_rms grows per cycle, over the last {WINDOW} cycles",
        f"the first {WINDOW - 1} cycles",
        lambda known: known["feedback_growth"],
        source=SEN,
    ),
    "drift_cycle": Metric(
        "",
        f"cycle since which feedback_rms drifts: it rises, and has risen to {DRIFT_RATIO:g} times its lowest level",
        "no drift named up to this cycle",
        lambda known: known["drift_cycle"],
        SMALLEST,
        NEITHER,
        source=f"rise: {MANN}",
    ),
}
"""Columns that follow from those of all cycles, by name."""
LEARNING_IN_SPACE: dict[str, Metric[Mapping[str, Array]]] = {
    column: metric for name in LEARNED_IN_SPACE for column, metric in _make_columns(name).items()
}
"""Likewise, of a robot alone."""
