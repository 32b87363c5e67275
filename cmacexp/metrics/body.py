"""Metrics of a body per cycle: pure functions of its trace."""

from collections.abc import Callable
from typing import NamedTuple

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

    def reduce(self, by: np.ufunc, values: Array) -> Array:
        """One value per cycle."""
        return np.asarray(by.reduceat(values, self.starts))


def _height(by: np.ufunc) -> Callable[[BodyBlock], Array]:
    return lambda b: b.reduce(by, as_array(b.table, "height"))


def _mean_height(block: BodyBlock) -> Array:
    return _height(np.add)(block) / np.diff([*block.starts, block.table.num_rows])


def _tilt(block: BodyBlock) -> Array:
    pitch, roll = (np.abs(as_array(block.table, name)) for name in ("pitch", "roll"))
    return block.reduce(np.maximum, np.maximum(pitch, roll))


def _least(name: str) -> Callable[[BodyBlock], Array]:
    return lambda b: b.reduce(np.fmin, as_array(b.table, name))


_TWO_FEET = "never three feet down"

BODY_METRICS: dict[str, Metric[BodyBlock]] = {
    "height_mean": Metric(
        "m", "mean height of the body", "never", CONTRACT, _mean_height, BODY, NEITHER, Shown("height", "mm", 1e3)
    ),
    "height_min": Metric(
        "m",
        "least height of the body",
        "never",
        CONTRACT,
        _height(np.minimum),
        BODY,
        NEITHER,
        Shown("least height", "mm", 1e3, main=False),
    ),
    "height_max": Metric(
        "m",
        "largest height of the body",
        "never",
        CONTRACT,
        _height(np.maximum),
        BODY,
        NEITHER,
        Shown("largest height", "mm", 1e3, main=False),
    ),
    "tilt_max": Metric(
        "rad",
        "largest of abs(pitch) and abs(roll)",
        "never",
        CONTRACT,
        _tilt,
        BODY,
        SMALL,
        Shown("tilt", "mrad", 1e3),
    ),
    "stability_margin_min": Metric(
        "m",
        "least margin to the nearest edge of the planned support polygon",
        _TWO_FEET,
        MCGHEE_FRANK,
        _least("stability_margin"),
        BODY,
        LARGE,
    ),
    "margin_front_min": Metric(
        "m",
        "least margin to the front of the planned support polygon",
        _TWO_FEET,
        CONTRACT,
        _least("margin_front"),
        BODY,
        LARGE,
    ),
    "margin_rear_min": Metric(
        "m",
        "least margin to the rear of the planned support polygon",
        _TWO_FEET,
        CONTRACT,
        _least("margin_rear"),
        BODY,
        LARGE,
        Shown("rear margin", "mm", 1e3),
    ),
}
"""All columns of ``body_metrics.parquet`` but ``cycle``, in their order."""


class BodyScorer:
    """The metrics of a body whose trace arrives in parts.

    Args:
        steps_per_cycle: N.
    """

    def __init__(self, steps_per_cycle: int):
        self.steps_per_cycle = steps_per_cycle
        self.parts: list[dict[str, Array]] = []

    def add(self, body: pa.Table) -> None:
        """Score the next cycles; only the last of the run may be short."""
        block = BodyBlock(body, np.arange(0, body.num_rows, self.steps_per_cycle))
        self.parts.append({name: metric.compute(block) for name, metric in BODY_METRICS.items()})

    def table(self) -> pa.Table:
        """One row per cycle."""
        values = {name: np.concatenate([part[name] for part in self.parts]) for name in BODY_METRICS}
        cycles = len(values["height_mean"])
        return to_table({"cycle": (CYCLE, np.arange(1, cycles + 1))}, values, BODY_METRICS)


def compute_body(body: pa.Table, steps_per_cycle: int) -> pa.Table:
    """One row per cycle: mean, least and largest height, largest tilt, least of each margin.

    Args:
        body: as :func:`cmacexp.loop.trace.assemble_body` makes it; the last cycle may be short.
        steps_per_cycle: N.
    """
    scorer = BodyScorer(steps_per_cycle)
    scorer.add(body)
    return scorer.table()
