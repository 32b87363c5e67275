"""What a column of metrics is: unit, definition, where it is NaN, who defined it, and how it is computed."""

from collections.abc import Callable, Mapping
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cmacexp.data.parquet import arrow
from cmacexp.typing import Array

CONTRACT = "cmacexp's contract"
GRAHAM_LATHROP = "Graham & Lathrop 1953"
OGATA = "Ogata 2010, section 5-3"
BRISTOW = "Bristow, Tharayil & Alleyne 2006"
MCGHEE_FRANK = "McGhee & Frank 1968"
ALBUS = "Albus 1975"
MANN = "Mann 1945"
SEN = "Sen 1968"

Of = TypeVar("Of")


class Metric(NamedTuple, Generic[Of]):
    """A column of ``metrics.parquet`` or ``body_metrics.parquet``."""

    unit: str
    meaning: str
    undefined: str
    """Where it is NaN."""
    source: str
    """Where the definition comes from; :data:`CONTRACT` only where nothing else applies."""
    of: Callable[[Of], Array]


class Index(NamedTuple):
    """A column that tells which row it is."""

    unit: str
    meaning: str
    undefined: str
    source: str


CYCLE = Index("", "gait cycle, from 1", "never", CONTRACT)
LEG = Index("", "as in the trace", "never", CONTRACT)


def describe(column: Metric[Any] | Index) -> dict[str, str]:
    """What stands in the metadata of a column's field."""
    return {
        "unit": column.unit,
        "meaning": column.meaning,
        "undefined": column.undefined,
        "source": column.source,
    }


def to_table(
    index: Mapping[str, tuple[Index, NDArray[np.integer]]],
    values: Mapping[str, Array],
    metrics: Mapping[str, Metric[Any]],
) -> pa.Table:
    """A table of metrics, with their description in the metadata of each field.

    Args:
        index: the first columns, with whole numbers.
        values: a value per row, by name.
        metrics: their description, by the same names.
    """
    fields = [pa.field(name, pa.int32(), metadata=describe(column)) for name, (column, _) in index.items()]
    arrays = [arrow(numbers, pa.int32()) for _, numbers in index.values()]
    for name, metric in metrics.items():
        fields.append(pa.field(name, pa.float64(), metadata=describe(metric)))
        arrays.append(arrow(values[name].ravel(), pa.float64()))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))
