"""Metrics of a body per cycle: pure functions of its trace."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cmacexp.data.parquet import as_array
from cmacexp.metrics.metric import BODY, CONTRACT, CYCLE, LARGE, MCGHEE_FRANK, NEITHER, SMALL, Metric, Shown, to_table
from cmacexp.typing import Array


class BodyBlock(NamedTuple):
    """The trace of a body and the rows at which its cycles start."""

    table: pa.Table
    starts: NDArray[np.intp]

    def reduce(self, by: np.ufunc, column: str) -> Array:
        """One value per cycle."""
        return np.asarray(by.reduceat(as_array(self.table, column), self.starts))


def _largest_tilt(block: BodyBlock) -> Array:
    ends = [np.abs(block.reduce(by, name)) for by in (np.minimum, np.maximum) for name in ("pitch", "roll")]
    return np.asarray(np.maximum.reduce(ends))


def _height(which: str, compute: Callable[[BodyBlock], Array], shown: Shown) -> Metric[BodyBlock]:
    return Metric("m", f"{which} height of the body", "never", compute, BODY, NEITHER, shown)


PLANNED, TRUE = "planned support polygon", "polygon of the feet that carry load"


def _margin(column: str, to: str, of: str, source: str, shown: Shown | None = None) -> Metric[BodyBlock]:
    undefined = "never three feet down" if of == PLANNED else "never three feet carry"
    meaning = f"least margin to the {to} of the {of}; negative: the centre of gravity is outside it"
    return Metric("m", meaning, undefined, lambda b: b.reduce(np.fmin, column), BODY, LARGE, shown, source=source)


_shown = partial(Shown, unit="mm", factor=1e3, main=False)
_TILT = "largest of abs(pitch) and abs(roll)"

BODY_METRICS: dict[str, Metric[BodyBlock]] = {
    "height_mean": _height(
        "mean",
        lambda b: b.reduce(np.add, "height") / np.diff([*b.starts, b.table.num_rows]),
        _shown("height", symbol="h", main=True, from_zero=False),
    ),
    "height_min": _height(
        "least", lambda b: b.reduce(np.minimum, "height"), _shown("least height", symbol="h_min", from_zero=False)
    ),
    "height_max": _height(
        "largest",
        lambda b: b.reduce(np.maximum, "height"),
        _shown("largest height", symbol="h_max", from_zero=False),
    ),
    "tilt_max": Metric("rad", _TILT, "never", _largest_tilt, BODY, SMALL, Shown("tilt", "mrad", 1e3)),
    "stability_margin_min": _margin(
        "stability_margin", "nearest edge", PLANNED, MCGHEE_FRANK, _shown("planned margin", symbol="S_p")
    ),
    "margin_front_min": _margin("margin_front", "front", PLANNED, CONTRACT),
    "margin_rear_min": _margin(
        "margin_rear", "rear", PLANNED, CONTRACT, _shown("planned rear margin", symbol="S_pr")
    ),
    "true_stability_margin_min": _margin(
        "true_stability_margin",
        "nearest edge",
        TRUE,
        MCGHEE_FRANK,
        _shown("true margin", symbol="S", main=True),
    ),
    "true_margin_front_min": _margin("true_margin_front", "front", TRUE, CONTRACT),
    "true_margin_rear_min": _margin("true_margin_rear", "rear", TRUE, CONTRACT),
}
"""All columns of ``body_metrics.parquet`` but ``cycle``, in their order."""


def compute_body(body: pa.Table, steps_per_cycle: int, first_cycle: int = 1) -> pa.Table:
    """One row per cycle, the columns of :data:`BODY_METRICS`; the last cycle may be short."""
    block = BodyBlock(body, np.arange(0, body.num_rows, steps_per_cycle))
    values = {name: metric.compute(block) for name, metric in BODY_METRICS.items()}
    cycles = np.arange(first_cycle, first_cycle + len(block.starts))
    return to_table({"cycle": (CYCLE, cycles)}, values, BODY_METRICS)


def describe_load(manifest: Mapping[str, Any]) -> str:
    """What the plan of a run knew at its end of the load and the ground, in one line; empty if it did not ask."""
    if not (found := manifest.get("carried", ())):
        return ""
    last = found[-1]
    values = (1e3 * last["x"], 1e3 * last["y"], 100.0 * last["slope_x"])
    ahead, aside, slope = (round(value, 1) + 0.0 for value in values)
    return f"{last['weight']:.4g} N, {ahead} mm ahead and {aside} mm left of plan; slope {slope} %"
