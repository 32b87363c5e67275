"""Metrics of the body per cycle: pure functions of the trace of the body."""

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
    NEITHER,
    SMALL,
    Metric,
    MetricDisplay,
    to_table,
)
from cmacexp.typing import Array


class BodyBlock(NamedTuple):
    """The trace of a body, with the first step of each of its cycles."""

    body: Trace
    starts: NDArray[np.intp]

    def reduce(self, by: np.ufunc, column: str) -> Array:
        """Reduce a column over the steps of each cycle with the ufunc ``by``; (cycles,)."""
        return np.asarray(by.reduceat(self.body[column], self.starts))


BodyMetric = Metric[BodyBlock]


def _largest_tilt(block: BodyBlock) -> Array:
    ends = [np.abs(block.reduce(by, name)) for by in (np.minimum, np.maximum) for name in ("pitch", "roll")]
    return np.asarray(np.maximum.reduce(ends))


def _height(which: str, symbol: str, compute: Callable[[BodyBlock], Array], main: bool = False) -> BodyMetric:
    display = MetricDisplay("height" if main else f"{which} height", "mm", 1e3, main, from_zero=False, symbol=symbol)
    return Metric("m", f"{which} height of the body", "never", compute, BODY_POOLING, NEITHER, display)


def _margin(column: str, title: str = "", symbol: str = "", main: bool = False) -> BodyMetric:
    """Define the metric of the smallest stability margin in a cycle, m; displayed only if it has a ``title``."""
    is_true = column.startswith("true")
    side = column.rpartition("margin")[2]
    edge = side.removeprefix("_") or "nearest edge"
    polygon = "polygon of the feet that carry load" if is_true else "planned support polygon"
    undefined = "never three feet carry" if is_true else "never three feet down"
    meaning = f"least margin to the {edge} of the {polygon}; negative: the centre of gravity is outside it"
    display = MetricDisplay(title, "mm", 1e3, main, symbol=symbol) if title else None
    source = CONTRACT if side else "McGhee & Frank 1968"
    return Metric("m", meaning, undefined, lambda b: b.reduce(np.fmin, column), BODY_POOLING, LARGE, display, source)


BODY_METRICS: dict[str, BodyMetric] = {
    "height_mean": _height(
        "mean", "h", lambda b: b.reduce(np.add, "height") / np.diff([*b.starts, b.body.steps]), main=True
    ),
    "height_min": _height("least", "h_min", lambda b: b.reduce(np.minimum, "height")),
    "height_max": _height("largest", "h_max", lambda b: b.reduce(np.maximum, "height")),
    "tilt_max": Metric(
        "rad",
        "largest of abs(pitch) and abs(roll)",
        "never",
        _largest_tilt,
        BODY_POOLING,
        SMALL,
        MetricDisplay("tilt", "mrad", 1e3),
    ),
    "stability_margin_min": _margin("stability_margin", "planned margin", "S_p"),
    "margin_front_min": _margin("margin_front"),
    "margin_rear_min": _margin("margin_rear", "planned rear margin", "S_pr"),
    "true_stability_margin_min": _margin("true_stability_margin", "true margin", "S", main=True),
    "true_margin_front_min": _margin("true_margin_front"),
    "true_margin_rear_min": _margin("true_margin_rear"),
}
"""Columns of ``body_metrics.parquet`` after ``cycle``, in their order."""


def _measure_drift(block: BodyBlock) -> Array:
    ends = np.array([*block.starts[1:], block.body.steps]) - 1
    ahead, aside = (block.body[f"{name}_measured"][ends] - block.body[name][ends] for name in ("cog_x", "cog_y"))
    return np.asarray(np.sqrt(ahead * ahead + aside * aside))


ESTIMATE_METRICS: dict[str, BodyMetric] = {
    "place_drift": Metric(
        "m",
        "distance of the measured from the true position of the body at the end of the cycle",
        "never",
        _measure_drift,
        BODY_POOLING,
        SMALL,
    ),
}
"""Columns that follow where the sensors alter the measured position of the body."""


def compute_body(body: Trace, steps_per_cycle: int, first_cycle: int = 1) -> pa.Table:
    """Compute the table of body metrics, one row per cycle; the last cycle may be incomplete.

    Its columns are ``cycle``, :data:`BODY_METRICS` and, if the trace has a measured position,
    :data:`ESTIMATE_METRICS`.
    """
    block = BodyBlock(body, np.arange(0, body.steps, steps_per_cycle))
    metrics = {**BODY_METRICS, **(ESTIMATE_METRICS if "cog_x_measured" in body.table.column_names else {})}
    values = {name: metric.compute(block) for name, metric in metrics.items()}
    cycles = np.arange(first_cycle, first_cycle + len(block.starts))
    return to_table({"cycle": cycles}, values, metrics)


def describe_load(manifest: Mapping[str, Any]) -> str:
    """Describe in one line the load and the ground slope that the plan used at the end of a run.

    The plan corrects only a fraction of the difference between planned and measured load; the measured weight is
    given beside the planned one. Empty if the plan did not adapt to measurements.
    """
    if not manifest["carried"]:
        return ""
    last = manifest["carried"][-1]
    values = (1e3 * last["x"], 1e3 * last["y"], 100.0 * last["slope_x"])
    ahead, aside, slope = (round(value, 1) + 0.0 for value in values)
    measured = "" if last["measured_weight"] is None else f" ({last['measured_weight']:.4g} N measured)"
    return f"{last['weight']:.4g} N{measured}, {ahead} mm ahead and {aside} mm left of plan; slope {slope} %"
