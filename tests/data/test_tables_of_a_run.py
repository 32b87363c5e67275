"""What a run leaves behind: its tables, row by row, and the columns that sensors add."""

import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import CmacexpError
from support.walks import PERIOD, STEPS

from cmacexp.data.signals import BODY_SIGNALS, LEG_SIGNALS, MEMORY_SIGNALS, SPATIAL_SIGNALS, select_signals


def test_a_walk_has_a_row_per_step_and_leg_and_a_row_of_the_body_per_step(walk):
    assert set(walk.manifest["files"]) == {
        "trace.parquet", "body.parquet", "memory.parquet", "metrics.parquet", "body_metrics.parquet",
    }  # fmt: skip
    assert_array_equal(walk.trace["step"], np.repeat(np.arange(STEPS), 4))
    assert_array_equal(walk.trace["leg"], np.tile([1, 2, 3, 4], STEPS))
    assert_array_equal(walk.body["step"], np.arange(STEPS))
    assert_allclose(walk.body["time"], np.arange(STEPS) * PERIOD, rtol=1e-15)


def names(signals):
    return [signal.name for signal in signals]


def test_a_name_stands_once_in_a_table_and_what_sensors_alter_has_a_measured_column():
    for table in ((*LEG_SIGNALS, *SPATIAL_SIGNALS), BODY_SIGNALS, MEMORY_SIGNALS):
        assert len({*names(table)}) == len(table)
    always = [signal.name for signal in LEG_SIGNALS if signal.present == "always"]
    assert names(select_signals(LEG_SIGNALS)) == always
    added = select_signals(LEG_SIGNALS, {"force", "velocity"}, watched=True)[len(always) :]
    assert names(added) == ["vx_measured", "vy_measured", "dq1_measured", "dq2_measured", "force_trusted"]
    assert [signal.unit for signal in added] == ["m/s", "m/s", "rad/s", "rad/s", ""]
    rates = names(select_signals(BODY_SIGNALS, {"height_rate"}))[-2:]
    assert rates == ["height_rate", "height_rate_measured"]


def test_a_run_is_a_dataset_with_units_where_xarray_is_installed(walk, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(CmacexpError, match=r'install .*\[xarray\]"$'):
        walk.to_xarray()
    monkeypatch.undo()
    pytest.importorskip("xarray")
    found = walk.to_xarray()
    for name, table in (("force", walk.trace), ("height", walk.body)):
        assert_array_equal(np.ravel(found[name]), table[name])
        assert found[name].attrs["units"] == walk.units[name] == table.attrs["units"][name]
