"""Runs that are written as they go on: the same tables however they are cut, thinned as asked for, never torn."""

import os
import signal
from functools import cache

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.command import call
from support.doors import compose_config, interrupt_held_back, make_scenario

import cmacexp
from cmacexp.loop import run as rollouts
from cmacexp.loop import run_cycles
from cmacexp.plants import AnalyticPlant

SAMPLES, CYCLES = 300, 3
WALK = ("scenario=quadruped", "gait.cycle_time=1.5", f"cycles={CYCLES}", "record=trace", "learning.start_cycle=1")
KINDS = {"completed": (), "fell": ("posture.gain=0",)}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """``whole("fell")`` gives the walk that ends so, in one piece."""
    return cache(lambda kind: cmacexp.run([*WALK, *KINDS[kind]], tmp_path_factory.mktemp(kind)))


def read_all(run):
    return {path.name: pq.read_table(path) for path in run.folder.glob("*.parquet")}


def same(one, other):
    """Whether two tables hold the same, NaN and all, however they are cut."""
    return one.schema.equals(other.schema) and one.to_pandas().equals(other.to_pandas())


@pytest.mark.ci
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("record", "kept"),
    [
        ((), lambda step, cycle: step >= 0),
        (("record.cycles=[1,3]",), lambda step, cycle: np.isin(cycle, [1, 3])),
        (("record.every_nth_step=7",), lambda step, cycle: step % 7 == 0),
    ],
    ids=["all", "cycles", "steps"],
)
def test_cut_or_thinned_a_run_leaves_the_rows_asked_for_the_last_of_a_fall_and_all_metrics(
    whole, tmp_path, monkeypatch, record, kept, kind
):
    full, before = whole(kind), read_all(whole(kind))
    monkeypatch.setattr(rollouts, "MOST_ROWS", 4 * SAMPLES)
    run = cmacexp.run([*WALK, *KINDS[kind], *record], tmp_path)
    after = read_all(run)
    assert run.status == full.status == kind
    assert (run.manifest["cause"], run.whole_cycles) == (full.manifest["cause"], full.whole_cycles)
    if not record:
        assert pq.ParquetFile(tmp_path / "trace.parquet").num_row_groups > 1
    assert before.keys() == after.keys()
    for name, table in before.items():
        if name in ("trace.parquet", "body.parquet"):
            step, cycle = table["step"].to_numpy(), table["cycle"].to_numpy()
            last = (kind == "fell") & (step >= run.manifest["steps"] - 100)
            table = table.filter(pa.array(kept(step, cycle) | last))
        assert same(table, after[name]), name
    assert call("score", run.folder).returncode == (2 if record else 0)  # thinned, it lacks steps


def test_an_interrupt_waits_for_what_is_being_written(monkeypatch):
    monkeypatch.setattr(rollouts, "MOST_ROWS", 600)
    scenario, written = make_scenario(compose_config(["cycles=3"])), []
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # also in the background
    with interrupt_held_back():
        for trace in run_cycles(scenario):
            os.kill(os.getpid(), signal.SIGINT)
            written.append(trace.steps)
    signal.signal(signal.SIGINT, before)
    assert (scenario.end.status, scenario.end.steps, written) == ("interrupted", 600, [600])


def test_a_run_that_fails_before_its_first_step_has_the_columns_of_its_sensors(tmp_path):
    class NoContact(AnalyticPlant):
        def reset(self, setup):
            raise RuntimeError("no contact to the robot")

    overrides = ["sensors=real", "sensors.velocity.noise=0.1", "record=trace"]
    run = cmacexp.run(overrides, tmp_path, plant=NoContact(compose_config(overrides).plant))
    assert (run.status, run.manifest["steps"]) == ("failed", 0)
    assert "vx_measured" in run.trace.columns
