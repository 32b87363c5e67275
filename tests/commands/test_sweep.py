"""Sweeps from the command line: what they leave, what they say, how they resume, where they run."""

import json
import shutil
import signal
import subprocess
import sys
import time

import pandas as pd
import pytest
import yaml
from support.command import call, environment, interrupted, started, sweep, table_of
from support.doors import BadRun, remove_dead_parts
from support.manifests import change_manifest

import cmacexp
from cmacexp import load_sweep

SHORT = ("scenario=one_leg", "gait.cycle_time=0.5", "gait.stroke=0.02", "cycles=1")
BASIC = "hydra/launcher=basic"


def manifest_of(folder, job):
    return json.loads((folder / "s" / job / "manifest.json").read_text())


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    """A sweep with results, a divergence and bad input, in this process: its folder, and how it ended."""
    folder = tmp_path_factory.mktemp("mixed")
    done = sweep("controller.velocity_gain=6,5,80,-1", "cycles=2", "optimize=transfer_rmse_y", BASIC, folder=folder)
    return folder, done


def test_the_table_has_a_row_for_each_job_with_overrides_status_and_metrics(mixed):
    table = table_of(mixed[0])
    assert table["run"].tolist() == [0, 1, 2, 3]
    assert table["folder"].tolist() == ["0", "1", "2", "3"]
    assert table["controller.velocity_gain"].tolist() == [6, 5, 80, -1]
    assert table["status"].tolist() == ["completed", "completed", "diverged", "failed"]
    assert table["overrides"][0] == "controller.velocity_gain=6 cycles=2 record=trace"
    metrics = cmacexp.load(mixed[0] / "s" / "0").metrics
    assert table["final_force_rmse"][0] == metrics["force_rmse"].iloc[-1]
    assert table["best_force_rmse"][0] == metrics["force_rmse"].min()
    assert table["final_force_rmse"][2:].isna().all()
    text = pd.read_csv(mixed[0] / "s" / "sweep.csv", dtype={"folder": str, "cause": str}).fillna({"cause": ""})
    pd.testing.assert_frame_equal(table, text, check_dtype=False)


def test_all_metrics_of_a_sweep_are_one_table(mixed, tmp_path):
    table = load_sweep(mixed[0] / "s")
    assert table["run"].tolist() == [0, 0, 1, 1, 2, 3]
    assert table["status"].tolist() == ["completed"] * 4 + ["diverged", "failed"]
    own = cmacexp.load(mixed[0] / "s" / "0").metrics
    pd.testing.assert_frame_equal(table[:2][own.columns], own, check_dtype=False)
    folder = shutil.copytree(mixed[0] / "s", tmp_path / "s")
    (folder / "0" / "metrics.parquet").write_bytes((folder / "1" / "metrics.parquet").read_bytes())
    with pytest.raises(BadRun, match=r"0/metrics.parquet"):
        load_sweep(folder)


def test_a_job_that_failed_leaves_its_reason_on_disk_and_the_best_one_is_named(mixed):
    manifest = manifest_of(mixed[0], "3")
    assert (manifest["status"], manifest["bad_input"], manifest["files"]) == ("failed", True, {})
    assert mixed[1].stderr.splitlines()[-1] == f"  3 failed: {manifest['cause']}"
    assert [mixed[1].returncode, call("score", mixed[0] / "s").returncode] == [1, 0], "what has no trace is left out"
    best = table_of(mixed[0])["final_transfer_rmse_y"].idxmin()
    assert f"best:      #{best} controller.velocity_gain={6 - best}: transfer_rmse_y = " in mixed[1].stdout
    assert "4 jobs: 2 completed, 1 diverged, 1 failed" in mixed[1].stdout


@pytest.mark.ci
@pytest.mark.parametrize(("jobs", "code"), [("cycles=0,-1", 2), ("controller.velocity_gain=80,81", 0)])
def test_a_sweep_of_bad_input_alone_is_bad_input_one_of_results_has_not_failed(jobs, code, tmp_path):
    assert sweep(jobs, BASIC, folder=tmp_path).returncode == code


@pytest.mark.ci
def test_resume_runs_what_is_missing_failed_or_of_another_config(tmp_path):
    swept = [*SHORT, BASIC]
    sweep("cmac.layers=8,10,16,32", *swept, folder=tmp_path)
    shutil.rmtree(tmp_path / "s" / "0")
    change_manifest(tmp_path / "s" / "1", status="failed")
    done = sweep("cmac.layers=8,10,20,32", *swept, "sweep.resume=true", folder=tmp_path)
    (kept,) = [line for line in done.stdout.splitlines() if "finished before, not run again" in line]
    assert kept.startswith("#3 cmac.layers=32 ")
    table = table_of(tmp_path)
    assert table["cmac.layers"].tolist() == [8, 10, 20, 32]
    assert table["status"].tolist() == ["completed"] * 4
    more = sweep("cmac.layers=8,10", *swept, "record=metrics", "sweep.resume=true", folder=tmp_path)
    assert "finished before" in more.stdout, "what an earlier version or record=trace left counts"
    assert table_of(tmp_path)["cmac.layers"].tolist() == [8, 10], "the table leaves out what an earlier sweep left"


@pytest.mark.ci
@pytest.mark.parametrize(("record", "others"), [("trace", "1, e.g. 2"), ("metrics", "3, e.g. 0")])
def test_of_a_longer_sweep_in_the_same_folder_no_job_is_read_and_none_is_lost(record, others, tmp_path, capsys):
    sweep("cmac.layers=8,10,16", *SHORT, BASIC, folder=tmp_path)
    sweep("cmac.layers=20,32", *SHORT, BASIC, f"record={record}", folder=tmp_path)
    assert load_sweep(tmp_path / "s")["cmac.layers"].unique().tolist() == [20, 32]
    assert capsys.readouterr().err.count(f"({others}) are not of its last sweep") == 1
    assert load_sweep(tmp_path / "s" / "2")["cmac.layers"].unique().tolist() == [16]


@pytest.mark.ci
def test_a_search_goes_in_the_direction_that_is_better_and_names_the_best_job(tmp_path):
    """Of its jobs one diverges and one fails: neither may be the best."""
    search = ["hydra/sweeper=optuna", "hydra.sweeper.sampler.seed=1", "hydra.sweeper.n_trials=4", "cycles=3"]
    done = sweep(*search, "learning.rate=interval(0.05,3.0)", "optimize=feedforward_share", folder=tmp_path)
    table = table_of(tmp_path)
    assert table["status"].tolist() == ["diverged", "failed", "completed", "completed"]
    best = table.loc[table["final_feedforward_share"].idxmax()]
    found = yaml.safe_load((tmp_path / "s" / "optimization_results.yaml").read_text())
    assert found["best_value"] == best["final_feedforward_share"]
    assert found["best_params"] == {"learning.rate": best["learning.rate"]}
    assert f"best:      #{best['run']} learning.rate={best['learning.rate']}: feedforward_share = " in done.stdout


KINDS = [*SHORT, "warn=false", "cmac.layers=8,0", "feedforward=cmac,none"]


@pytest.fixture(scope="module")
def by_cores(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cores")
    return folder, sweep(*KINDS, folder=folder)


LAUNCHERS = [
    "basic",
    "basic sweep.chunk=3",
    "dask",
    "submitit_local sweep.chunk=3",
]


@pytest.mark.ci
@pytest.mark.parametrize("launcher", LAUNCHERS)
def test_other_launchers_leave_the_same_folders_and_table(launcher, by_cores, tmp_path):
    folder, done = by_cores
    other = sweep(*KINDS, *f"hydra/launcher={launcher}".split(), folder=tmp_path)
    assert [done.returncode, other.returncode] == [1, 1]
    assert done.stderr.splitlines()[-1] == other.stderr.splitlines()[-1]
    pd.testing.assert_frame_equal(table_of(folder), table_of(tmp_path))
    for job in ("0", "1"):
        assert manifest_of(folder, job)["files"] == manifest_of(tmp_path, job)["files"]


@pytest.mark.ci
def test_a_job_has_the_bytes_of_a_single_run(by_cores, tmp_path):
    single = cmacexp.run([*SHORT, "cmac.layers=8", "feedforward=cmac", "record=trace", "warn=false"], tmp_path / "r")
    assert single.manifest["files"] == manifest_of(by_cores[0], "0")["files"]


@pytest.mark.ci
def test_values_and_folders_of_jobs_can_follow_from_what_hydra_says_of_them(tmp_path):
    linked = [
        *["cmac.resolution_elements='${cmac.layers}'", "seed=9", "++seed='${hydra:job.num}'"],
        "hydra.sweep.subdir='${hydra.job.num}-${cmac.layers}'",
    ]
    assert (
        sweep("cmac.layers=8,16,32", *SHORT, *linked, "hydra.launcher.processes=1", folder=tmp_path).returncode == 0
    )
    for number, layers in enumerate((8, 16, 32)):
        config = manifest_of(tmp_path, f"{number}-{layers}")["config"]
        assert (config["cmac"]["resolution_elements"], config["seed"]) == (layers, number)
    for table in (table_of(tmp_path), load_sweep(tmp_path / "s")):
        assert table["run"].tolist() == [0, 1, 2], "an integer whatever the folders are called"
        assert table["folder"].tolist() == ["0-8", "1-16", "2-32"]


@pytest.mark.ci
def test_a_key_that_swept_options_have_need_not_be_one_of_the_default_option(tmp_path):
    swept = sweep(
        *SHORT, "feedforward=inverse_dynamics,cmac_on_model", "feedforward.mass_factor=0.5", folder=tmp_path
    )
    assert swept.returncode == 0
    overrides = [text.split() for text in table_of(tmp_path).overrides]
    assert ["feedforward.mass_factor=0.5" in words for words in overrides] == [True, True]
    refused = sweep(*SHORT, "feedforward=none,cmac_on_model", "feedforward.mass_factor=0.5", folder=tmp_path)
    expected = (
        "feedforward.mass_factor: no such key with feedforward=none; cmac_on_model, identified, inverse_dynamics"
    )
    assert refused.returncode == 2
    assert expected in refused.stderr


OWN_LAUNCHER = {
    "defaults: [one_leg, _self_, override /hydra/launcher: basic]": "hydra/launcher=basic",
    "defaults: [one_leg, _self_]\nhydra: {launcher: {processes: 1}}": "'processes': 1",
}


@pytest.mark.parametrize(("content", "named"), OWN_LAUNCHER.items())
def test_a_launcher_that_a_swept_option_chooses_is_not_ignored(content, named, tmp_path):
    path = tmp_path / "own" / "scenario" / "mine.yaml"
    path.parent.mkdir(parents=True)
    path.write_text(f"# @package _global_\n{content}\n")
    words = ("scenario=one_leg,mine", *SHORT[1:], "record=metrics", "--config-dir", tmp_path / "own")
    refused = sweep(*words, folder=tmp_path)
    assert refused.returncode == 2
    assert (named in refused.stderr, refused.stderr.count("\n")) == (True, 1)
    if "override" in content:
        assert sweep(*words, BASIC, folder=tmp_path).returncode == 0  # the command line decides


@pytest.mark.ci
def test_an_interrupted_sweep_tells_what_is_done(tmp_path):
    words, parts = ("-m", "seed=range(500)", "cycles=1", "hydra.sweep.dir=s"), tmp_path / "s" / ".jobs"
    done = interrupted(*words, folder=tmp_path, once=lambda: len([*parts.glob("[!.]*")]) > 2)
    assert done.returncode == 130
    assert "interrupted" in done.stderr
    for said in ("500 jobs: ", "unfinished", "sweep.resume=true hydra.sweep.dir="):
        assert said in done.stdout
    table = table_of(tmp_path)
    assert len(table) > 2
    assert set(table["status"]) == {"completed"}


LONG = ("-m", "seed=1,2", "cycles=1000000", "feedforward=none", "record.cycles=[1]", "hydra.sweep.dir=s")


@pytest.mark.ci
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_sweep_interrupted_in_its_first_jobs_leaves_nothing_half_written_and_says_how_to_continue(number, tmp_path):
    done = interrupted(*LONG, folder=tmp_path, once=lambda: [*tmp_path.glob("s/.1.*.part")], number=number)
    assert done.stdout.endswith("sweep.resume=true hydra.sweep.dir=s\n")
    assert {path.name for path in (tmp_path / "s").iterdir()} == {"manifest.json", "multirun.yaml"}


@pytest.mark.ci
@pytest.mark.parametrize("typed", ["cmacexp -m seed=0,1", "cmacexp", "cmacexp.study mine.yaml"])
def test_from_a_folder_that_is_gone_a_command_ends_in_one_line(typed, tmp_path):
    words = ["sh", "-c", f"rmdir {tmp_path}; {sys.executable} -m {typed}"]
    done = subprocess.run(words, cwd=tmp_path, env=environment(), capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (2, "error: the current folder is gone: change to another one\n")


@pytest.mark.ci
def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    process = started(*LONG, folder=tmp_path)
    while not (parts := list(tmp_path.glob("s/.0.*.part"))) and process.poll() is None:
        time.sleep(0.02)
    process.kill()
    process.wait()
    while parts:  # the process that writes one holds its lock
        remove_dead_parts(tmp_path / "s", None)
        parts = list(tmp_path.glob("s/.0.*.part"))
        time.sleep(0.02)
