"""Metrics of a body per cycle: pure functions of its trace."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cmacexp.data.trace import Trace
from cmacexp.metrics.metric import (
    BODY_POOLING,
    CONTRACT,
    LARGE,
    MCGHEE_FRANK,
    NEITHER,
    SMALL,
    Metric,
    MetricDisplay,
    to_table,
)
from cmacexp.typing import Array


class BodyBlock(NamedTuple):
    """The trace of a body and the steps at which its cycles start."""

    body: Trace
    starts: NDArray[np.intp]

    def reduce(self, by: np.ufunc, column: str) -> Array:
        """One value per cycle."""
        return np.asarray(by.reduceat(self.body[column], self.starts))


BodyMetric = Metric[BodyBlock]


def _largest_tilt(block: BodyBlock) -> Array:
    ends = [np.abs(block.reduce(by, name)) for by in (np.minimum, np.maximum) for name in ("pitch", "roll")]
    return np.asarray(np.maximum.reduce(ends))


def _height(which: str, symbol: str, compute: Callable[[BodyBlock], Array], main: bool = False) -> BodyMetric:
    shown = MetricDisplay("height" if main else f"{which} height", "mm", 1e3, main, from_zero=False, symbol=symbol)
    return Metric("m", f"{which} height of the body", "never", compute, BODY_POOLING, NEITHER, shown)


def _margin(column: str, title: str = "", symbol: str = "", main: bool = False) -> BodyMetric:
    """The least of a margin; shown if it has a ``title``."""
    known, _, side = column.rpartition("margin")
    to = side.removeprefix("_") or "nearest edge"
    of, undefined = "planned support polygon", "never three feet down"
    if known.startswith("true"):
        of, undefined = "polygon of the feet that carry load", "never three feet carry"
    meaning = f"least margin to the {to} of the {of}; negative: the centre of gravity is outside it"
    shown = MetricDisplay(title, "mm", 1e3, main, symbol=symbol) if title else None
    source = CONTRACT if side else MCGHEE_FRANK
    return Metric("m", meaning, undefined, lambda b: b.reduce(np.fmin, column), BODY_POOLING, LARGE, shown, source)


def _mean_height(block: BodyBlock) -> Array:
    return block.reduce(np.add, "height") / np.diff([*block.starts, block.body.steps])


_TILT = "largest of abs(pitch) and abs(roll)"

BODY_METRICS: dict[str, BodyMetric] = {
    "height_mean": _height("mean", "h", _mean_height, main=True),
    "height_min": _height("least", "h_min", lambda b: b.reduce(np.minimum, "height")),
    "height_max": _height("largest", "h_max", lambda b: b.reduce(np.maximum, "height")),
    "tilt_max": Metric("rad", _TILT, "never", _largest_tilt, BODY_POOLING, SMALL, MetricDisplay("tilt", "mrad", 1e3)),
    "stability_margin_min": _margin("stability_margin", "planned margin", "S_p"),
    "margin_front_min": _margin("margin_front"),
    "margin_rear_min": _margin("margin_rear", "planned rear margin", "S_pr"),
    "true_stability_margin_min": _margin("true_stability_margin", "true margin", "S", main=True),
    "true_margin_front_min": _margin("true_margin_front"),
    "true_margin_rear_min": _margin("true_margin_rear"),
}
"""All columns of ``body_metrics.parquet`` but ``cycle``, in their order."""


def compute_body(body: Trace, steps_per_cycle: int, first_cycle: int = 1) -> pa.Table:
    """One row per cycle, the columns of :data:`BODY_METRICS`; the last cycle may be short."""
    block = BodyBlock(body, np.arange(0, body.steps, steps_per_cycle))
    values = {name: metric.compute(block) for name, metric in BODY_METRICS.items()}
    cycles = np.arange(first_cycle, first_cycle + len(block.starts))
    return to_table({"cycle": cycles}, values, BODY_METRICS)


def describe_load(manifest: Mapping[str, Any]) -> str:
    """What the plan of a run used at its end of load and ground, in one line; empty if it did not ask.

    The plan takes only a part of the difference from what the feet carried, which is given beside it.
    """
    if not (found := manifest.get("carried", ())):
        return ""
    last = found[-1]
    values = (1e3 * last["x"], 1e3 * last["y"], 100.0 * last["slope_x"])
    ahead, aside, slope = (round(value, 1) + 0.0 for value in values)
    measured = f" ({last['measured_weight']:.4g} N measured)" if "measured_weight" in last else ""
    return f"{last['weight']:.4g} N{measured}, {ahead} mm ahead and {aside} mm left of plan; slope {slope} %"
