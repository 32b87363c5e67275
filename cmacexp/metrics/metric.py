"""The definition of a metric: unit, meaning, source, pooling over legs, better direction, and appearance."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cmacexp.data.tables import arrow
from cmacexp.metrics import measures
from cmacexp.typing import Array, Mask

CONTRACT = "cmacexp's contract"
OGATA = "Ogata 2010, section 5-3"


class Pooling(NamedTuple):
    """A reduction of the values of several legs to one value."""

    name: str
    reduce: Callable[[Array, Mask], Array]
    """Function of values (..., L) and the mask of the defined ones; its result (...) is NaN where none is defined."""

    def pool(self, values: Array) -> Array:
        """Reduce ``values`` (..., L) over the legs; undefined (NaN) values do not count."""
        return self.reduce(values, ~np.isnan(values))


MEAN = Pooling("mean", measures.mean)
"""Pooling of quantities per leg, such as energy or shares, and of signed errors, of which opposite ones cancel."""
RMS = Pooling("RMS", measures.rms)
"""Pooling of RMS values, standard deviations and norms; all legs have as many samples, so this is the RMS of all."""
LARGEST = Pooling("largest", measures.largest)
"""Pooling of peaks, times and growth: the machine is as good as its worst leg."""
SMALLEST = Pooling("smallest", lambda values, mask: -measures.largest(-values, mask))
"""Pooling of the number of the cycle in which something starts: that of the first leg counts."""
BODY_POOLING = Pooling("", measures.mean)
"""Pooling of metrics of the body, of which there is only one."""

SMALL, NEAR_ZERO, LARGE, NEITHER = "small", "near 0", "large", ""
"""Values of a metric that are better; NEITHER where no direction is better in general."""


class MetricDisplay(NamedTuple):
    """The appearance of a metric in the terminal, in reports, in printed runs and in the documentation."""

    title: str
    """Name in words."""
    unit: str
    factor: float = 1.0
    """Factor from the unit in the file to ``unit``."""
    main: bool = True
    """True for a column of the tables of main metrics; False for a metric that appears only in figures."""
    over_legs: bool = True
    """True if it is also shown for several legs; False where the legs have different desired forces."""
    from_zero: bool = True
    """True if its axis includes zero; False e.g. for a height, of which only changes matter."""
    symbol: str = ""
    instead: str = ""
    """Metric that replaces this one in runs that have it: e.g. a robot's foot error replaces that of each axis."""


Source = TypeVar("Source")
"""Data that a metric is computed from."""


class Metric(NamedTuple, Generic[Source]):
    """A column of ``metrics.parquet`` or ``body_metrics.parquet``, whose metadata are those of :func:`describe`."""

    unit: str
    meaning: str
    undefined: str
    """Condition under which it is NaN."""
    compute: Callable[[Source], Array]
    pooling: Pooling
    better: str
    """:data:`SMALL`, :data:`NEAR_ZERO`, :data:`LARGE` or :data:`NEITHER`."""
    shown: MetricDisplay | None = None
    """Appearance; None: it appears only where all metrics do, under its name and in its unit."""
    source: str = CONTRACT
    """Source of the definition; :data:`CONTRACT` only where there is no other."""

    def find_best(self, values: Array) -> float:
        """Return the best of the values; NaN if none is defined or no direction is better."""
        if self.better == NEITHER:
            return float("nan")
        if self.better == NEAR_ZERO:
            values = values[~np.isnan(values)]
            return float(values[np.abs(values).argmin()]) if values.size else float("nan")
        better = np.fmax if self.better == LARGE else np.fmin
        return float(better.reduce(values, initial=np.nan))


rmse = partial(Metric, pooling=RMS, better=SMALL, source="Bristow, Tharayil & Alleyne 2006")
integral = partial(Metric, pooling=MEAN, better=SMALL, source="Graham & Lathrop 1953")
worst = partial(Metric, pooling=LARGEST, better=SMALL)


INDEX = {"cycle": "gait cycle, from 1", "leg": "as in the trace"}
"""Meaning of the columns that identify a row."""


def describe(name: str, metric: Metric[Any] | None = None) -> dict[str, str]:
    """Return the metadata of a column: unit, meaning, condition for NaN, and source.

    Without a ``metric`` the column ``name`` is one of :data:`INDEX`.
    """
    if metric is None:
        return {"unit": "", "meaning": INDEX[name], "undefined": "never", "source": CONTRACT}
    declared = metric._asdict()
    return {key: declared[key] for key in ("unit", "meaning", "undefined", "source")}


def _make_field(name: str, metric: Metric[Any] | None, kind: pa.DataType) -> pa.Field:
    return pa.field(name, kind, metadata=describe(name, metric))


def to_table(
    index: Mapping[str, NDArray[np.integer]],
    values: Mapping[str, Array],
    metrics: Mapping[str, Metric[Any]],
) -> pa.Table:
    """Make a table of metrics, each column with its definition as metadata.

    Args:
        index: the columns of :data:`INDEX`, (rows,) each; they come first.
        values: values by metric, in any shape with as many elements as there are rows, in their order.
        metrics: the metrics of the table in the order of their columns.
    """
    fields = [_make_field(name, None, pa.int32()) for name in index]
    arrays = [arrow(numbers, pa.int32()) for numbers in index.values()]
    for name, metric in metrics.items():
        fields.append(_make_field(name, metric, pa.float64()))
        arrays.append(arrow(values[name].ravel(), pa.float64()))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))
