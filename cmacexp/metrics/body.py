"""Metrics of a body per cycle: pure functions of its trace."""

import numpy as np
import pyarrow as pa

from cmacexp.arrays import Array
from cmacexp.table import arrow, as_array

MARGINS = ("stability_margin", "margin_front", "margin_rear")


def compute_body(body: pa.Table, steps_per_cycle: int) -> pa.Table:
    """One row per cycle: mean, least and largest height, largest tilt, least of each margin.

    Args:
        body: as :func:`cmacexp.trace.assemble_body` makes it; the last cycle may be short.
        steps_per_cycle: N.
    """
    starts = np.arange(0, body.num_rows, steps_per_cycle)
    height, tilt = (as_array(body, "height"), np.maximum(*(np.abs(as_array(body, n)) for n in ("pitch", "roll"))))
    counts = np.diff([*starts, body.num_rows])
    columns: dict[str, tuple[str, str, Array]] = {
        "height_mean": ("m", "mean height of the body", np.add.reduceat(height, starts) / counts),
        "height_min": ("m", "least height of the body", np.minimum.reduceat(height, starts)),
        "height_max": ("m", "largest height of the body", np.maximum.reduceat(height, starts)),
        "tilt_max": ("rad", "largest of |pitch| and |roll|", np.maximum.reduceat(tilt, starts)),
    }
    for name in MARGINS:
        least = np.fmin.reduceat(as_array(body, name), starts)
        columns[f"{name}_min"] = ("m", f"least {name.replace('_', ' ')}", least)
    fields = [pa.field("cycle", pa.int32(), metadata={"unit": "", "meaning": "gait cycle, from 1"})]
    arrays = [arrow(np.arange(1, len(starts) + 1), pa.int32())]
    for name, (unit, meaning, values) in columns.items():
        fields.append(pa.field(name, pa.float64(), metadata={"unit": unit, "meaning": meaning}))
        arrays.append(arrow(values, pa.float64()))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))
