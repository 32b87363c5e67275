"""The trace of a robot whose plan moves from cycle to cycle."""

import pyarrow as pa
from support.views import STEPS, make_robot_traces

from cmacexp.data.tables import Traces


def shift(table, **added):
    """A table some of whose columns are larger."""
    for name, more in added.items():
        values = pa.array(table[name].to_numpy() + more, table.schema.field(name).type)
        table = table.set_column(table.column_names.index(name), table.schema.field(name), values)
    return table


def make_traces(shifts, loads):
    """Traces of so many cycles and their manifest: desired paths are so much ahead, m, desired forces larger, N."""
    traces, manifest = make_robot_traces()
    clocks = [{"step": n * STEPS, "time": 0.1 * n * STEPS, "cycle": n} for n in range(len(shifts))]
    legs = [shift(traces.legs, **clock, x_desired=x, force_desired=load)
            for clock, x, load in zip(clocks, shifts, loads, strict=True)]  # fmt: skip
    body = [shift(traces.body, **clock) for clock in clocks]
    return Traces(pa.concat_tables(legs), pa.concat_tables(body)), manifest | {"steps": len(shifts) * STEPS}
