"""The definition of a metric: unit, meaning, source, pooling over legs, better direction, and appearance."""

from collections.abc import Callable, Mapping
from functools import cache, partial
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
    """How the values of several legs become one."""

    name: str
    reduce: Callable[[Array, Mask], Array]
    """Reduces values (..., L), with a mask of those that are defined; NaN where none is."""

    def pool(self, values: Array) -> Array:
        """One value for the legs in the last axis of ``values``; a leg for which it is undefined does not count."""
        return self.reduce(values, ~np.isnan(values))


MEAN = Pooling("mean", measures.mean)
"""Pools amounts and shares that each leg has of its own, and signed errors: opposite ones cancel."""
RMS = Pooling("RMS", measures.rms)
"""Pools RMS values, standard deviations and norms: legs have equally many samples, so it is that of all samples."""
LARGEST = Pooling("largest", measures.largest)
"""Pools peaks, times and growth: the machine is as good as its worst leg."""
SMALLEST = Pooling("smallest", lambda values, mask: -measures.largest(-values, mask))
"""Pools the number of a cycle in which something starts: it starts with the first leg."""
BODY_POOLING = Pooling("", measures.mean)
"""Pools metrics of the body: there is one."""

SMALL, NEAR_ZERO, LARGE, NEITHER = "small", "near 0", "large", ""
"""Which values are better; NEITHER where it depends."""


class MetricDisplay(NamedTuple):
    """How a metric appears wherever it is shown: in the terminal, in reports, in printed runs and in the docs."""

    title: str
    """Its name in words."""
    unit: str
    factor: float = 1.0
    """Converts from the unit of the file to ``unit``."""
    main: bool = True
    """Whether it is a column of the tables of main metrics; else it appears in figures alone."""
    over_legs: bool = True
    """Whether these tables show it for several legs as well; not where legs are to press differently."""
    from_zero: bool = True
    """Whether its axes begin at zero; not for a height, of which only changes matter."""
    symbol: str = ""
    instead: str = ""
    """The metric that is shown instead where a run has it: of a robot the distance, not each axis."""


Of = TypeVar("Of")


class Metric(NamedTuple, Generic[Of]):
    """A column of ``metrics.parquet`` or ``body_metrics.parquet``; what :func:`describe` gives is in its metadata."""

    unit: str
    meaning: str
    undefined: str
    """Where it is NaN."""
    compute: Callable[[Of], Array]
    pooling: Pooling
    better: str
    """:data:`SMALL`, :data:`NEAR_ZERO`, :data:`LARGE` or :data:`NEITHER`."""
    shown: MetricDisplay | None = None
    """None: shown only where all metrics are, under its name and in its unit."""
    source: str = CONTRACT
    """Where the definition comes from; :data:`CONTRACT` only where nothing else applies."""

    def find_best(self, values: Array) -> float:
        """The best of some values; NaN if none is defined or neither direction is better."""
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
"""What columns mean that identify the row."""


def describe(name: str, metric: Metric[Any] | None = None) -> dict[str, str]:
    """The metadata of a column, of a metric or one of :data:`INDEX`: unit, meaning, where it is NaN, and source."""
    if metric is None:
        return {"unit": "", "meaning": INDEX[name], "undefined": "never", "source": CONTRACT}
    declared = metric._asdict()
    return {key: declared[key] for key in ("unit", "meaning", "undefined", "source")}


@cache
def _make_field(name: str, metric: Metric[Any] | None, kind: pa.DataType) -> pa.Field:
    return pa.field(name, kind, metadata=describe(name, metric))


def to_table(
    index: Mapping[str, NDArray[np.integer]],
    values: Mapping[str, Array],
    metrics: Mapping[str, Metric[Any]],
) -> pa.Table:
    """A table of metrics: columns of :data:`INDEX`, then values by name, each with its definition as metadata."""
    fields = [_make_field(name, None, pa.int32()) for name in index]
    arrays = [arrow(numbers, pa.int32()) for numbers in index.values()]
    for name, metric in metrics.items():
        fields.append(_make_field(name, metric, pa.float64()))
        arrays.append(arrow(values[name].ravel(), pa.float64()))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))
