"""Runs that are written as they go on: the same tables however they are cut, thinned as asked for, never torn."""

import os
import signal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cmacexp.config.compose import compose_config
from cmacexp.data.tables import read_traces, steps_by_cycle
from cmacexp.errors import BadInput, BadRun
from cmacexp.experiment import run_scenario
from cmacexp.loop import run as rollouts
from cmacexp.loop import stream
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants import AnalyticPlant
from cmacexp.score import score

TABLES = ("trace.parquet", "metrics.parquet")
WALK = ["scenario=quadruped", "cycles=4", "record=trace"]


def tables(folder):
    names = [*TABLES, "body.parquet", "body_metrics.parquet"]
    return {name: pq.read_table(folder / name) for name in names if (folder / name).exists()}


def same(one, other):
    """Whether two tables hold the same, NaN and all, however they are cut."""
    return one.schema.equals(other.schema) and one.to_pandas().equals(other.to_pandas())


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A walk of four cycles in one piece."""
    folder = tmp_path_factory.mktemp("whole")
    run_scenario(compose_config(WALK), folder)
    return folder


def test_cut_anyhow_a_run_leaves_the_same(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(rollouts, "MOST_ROWS", 2400)
    run_scenario(compose_config(WALK), tmp_path)
    assert pq.ParquetFile(tmp_path / "trace.parquet").num_row_groups == 4
    assert pq.ParquetFile(whole / "trace.parquet").num_row_groups == 1
    for name, table in tables(whole).items():
        assert same(table, tables(tmp_path)[name]), name


def test_a_run_that_falls_in_a_later_piece_leaves_the_same(tmp_path, monkeypatch):
    config = compose_config([*WALK, "posture.gain=0", "learning.start_cycle=1"])
    first = run_scenario(config, tmp_path / "whole")
    monkeypatch.setattr(rollouts, "MOST_ROWS", 2400)
    second = run_scenario(config, tmp_path / "cut")
    assert first.status == second.status == "fell"
    assert first.manifest["cause"] == second.manifest["cause"]
    for name, table in tables(tmp_path / "whole").items():
        assert same(table, tables(tmp_path / "cut")[name]), name


@pytest.mark.parametrize(
    ("record", "kept"),
    [
        ("record.cycles=[2,4]", lambda step, cycle: np.isin(cycle, [2, 4])),
        ("record.every_nth_step=7", lambda step, cycle: step % 7 == 0),
    ],
)
def test_a_thin_trace_holds_the_rows_asked_for_and_all_metrics(whole, tmp_path, record, kept, monkeypatch):
    monkeypatch.setattr(rollouts, "MOST_ROWS", 2400)
    run_scenario(compose_config([*WALK, record]), tmp_path)
    for name in ("trace.parquet", "body.parquet"):
        full = pq.read_table(whole / name)
        rows = kept(full["step"].to_numpy(), full["cycle"].to_numpy())
        assert same(pq.read_table(tmp_path / name), full.filter(pa.array(rows)))
    assert same(pq.read_table(tmp_path / "metrics.parquet"), pq.read_table(whole / "metrics.parquet"))
    with pytest.raises(BadRun, match=r"lacks steps \(record\."):
        score(tmp_path)


def test_steps_and_windows_are_read_back(whole, tmp_path):
    assert steps_by_cycle(whole) == dict.fromkeys(range(1, 5), 600)
    window = read_traces(whole, (2, 3), every=5)
    assert window.body["step"].to_pylist() == list(range(600, 1800, 5))
    assert window.legs["step"].to_pylist()[::4] == list(range(600, 1800, 5))


def test_scores_of_a_long_run_are_those_it_wrote(tmp_path, monkeypatch):
    monkeypatch.setattr(rollouts, "MOST_ROWS", 1200)
    run_scenario(compose_config(["cycles=7", "record=trace"]), tmp_path)
    before = (tmp_path / "metrics.parquet").read_bytes()
    score(tmp_path)
    assert (tmp_path / "metrics.parquet").read_bytes() == before


def test_an_interrupt_waits_for_what_is_being_written(monkeypatch):
    monkeypatch.setattr(rollouts, "MOST_ROWS", 600)
    kept = []

    def keep(samples):
        os.kill(os.getpid(), signal.SIGINT)
        kept.append(samples.legs.copy())

    end = stream(make_scenario(compose_config(["cycles=3"])), keep)
    assert (end.status, end.cause, end.steps) == ("interrupted", "after step 600", 600)
    assert [len(part) for part in kept] == [600]


def test_what_cannot_be_kept_ends_the_run_as_what_it_is():
    def full(samples):
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        stream(make_scenario(compose_config(["cycles=3"])), full)


@pytest.mark.parametrize(
    ("override", "message"),
    [("record.cycles=[6]", "must be at most 5"), ("record.every_nth_step=0", "must be at least 1")],
)
def test_records_that_cannot_be_are_told(override, message):
    with pytest.raises(BadInput, match=message):
        compose_config([override])


def test_a_run_that_fails_before_its_first_step_has_the_columns_of_its_sensors(tmp_path):
    class NoContact(AnalyticPlant):
        def reset(self, setup):
            raise RuntimeError("no contact to the robot")

    config = compose_config(["sensors=real", "sensors.velocity.noise=0.1", "record=trace"])
    run = run_scenario(config, tmp_path, prepared=make_scenario(config, plant=NoContact()))
    assert (run.status, run.manifest["steps"]) == ("failed", 0)
    assert "vx_measured" in pq.read_table(tmp_path / "trace.parquet").column_names
