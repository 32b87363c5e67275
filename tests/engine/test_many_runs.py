"""Many runs: metrics alone, in memory, and studies in tasks of a launcher."""

import json

import numpy as np
import pandas as pd
import pytest
from support.command import call, python, sweep, table_of
from support.doors import BadInput

from cmacexp import load_sweep, run, run_many, write_many
from cmacexp.engine import batch
from cmacexp.engine.job_store import list_jobs
from cmacexp.errors import WithoutEffect

SHORT = ("scenario=one_leg", "gait.cycle_time=0.5", "gait.stroke=0.02", "gait.lift=${gait.stroke}", "cycles=2")


@pytest.mark.parametrize("runs", [[], ["cycles=1"], None, "cycles=1"])
def test_runs_that_cannot_be_are_refused(runs):
    with pytest.raises(BadInput, match="runs"):
        run_many(runs)


@pytest.mark.ci
def test_jobs_with_metrics_alone_are_rows_of_two_tables_and_resume(tmp_path):
    lean, jobs = tmp_path / "s", [*SHORT, "record=metrics", "warn=false", "controller.velocity_gain=6,5,1e5,-1"]
    assert sweep(*jobs, "hydra.launcher.processes=1", folder=tmp_path).returncode == 1
    assert [path.name for path in lean.iterdir() if path.is_dir()] == ["3"], "the one that failed, with the reason"
    stored = load_sweep(lean)
    assert stored.drop_duplicates("run").status.tolist() == ["completed", "completed", "diverged", "failed"]
    for number, gain in enumerate(("6", "5", "1e5")):
        alone = run([*SHORT, "warn=false", "record=metrics", f"controller.velocity_gain={gain}"], tmp_path / gain)
        own = stored[stored.run == number][alone.metrics.columns].reset_index(drop=True)
        pd.testing.assert_frame_equal(own, alone.metrics, check_exact=True, check_dtype=False)
        assert table_of(tmp_path).cause[number] == alone.manifest["cause"]
    for command, code in {"verify": 0, "report": 0, "report 6": 0, "score": 2, "stability": 2}.items():
        done = call(*(command.split() if " " in command else (command, lean)), folder=tmp_path)
        assert done.returncode == code, command
        assert len(done.stderr.splitlines()) == bool(code) or not code, command
    again = sweep(*jobs, "hydra.launcher.processes=1", "sweep.resume=true", folder=tmp_path)
    assert again.stdout.count("finished before, not run again") == 3
    pd.testing.assert_frame_equal(load_sweep(lean), stored)
    (lean / "metrics.parquet").write_bytes((tmp_path / "6" / "metrics.parquet").read_bytes())
    assert call("verify", lean, folder=tmp_path).returncode == 4


@pytest.mark.ci
def test_jobs_that_run_at_once_have_the_manifests_of_runs_alone(tmp_path):
    jobs = [*SHORT, "record=metrics", "seed=range(8)", "learning.rate=0.1,0.3", "hydra.launcher.processes=1"]
    assert sweep(*jobs, folder=tmp_path).returncode == 0
    for job in list_jobs(tmp_path / "s"):
        alone = run(job.manifest["overrides"], tmp_path / "alone").manifest
        differs = {key for key in alone if alone[key] != job.manifest[key]}
        assert differs <= {"files", "wall_seconds", "rollout_seconds", "processor_seconds"}


@pytest.mark.ci
def test_a_job_that_the_loop_refuses_does_not_end_the_sweep(tmp_path):
    assert sweep(*SHORT, "record=metrics", "learning.lead=estimate,auto", folder=tmp_path).returncode == 1
    assert table_of(tmp_path).status.tolist() == ["failed", "completed"]


@pytest.mark.ci
def test_runs_in_memory_leave_nothing_on_disk_and_have_the_traces_of_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    trace = run_many([SHORT], "trace", processes=1)
    assert not list(tmp_path.iterdir())
    assert np.array_equal(trace["q1"], run([*SHORT, "record=trace"], tmp_path / "full").trace["q1"])
    with pytest.raises(BadInput, match="cycles"):
        run_many([["cycles=0"]])


@pytest.mark.ci
def test_a_file_of_many_runs_has_the_table_of_them(tmp_path, monkeypatch):
    monkeypatch.setitem(batch.AT_ONCE, "metrics", 2)
    runs = [
        *([*SHORT, f"learning.rate={k // 4 + 1}e-1", f"seed={k % 4}"] for k in range(8)),
        ["scenario=quadruped", "cycles=1"],
    ]
    write_many(tmp_path / "all.parquet", runs)
    written, together = pd.read_parquet(tmp_path / "all.parquet"), run_many(runs, processes=1)
    pd.testing.assert_frame_equal(written[together.columns], together, check_exact=True, check_dtype=False)
    with pytest.raises(BadInput, match="is a folder"):
        write_many(tmp_path, runs)
    assert [path.name for path in tmp_path.iterdir()] == ["all.parquet"]


@pytest.mark.ci
def test_a_script_without_a_guard_can_run_many(tmp_path):
    (tmp_path / "script.py").write_text("import cmacexp\nprint(len(cmacexp.run_many([['cycles=1']] * 2)))\n")
    done = python("script.py", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, "2\n"), done.stderr


STUDY = """
from cmacexp.study import Study, grid
RUNS = grid("cycles=1", "feedforward=none", over={"seed": [1, 2, 3]})
STUDY = Study(title="Few", question="Does it run?", runs=lambda quick: RUNS)
"""


@pytest.mark.nightly
def test_a_study_runs_in_tasks_of_a_launcher(tmp_path):
    (tmp_path / "few.py").write_text(STUDY)
    (tmp_path / "few.md").write_text("Nothing to say.\n")
    command = ["-m", "cmacexp.study", "few.py", "--folder", "st", "--launcher", "submitit_local", "--workers", "2"]
    done = python(*command, "--setting", "timeout_min=60", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    manifests = [json.loads(path.read_text()) for path in (tmp_path / "st" / "runs").glob("*/manifest.json")]
    assert [manifest["status"] for manifest in manifests] == ["completed"] * 3
    assert len(list((tmp_path / "st" / "tasks" / ".submitit").iterdir())) >= 2


@pytest.mark.ci
def test_a_key_without_effect_in_all_runs_is_warned_of():
    runs = [[*SHORT, "feedforward=none", f"cmac.layers={n}", f"seed={s}"] for n in (8, 16) for s in (0, 1)]
    with pytest.warns(WithoutEffect) as caught:
        run_many(runs)
    layers, seed = caught
    assert str(layers.message).startswith("cmac.layers has no effect: needs feedforward in")
    assert str(seed.message).startswith("seed has no effect: needs")
    assert {layers.filename, seed.filename} == {__file__}
    with pytest.warns(WithoutEffect, match=r"seed") as caught:
        run_many([*runs, [*SHORT, "cmac.layers=16"]])
    assert len(caught) == 1, "the layers count in one of the runs"
