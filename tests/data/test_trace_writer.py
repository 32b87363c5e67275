"""Traces that are written piece by piece: thinned as asked for, with the last steps of a run that stopped."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from support.doors import compose_config

import cmacexp
from cmacexp.data.tables import Traces, TraceWriter, read_traces, steps_by_cycle


@pytest.mark.parametrize("completed", [True, False])
@pytest.mark.parametrize("lengths", [[250], [40] * 6, [100, 99], [1] * 130, [200, 0], [30], [0]])
def test_held_back_steps_are_written_once_in_order(lengths, completed):
    record = replace(compose_config(["record=trace"]).record, every_nth_step=9, cycles=[1, 3])
    step, written = np.arange(sum(lengths)), []
    writer = TraceWriter([SimpleNamespace(write_table=written.append)], record)
    for piece in np.split(step, np.cumsum(lengths)[:-1]):
        writer.write(Traces(pa.table({"step": piece, "cycle": piece // 40 + 1}), None))
    writer.finish(completed)
    steps = np.concatenate([table["step"].to_numpy() for table in written] or [np.zeros(0)])
    thin = (step % 9 == 0) & np.isin(step // 40 + 1, [1, 3])
    np.testing.assert_array_equal(steps, step[thin | (not completed) & (step >= len(step) - 100)])


def test_steps_and_windows_are_read_back(tmp_path):
    cmacexp.run(["gait.cycle_time=0.2", "gait.lift=0.005", "cycles=3", "record=trace"], tmp_path)
    assert steps_by_cycle(tmp_path) == dict.fromkeys((1, 2, 3), 40)
    assert read_traces(tmp_path, (2, 3), every=5).legs["step"].to_pylist() == list(range(40, 120, 5))
