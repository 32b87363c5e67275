"""Sweeps from the command line: what they leave, what they say, how they resume, where they run."""

import json
import os
import re
import shutil
import signal
import time

import numpy as np
import pandas as pd
import pytest
import yaml
from support.command import ROOT, cmacexp, python, started
from support.manifests import change_manifest

from cmacexp import load_sweep
from cmacexp.data.discovery import runs_below
from cmacexp.data.integrity import faults
from cmacexp.errors import BadRun
from cmacexp.experiment.objective import describe_best, find_direction, read_objective
from cmacexp.experiment.sweep import Sweep
from cmacexp.experiment.sweep_results import read_results
from cmacexp.metrics.metric import NEITHER
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.report.run_summary import RunSummary

SWEEPER = '''
import json
from dataclasses import dataclass
from pathlib import Path

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.config_store import ConfigStore


class HalvingSweeper(BasicSweeper):
    """Halves learning.rate as long as what the job gives gets less."""

    def sweep(self, arguments):
        rate, found = 1.6, []
        Path(self.config.hydra.sweep.dir).mkdir(parents=True, exist_ok=True)
        while len(found) < 2 or found[-1] < found[-2]:
            job = [*arguments, f"learning.rate={rate}"]
            (done,) = self.launcher.launch([job], initial_job_idx=len(found))
            found.append(done.return_value)
            rate /= 2
        (Path(self.config.hydra.sweep.dir) / "found.json").write_text(json.dumps(found))


@dataclass
class HalvingSweeperConf:
    _target_: str = "hydra_plugins.halving.HalvingSweeper"
    max_batch_size: int | None = None


ConfigStore.instance().store(group="hydra/sweeper", name="halving", node=HalvingSweeperConf)
'''


def table_of(folder):
    return pd.read_parquet(folder / "sweep.parquet")


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    """A sweep with a result, a divergence and bad input."""
    folder = tmp_path_factory.mktemp("mixed")
    done = cmacexp("-m", "controller.velocity_gain=5,80,-1", "cycles=2", "hydra.sweep.dir=s", folder=folder)
    return folder / "s", done


def test_the_table_has_a_row_for_each_job_with_overrides_status_and_metrics(mixed):
    table = table_of(mixed[0])
    assert table["run"].tolist() == [0, 1, 2]
    assert table["folder"].tolist() == ["0", "1", "2"]
    assert table["controller.velocity_gain"].tolist() == [5, 80, -1]
    assert table["status"].tolist() == ["completed", "diverged", "failed"]
    assert table["overrides"][0] == "controller.velocity_gain=5 cycles=2 record=trace"
    metrics = pd.read_parquet(mixed[0] / "0" / "metrics.parquet")
    assert table["final_force_rmse"][0] == metrics["force_rmse"].iloc[-1]
    assert table["best_force_rmse"][0] == metrics["force_rmse"].min()
    assert table["final_torque_peak"][0] == metrics["torque_peak"].iloc[-1]
    assert table["final_force_rmse"][1:].isna().all()


def test_all_metrics_of_a_sweep_are_one_table(mixed, tmp_path):
    table = load_sweep(mixed[0])
    assert table["run"].tolist() == [0, 0, 1, 2]
    assert table["folder"].tolist() == ["0", "0", "1", "2"]
    assert table["controller.velocity_gain"].tolist() == [5, 5, 80, -1]
    assert table["status"].tolist() == ["completed", "completed", "diverged", "failed"]
    own = pd.read_parquet(mixed[0] / "0" / "metrics.parquet")
    pd.testing.assert_frame_equal(table[:2][own.columns], own, check_dtype=False)
    assert table["cycle"].isna().tolist() == [False, False, False, True]
    folder = shutil.copytree(mixed[0], tmp_path / "s")
    (folder / "0" / "metrics.parquet").write_bytes((folder / "1" / "metrics.parquet").read_bytes())
    with pytest.raises(BadRun, match=r"0/metrics.parquet"):
        load_sweep(folder)


def test_a_row_of_a_body_has_its_metrics_too(tmp_path):
    cmacexp("-m", "scenario=quadruped", "seed=0,1", "cycles=1", "hydra.sweep.dir=s", folder=tmp_path)
    table, body = load_sweep(tmp_path / "s"), pd.read_parquet(tmp_path / "s" / "1" / "body_metrics.parquet")
    assert table["leg"].tolist() == [1, 2, 3, 4] * 2
    assert table["tilt_max"][4:].tolist() == [body["tilt_max"][0]] * 4


def test_both_tables_say_the_same(mixed):
    read = pd.read_csv(mixed[0] / "sweep.csv", dtype={"folder": str, "cause": str}).fillna({"cause": ""})
    pd.testing.assert_frame_equal(table_of(mixed[0]), read, check_dtype=False)


@pytest.mark.parametrize("name", ["sweep.parquet", "sweep.csv"])
def test_a_changed_table_is_found(mixed, tmp_path, name):
    folder = shutil.copytree(mixed[0], tmp_path / "s")
    assert folder not in runs_below(folder), "a sweep is no run"
    assert not faults(folder)
    with (folder / name).open("ab") as file:
        file.write(b" ")
    assert faults(folder) == [f"{name}: changed since it was written"]


def test_jobs_are_labelled_by_their_manifests(mixed, tmp_path):
    folder = shutil.copytree(mixed[0], tmp_path / "s")
    records = [folder / job / ".hydra" / "overrides.yaml" for job in ("0", "1")]
    for record, text in zip(records, [record.read_text() for record in reversed(records)], strict=True):
        record.write_text(text)
    _, rows = read_results(Sweep(folder))
    assert [row["overrides"] for row in rows] == table_of(folder)["overrides"].tolist()


def test_a_sweep_keeps_no_recording_unless_it_is_asked_for(mixed, tmp_path):
    assert not list(mixed[0].rglob("*.rrd"))
    cmacexp("-m", "seed=0", "cycles=1", "record=full", "hydra.sweep.dir=s", folder=tmp_path)
    assert (tmp_path / "s" / "0" / "recording.rrd").exists()


def test_a_job_that_failed_leaves_its_reason_on_disk(mixed):
    manifest = json.loads((mixed[0] / "2" / "manifest.json").read_text())
    assert (manifest["status"], manifest["bad_input"], manifest["files"]) == ("failed", True, {})
    assert mixed[1].stderr.splitlines()[-1] == f"  2 failed: {manifest['cause']}"
    assert mixed[1].returncode == 1
    assert python("-m", "cmacexp.verify", str(mixed[0]), folder=mixed[0]).returncode == 0


def test_a_sweep_of_bad_input_alone_is_bad_input(tmp_path):
    assert cmacexp("-m", "cycles=0,-1", "hydra.sweep.dir=s", folder=tmp_path).returncode == 2
    assert table_of(tmp_path / "s")["status"].tolist() == ["failed", "failed"]


def test_a_name_that_cannot_be_stops_the_sweep_before_its_first_job(tmp_path):
    done = cmacexp("-m", "seed=0,1", "force_control=stiffness,stifness", folder=tmp_path)
    assert done.returncode == 2
    assert not list(tmp_path.rglob("manifest.json"))


def test_a_part_that_raises_fails_its_job_alone(tmp_path):
    code = "from cmacexp.feedforward import CmacFeedforward\n\nclass Broken(CmacFeedforward):\n"
    code += "    def reset(self, setup):\n        raise RuntimeError('no such luck')\n"
    (tmp_path / "mine.py").write_text(code)
    targets = "feedforward._target_=mine.Broken,cmacexp.feedforward.CmacFeedforward"
    done = cmacexp("-m", targets, "cycles=1", "hydra.sweep.dir=s", folder=tmp_path)
    assert done.returncode == 1
    assert table_of(tmp_path / "s")["status"].tolist() == ["failed", "completed"]
    assert table_of(tmp_path / "s")["cause"][0] == "before the first step: RuntimeError: no such luck"
    assert "in reset" in json.loads((tmp_path / "s" / "0" / "manifest.json").read_text())["traceback"]


IDLE = """
class Idle:
    acts = True

    def __init__(self, gain):
        assert gain != 3, "no such gain"

    def reset(self, setup):
        pass

    def predict(self, reference, learning_error):
        return 0.0 * learning_error
"""


def test_a_key_of_a_custom_component_that_had_no_effect_is_reported(tmp_path):
    (tmp_path / "mine.py").write_text(IDLE)
    swept = ["feedforward._target_=mine.Idle", "+feedforward.gain=1,2,3", "controller.velocity_gain=5,6"]
    done = cmacexp("-m", "scenario=force_step", *swept, "cycles=1", "hydra.sweep.dir=s", folder=tmp_path)
    effects = [line for line in done.stderr.splitlines() if line.startswith(("warning", "note"))]
    equal = "jobs 0, 2 gave equal results; the same in 1 more group of jobs"
    assert effects == [f"warning: feedforward.gain had no effect: {equal}"], "jobs that failed do not count"
    assert table_of(tmp_path / "s")["status"].tolist() == ["completed"] * 4 + ["failed"] * 2


RESUME = ["sweep.resume=true", "hydra.sweep.dir=s"]


def test_resume_runs_what_is_missing_failed_or_of_another_config(tmp_path):
    swept = ["cmac.layers=8,10,16,32", "cycles=1"]
    cmacexp("-m", *swept, "hydra.sweep.dir=s", folder=tmp_path)
    shutil.rmtree(tmp_path / "s" / "0")
    change_manifest(tmp_path / "s" / "1", status="failed")
    kept = (tmp_path / "s" / "3" / "trace.parquet").stat().st_mtime_ns
    done = cmacexp("-m", "cmac.layers=8,10,20,32", "cycles=1", *RESUME, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("finished before, not run again") == 1
    assert "#3 cmac.layers=32 cycles=1 record=trace: finished before" in done.stdout
    assert (tmp_path / "s" / "3" / "trace.parquet").stat().st_mtime_ns == kept
    assert table_of(tmp_path / "s")["cmac.layers"].tolist() == [8, 10, 20, 32]
    assert table_of(tmp_path / "s")["status"].tolist() == ["completed"] * 4


def test_the_table_leaves_out_what_an_earlier_sweep_left(tmp_path):
    cmacexp("-m", "seed=0,1,2", "cycles=1", "hydra.sweep.dir=s", folder=tmp_path)
    cmacexp("-m", "seed=0,1", "cycles=1", *RESUME, folder=tmp_path)
    assert table_of(tmp_path / "s")["seed"].tolist() == [0, 1]


def test_a_sweeper_can_search_over_a_metric(tmp_path):
    plugin = tmp_path / "hydra_plugins" / "halving"
    plugin.mkdir(parents=True)
    (plugin / "__init__.py").write_text(SWEEPER)
    environment = {"PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}
    search = ["-m", "hydra/sweeper=halving", "cycles=3", "optimize=transfer_rmse_y", "hydra.sweep.dir=s"]
    done = cmacexp(*search, folder=tmp_path, **environment)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "s" / "found.json").read_text())
    assert len(found) >= 2
    assert found[-1] >= found[-2]
    table = table_of(tmp_path / "s")
    assert (table["status"][0], found[0]) == ("diverged", float("inf"))
    assert table["final_transfer_rmse_y"][1:].tolist() == found[1:]


SEARCH = ["-m", "hydra/sweeper=optuna", "hydra.sweeper.sampler.seed=1", "hydra.sweeper.n_trials=4", "cycles=3"]


AIMS = [("feedforward_share", "maximize"), ("transfer_rmse_y", "minimize")]


@pytest.mark.parametrize(("metric", "direction"), AIMS)
def test_a_search_goes_in_the_direction_that_is_better_and_names_the_best_job(metric, direction, tmp_path):
    """Of its jobs one diverges and one fails: neither may be the best."""
    search = [*SEARCH, "learning.rate=interval(0.05,3.0)", f"optimize={metric}", "hydra.sweep.dir=s"]
    done = cmacexp(*search, folder=tmp_path)
    table = table_of(tmp_path / "s")
    assert table["status"].tolist() == ["diverged", "failed", "completed", "completed"]
    values = table[f"final_{metric}"]
    best = table.iloc[values.idxmax() if direction == "maximize" else values.idxmin()]
    found = yaml.safe_load((tmp_path / "s" / "optimization_results.yaml").read_text())
    assert found["best_value"] == best[f"final_{metric}"]
    assert found["best_params"] == {"learning.rate": best["learning.rate"]}
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("best: ")]
    named = f"best:      #{best['run']} learning.rate={best['learning.rate']}: {metric} = "
    assert line.startswith(named)
    assert line.endswith(f", in s/{best['run']}")
    hydra = yaml.safe_load((tmp_path / "s" / str(best["run"]) / ".hydra" / "hydra.yaml").read_text())
    assert hydra["hydra"]["sweeper"]["direction"] == direction


def test_a_sweep_without_a_search_names_its_best_job_too(tmp_path):
    swept = ["scenario=force_step", "controller.velocity_gain=5,6", "cycles=1", "optimize=force_rmse"]
    done = cmacexp("-m", *swept, "hydra.sweep.dir=s", folder=tmp_path)
    best = table_of(tmp_path / "s")["final_force_rmse"].idxmin()
    assert f"best:      #{best} controller.velocity_gain={5 + best}: force_rmse = " in done.stdout


def test_every_metric_is_searched_in_the_direction_that_is_better():
    for name, metric in ALL_METRICS.items():
        directions = {"large": "maximize", "small": "minimize", "near 0": "minimize"}
        assert find_direction(name, None, searches=False) == directions.get(metric.better)
        if metric.better == NEITHER:
            assert find_direction(name, "maximize", searches=True) == "maximize"


def test_the_objective_counts_a_fall_as_the_worst(tmp_path):
    values = {"force_rmse": 0.5, "force_steady_state_error": -0.2, "feedforward_share": 0.7, "height_mean": 0.5}
    metrics = {name: np.array([9.0, value]) for name, value in values.items()}
    done, fell = (RunSummary(tmp_path, status, "", cycles=2, metrics=metrics) for status in ("completed", "fell"))
    for name, value in values.items():
        assert read_objective(name, done, None) == abs(value)
        assert read_objective(name, fell, "minimize") == read_objective(name, fell, None) == float("inf")
        assert read_objective(name, fell, "maximize") == float("-inf")
    assert read_objective("tilt_max", done, "minimize") == float("inf"), "it has no such metric"
    assert describe_best("force_rmse", "minimize", [fell], []) == "none: no job completed with a value of force_rmse"


KINDS = ["-m", "cmac.layers=8,0", "feedforward=cmac,none", "cycles=1"]


@pytest.fixture(scope="module")
def by_cores(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cores")
    return folder / "s", cmacexp(*KINDS, "hydra.sweep.dir=s", folder=folder)


@pytest.mark.parametrize("launcher", ["basic", "joblib", "basic sweep.chunk=3", "submitit_local sweep.chunk=3"])
def test_other_launchers_leave_the_same_folders_and_table(launcher, by_cores, tmp_path):
    folder, done = by_cores
    other = cmacexp(*KINDS, *f"hydra/launcher={launcher}".split(), "hydra.sweep.dir=s", folder=tmp_path)
    assert [done.returncode, other.returncode] == [1, 1]
    assert done.stderr.splitlines()[-1] == other.stderr.splitlines()[-1]
    assert "Traceback" not in other.stderr
    pd.testing.assert_frame_equal(table_of(folder), table_of(tmp_path / "s"))
    for job in ("0", "1"):
        assert files_of(folder / job) == files_of(tmp_path / "s" / job)


def files_of(folder):
    """Hashes of the files of a job, its config and overrides, and what Hydra calls the job."""
    texts = [(folder / ".hydra" / f"{name}.yaml").read_text() for name in ("config", "overrides")]
    texts = [re.sub(r"(- .?sweep.|  )chunk.*\n", "", text) for text in texts]
    job = yaml.safe_load((folder / ".hydra" / "hydra.yaml").read_text())["hydra"]["job"]
    name = job["override_dirname"].removesuffix(",sweep.chunk=3")
    return json.loads((folder / "manifest.json").read_text())["files"], texts, job["num"], name


def test_a_job_has_the_bytes_of_a_single_run(by_cores, tmp_path):
    cmacexp("cmac.layers=8", "feedforward=cmac", "cycles=1", "record=trace", "hydra.run.dir=r", folder=tmp_path)
    single = json.loads((tmp_path / "r" / "manifest.json").read_text())["files"]
    assert single == json.loads((by_cores[0] / "0" / "manifest.json").read_text())["files"]


def test_jobs_that_only_hydra_understands_are_run_by_it(tmp_path):
    linked = ["cmac.resolution_elements='${cmac.layers}'", "hydra.sweep.subdir='layers-${cmac.layers}'"]
    done = cmacexp("-m", "cmac.layers=8,16", "cycles=1", *linked, "hydra.sweep.dir=s", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    for table in (table_of(tmp_path / "s"), load_sweep(tmp_path / "s")):
        assert table["run"].tolist() == [0, 1], "an integer whatever the folders are called"
        assert table["folder"].tolist() == ["layers-8", "layers-16"]


def test_jobs_need_a_process(tmp_path):
    done = cmacexp("-m", "seed=1,2", "hydra.launcher.processes=-2", "hydra.sweep.dir=s", folder=tmp_path)
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    assert "hydra.launcher.processes=-2: must be at least 1" in done.stderr


def test_a_launcher_that_is_not_installed_is_told_with_its_extra():
    from hydra.errors import MissingConfigException

    from cmacexp.config.explain import explain_composition

    missing = MissingConfigException("not found", "hydra/launcher/submitit_slurm", options=["basic"])
    told = explain_composition(missing, [])
    assert told.startswith("hydra/launcher=submitit_slurm: is not installed: ")
    assert "[cluster]" in told


def test_an_interrupted_sweep_tells_what_is_done(tmp_path):
    process = started("-m", "seed=range(500)", "cycles=1", "hydra.sweep.dir=s", folder=tmp_path)
    while not (tmp_path / "s" / "2" / "manifest.json").exists() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert process.returncode == 130
    assert "interrupted" in err
    assert "Traceback" not in err
    assert "500 jobs: " in out
    assert "unfinished" in out
    continued = f"continue:  the same command with sweep.resume=true hydra.sweep.dir={tmp_path / 's'}"
    assert continued in out.replace("=s\n", f"={tmp_path / 's'}\n")
    table = table_of(tmp_path / "s")
    assert 2 in table["run"].tolist()
    assert set(table["status"]) == {"completed"}
