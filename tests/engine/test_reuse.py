"""Runs that a study asks for are made once, and not again while they are finished."""

import pytest
from support.doors import Options

from cmacexp.engine.collect import ensure_runs
from cmacexp.study import Request

JOB = ("scenario=force_step", "gait.cycle_time=1.0", "record=trace")


@pytest.mark.ci
def test_equal_runs_are_made_once_and_finished_ones_are_reused(tmp_path):
    one, same = (Request(JOB, {"name": name}) for name in "ab")
    other = Request((*JOB, "machine.mass=0.7"))
    with Options().start_workers() as each:
        first = ensure_runs(each, [one, same, other], tmp_path)
        assert first[one] == first[same] != first[other]
        made = {folder: (folder / "trace.parquet").stat().st_mtime_ns for folder, _ in first.values()}
        again = ensure_runs(each, [one, other], tmp_path)
    assert {folder: (folder / "trace.parquet").stat().st_mtime_ns for folder, _ in again.values()} == made
