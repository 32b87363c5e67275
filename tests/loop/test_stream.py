"""Runs that are written as they go on: the same tables however they are cut, thinned as asked for, never torn."""

import os
import signal
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from draw_walk import view_cycles

from cmacexp.commands.score import score
from cmacexp.config.compose import compose_config
from cmacexp.data.tables import Traces, TraceWriter, read_traces, steps_by_cycle
from cmacexp.errors import BadRun
from cmacexp.experiment.run import run_scenario
from cmacexp.loop import run as rollouts
from cmacexp.loop import stream
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants import AnalyticPlant
from cmacexp.recording.run_view import make_view
from cmacexp.report.run_report import choose_cycles

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


FALL = [*WALK, "posture.gain=0", "learning.start_cycle=1"]


@pytest.fixture(scope="module")
def fallen(tmp_path_factory):
    """``fallen("record.cycles=[1]")`` gives the walk that falls, a cycle at a time; each is run once."""

    @cache
    def run(*record):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(rollouts, "MOST_ROWS", 2400)
            done = run_scenario(compose_config([*FALL, *record]), tmp_path_factory.mktemp("fallen"))
        assert done.status == "fell"
        return done

    return run


@pytest.mark.parametrize(
    ("record", "kept"),
    [
        ("record.cycles=[1]", lambda step, cycle: cycle == 1),
        ("record.every_nth_step=7", lambda step, cycle: step % 7 == 0),
    ],
)
def test_a_thin_trace_of_a_run_that_falls_has_its_last_steps(fallen, record, kept):
    whole, thin = fallen(), fallen(record)
    for name in ("trace.parquet", "body.parquet"):
        full = pq.read_table(whole.folder / name)
        step, cycle = full["step"].to_numpy(), full["cycle"].to_numpy()
        rows = kept(step, cycle) | (step >= thin.manifest["steps"] - 100)
        assert same(pq.read_table(thin.folder / name), full.filter(pa.array(rows)))
    assert same(pq.read_table(thin.folder / "metrics.parquet"), pq.read_table(whole.folder / "metrics.parquet"))
    with pytest.raises(BadRun, match=r"lacks steps \(record\."):
        score(thin.folder)


def pieces(lengths, legs=1):
    """Traces of pieces of so many steps."""
    ends = np.cumsum(lengths)
    for start, end in zip(ends - lengths, ends, strict=True):
        step = np.repeat(np.arange(start, end), legs)
        yield Traces(pa.table({"step": step, "cycle": step // 40 + 1}), None)


@pytest.mark.parametrize("completed", [True, False])
@pytest.mark.parametrize("lengths", [[250], [40] * 6, [100, 99], [1] * 130, [200, 0], [30], [0]])
def test_held_back_steps_are_written_once_in_order(lengths, completed):
    record = replace(compose_config(["record=trace"]).record, every_nth_step=9, cycles=[1, 3])
    written = []
    writer = TraceWriter([SimpleNamespace(write_table=written.append)], record)
    for traces in pieces(lengths):
        writer.write(traces)
    writer.finish(completed)
    steps = np.concatenate([table["step"].to_numpy() for table in written] or [np.zeros(0)])
    step = np.arange(sum(lengths))
    thin = (step % 9 == 0) & np.isin(step // 40 + 1, [1, 3])
    np.testing.assert_array_equal(steps, step[thin | (not completed) & (step >= len(step) - 100)])


def test_cycles_of_a_thinned_run_that_fell_are_whole(fallen):
    """The cycle in which it fell has more rows than a whole one, and is none."""
    run, first = fallen("record.every_nth_step=7"), fallen("record.cycles=[1]")
    whole = run.whole_cycles
    assert whole == 1
    assert max(steps_by_cycle(run.folder).values()) == steps_by_cycle(run.folder)[whole + 1]
    assert [view.cycle[0] for view in view_cycles(run, [])] == [whole]
    assert make_view(read_traces(run.folder), run.manifest).whole_cycles() == (1, whole)
    assert choose_cycles(run)[-1] == whole
    assert whole + 1 in steps_by_cycle(first.folder)
    assert [view.cycle[0] for view in view_cycles(first, [])] == [1]
    assert make_view(read_traces(first.folder), first.manifest).whole_cycles() == (1, 1)
    assert choose_cycles(first) == [1]


def test_steps_and_windows_are_read_back(whole, tmp_path):
    assert steps_by_cycle(whole) == dict.fromkeys(range(1, 5), 600)
    window = read_traces(whole, (2, 3), every=5)
    assert window.body["step"].to_pylist() == list(range(600, 1800, 5))
    assert window.legs["step"].to_pylist()[::4] == list(range(600, 1800, 5))


def test_an_interrupt_waits_for_what_is_being_written(monkeypatch):
    monkeypatch.setattr(rollouts, "MOST_ROWS", 600)
    kept, before = [], signal.signal(signal.SIGINT, signal.default_int_handler)  # also in the background

    def keep(samples):
        os.kill(os.getpid(), signal.SIGINT)
        kept.append(samples.legs.copy())

    end = stream(make_scenario(compose_config(["cycles=3"])), keep)
    signal.signal(signal.SIGINT, before)
    assert (end.status, end.cause, end.steps) == ("interrupted", "after step 600", 600)
    assert [len(part) for part in kept] == [600]


def test_what_cannot_be_kept_ends_the_run_as_what_it_is():
    def full(samples):
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        stream(make_scenario(compose_config(["cycles=3"])), full)


def test_a_run_that_fails_before_its_first_step_has_the_columns_of_its_sensors(tmp_path):
    class NoContact(AnalyticPlant):
        def reset(self, setup):
            raise RuntimeError("no contact to the robot")

    config = compose_config(["sensors=real", "sensors.velocity.noise=0.1", "record=trace"])
    run = run_scenario(config, tmp_path, prepared=make_scenario(config, plant=NoContact(config.plant)))
    assert (run.status, run.manifest["steps"]) == ("failed", 0)
    assert "vx_measured" in pq.read_table(tmp_path / "trace.parquet").column_names
