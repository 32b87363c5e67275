"""What the end of a run that fell or diverged shows follows its cause, and nothing that the data do not show."""

from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.doors import RunEnd, Trace, compose_config, make_scenario

import cmacexp
from cmacexp.engine.stop_cause import MOST, explain_stop

WALK = ("scenario=quadruped", "actuator.torque_limit=10", "gait.cycle_time=1.5")


@pytest.fixture(scope="module")
def fallen(tmp_path_factory):
    return cmacexp.run((*WALK, "posture.gain=0", "record=trace"), tmp_path_factory.mktemp("fallen"))


@pytest.fixture
def ended(fallen):
    """``ended(legs, limited)``: what is said with joint 2 of ``legs`` at its limit in the last ``limited`` steps."""
    scenario, table = make_scenario(compose_config(WALK)), pq.read_table(fallen.folder / "trace.parquet")

    def explain(legs=(), limited=4, force=100.0, status="fell", drift=None, steps=900, kind="quadruped"):
        rows = table.slice(table.num_rows - 4 * 40).to_pandas().assign(force=force)
        at_limit = (rows["step"] > rows["step"].max() - limited) & rows["leg"].isin(legs)
        rows["tau_feedback_2"], rows["tau_feedforward_2"] = (
            np.where(at_limit, -4.0, 0.0),
            np.where(at_limit, -6.0, 0.0),
        )
        changed = Trace(pa.Table.from_pandas(rows, schema=table.schema, preserve_index=False))
        scenario.end = RunEnd(status, steps=steps)
        scenario.setup.config.machine.kind = kind
        return explain_stop(scenario, [changed.select(slice(38)), changed.select(slice(38, None))], drift)

    return explain


def test_a_torque_at_its_limit_is_reported_if_it_was_so_throughout(ended):
    assert "joint 2 of leg 3 at its torque limit" in ended(legs=[3])
    assert "limit" not in ended(legs=[3], limited=3)
    assert ended(legs=[1, 2, 3, 4]).count("at its torque limit") == MOST


def test_whether_learning_can_be_the_cause_is_said_and_nothing_of_a_run_that_completed(ended, fallen):
    assert "feedforward=none" in ended()
    assert "not begun to learn" in ended(steps=200)
    assert ended(steps=200, kind="robot") == f"{ended(steps=200)}; try sampling_period=0.001"
    assert "since cycle 12" in ended(drift=SimpleNamespace(cycle=12))
    assert ended(legs=[3], status="completed") == ended(legs=[3], status="failed") == ended(steps=0) == ""
    assert "not begun to learn" in fallen.manifest["cause"]
