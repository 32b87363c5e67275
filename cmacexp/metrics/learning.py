"""Whether the cycles get worse again: what :class:`cmacexp.metrics.drift.DriftDetector` finds, as columns."""

from collections.abc import Mapping

from cmacexp.metrics.drift import DRIFT_RATIO
from cmacexp.metrics.metric import MANN, NEITHER, SEN, SMALLEST, Metric, worst
from cmacexp.models.trend import WINDOW
from cmacexp.typing import Array

LEARNING: dict[str, Metric[Mapping[str, Array]]] = {
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
