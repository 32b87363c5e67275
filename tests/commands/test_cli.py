"""The command line: what a run leaves behind, exit codes, bad input, faults."""

import json
import signal
import subprocess
import time

import pandas as pd
import pyarrow.parquet as pq
import pytest
from support.command import cmacexp, python, started

from cmacexp.config import config_folder

TRACE = [
    *["step", "time", "cycle", "leg", "phase", "progress", "x_desired", "y_desired", "x_reference", "y_reference"],
    *["x", "y", "vx", "vy", "q1", "q2", "dq1", "dq2", "force", "force_desired", "force_measured"],
    *["tau_feedback_1", "tau_feedback_2", "tau_feedforward_1", "tau_feedforward_2"],
]
METRICS = {
    *["transfer_rmse_x", "transfer_rmse_y", "support_rmse_x", "force_rmse", "force_rmse_cycle", "force_settled"],
    *["force_steady_state_error", "force_overshoot", "force_ripple", "feedback_rms", "feedforward_rms"],
    *["torque_peak", "feedforward_share"],
}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    done = cmacexp("scenario=one_leg", f"hydra.run.dir={folder}", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder, done


def test_trace_has_the_columns_of_the_contract_with_unit_and_meaning(run):
    schema = pq.read_schema(run[0] / "trace.parquet")
    assert schema.names == TRACE
    assert all(field.metadata[b"meaning"] for field in schema)
    assert schema.field("tau_feedback_1").metadata[b"unit"] == b"N m"


def test_trace_rows(run):
    trace = pd.read_parquet(run[0] / "trace.parquet")
    assert len(trace) == 3000
    assert list(trace.cycle.unique()) == [1, 2, 3, 4, 5]
    assert (trace.phase[:120] == "transfer").all()
    assert (trace.phase[120:600] == "support").all()
    assert (trace.force == trace.force_measured).all()


def test_metrics_have_the_columns_of_the_contract_in_both_files(run):
    table = pd.read_parquet(run[0] / "metrics.parquet")
    assert set(table.columns) >= METRICS
    pd.testing.assert_frame_equal(table, pd.read_csv(run[0] / "metrics.csv"), check_dtype=False)


def test_manifest(run):
    manifest = json.loads((run[0] / "manifest.json").read_text())
    assert manifest["status"] == "completed"
    assert manifest["steps"] == 3000
    files = {"trace.parquet", "memory.parquet", "metrics.parquet", "metrics.csv", "recording.rrd"}
    assert set(manifest["files"]) == files
    assert {"seed", "config", "config_hash", "versions", "git_commit", "rollout_seconds", "wall_seconds"} <= set(
        manifest
    )


def test_summary_names_the_folder(run):
    folder, done = run
    assert done.stdout.splitlines()[-1] == str(folder)


def test_help_fits_a_screen_and_lists_every_option_of_a_group_that_it_names(tmp_path):
    lines = cmacexp("--help", folder=tmp_path).stdout.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    for group in ("scenario", "force_control", "feedforward"):
        (listed,) = [line.split("=")[1].split(" | ") for line in lines if line.startswith(f"  {group}=")]
        assert set(listed) == {path.stem for path in (config_folder() / group).glob("*.yaml")}


@pytest.mark.parametrize(
    ("group", "field", "allowed"),
    [
        ("force_control", "elasticity=0.1", "at least 0 and at most 1000000, in m/N. "),
        ("feedforward", "centres=100", "at least 1 and at most 4096. "),
        ("learning", "guard=none", "none, freeze, refine. "),
        ("record", "cycles=null", "at least 1 and at most 1000000000 or null, in cycle. "),
    ],
)
def test_help_of_a_group_lists_options_and_fields_with_unit_and_range(group, field, allowed, tmp_path):
    done = cmacexp("feedforward=rbf", f"{group}=help", folder=tmp_path)
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    for path in (config_folder() / group).glob("*.yaml"):
        assert f"  {path.stem}" in lines
    after = lines[lines.index(f"  {group}.{field}") + 1 :]
    assert " ".join(line.strip() for line in after[:3]).startswith(allowed)
    assert not list(tmp_path.iterdir())


def test_help_of_a_group_without_fields_lists_its_options(tmp_path):
    done = cmacexp("scenario=help", folder=tmp_path)
    assert (done.returncode, "  one_leg" in done.stdout, "FIELD" in done.stdout) == (0, True, False)
    done = cmacexp("terrain.damping=-1", "terrain=help", folder=tmp_path)
    assert done.stdout.splitlines()[-1].endswith(
        "terrain.damping=-1.0: must be at least 0 and at most 1000000000 (N s/m)"
    )


@pytest.mark.parametrize("flag", ["-m", "--multirun"])
def test_a_sweep_is_one_wherever_its_flag_stands(flag, tmp_path):
    words = ["scenario=force_step", flag, "seed=1,2", "cycles=1", "record=metrics", "hydra.sweep.dir=out"]
    done = cmacexp(*words, folder=tmp_path)
    assert "2 jobs: 2 completed" in done.stdout, done.stderr


def test_config_hash_follows_what_changes_the_results(tmp_path):
    hashes = []
    for i, overrides in enumerate([[], ["record=trace"], ["learning.rate=0.1"]]):
        folder = tmp_path / str(i)
        cmacexp("cycles=1", *overrides, f"hydra.run.dir={folder}", folder=tmp_path)
        hashes.append(json.loads((folder / "manifest.json").read_text())["config_hash"])
    assert hashes[0] == hashes[1] != hashes[2]


def test_force_step_leaves_joints_and_unused_references_empty(tmp_path):
    cmacexp(
        "scenario=force_step", "force_control=damping", "record=trace", f"hydra.run.dir={tmp_path}", folder=tmp_path
    )
    trace = pd.read_parquet(tmp_path / "trace.parquet")
    assert len(trace) == 2000
    assert trace[["q1", "q2", "dq1", "dq2", "y_reference"]].isna().all(axis=None)
    assert (trace.phase == "support").all()
    assert trace.y[0] == pytest.approx(0.45)


@pytest.mark.parametrize("override", ["a=[", "cmac.layers=many", "gait.stroke=2", "optimize=transfer_rmse"])
def test_bad_input_is_one_line_before_anything_is_simulated(override, tmp_path):
    done = cmacexp(override, folder=tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"error: {override.partition('=')[0]}=")
    assert not done.stdout
    assert not list(tmp_path.rglob("*.parquet")) + list(tmp_path.rglob(".hydra"))


def test_a_sweep_with_a_divergence_alone_has_not_failed(tmp_path):
    assert cmacexp("-m", "controller.velocity_gain=80", folder=tmp_path).returncode == 0


def test_a_class_of_the_user_runs_in_the_place_of_the_one_it_is_made_from(tmp_path):
    code = "from cmacexp.feedforward import CmacFeedforward\n\nclass Lazy(CmacFeedforward):\n"
    code += "    def predict(self, reference, learning_error):\n        return 0.0 * learning_error\n"
    (tmp_path / "mine.py").write_text(code)
    done = cmacexp("feedforward._target_=mine.Lazy", "cycles=2", "hydra.run.dir=r", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (pd.read_parquet(tmp_path / "r" / "metrics.parquet").feedforward_share == 0.0).all()


def test_a_fall_is_a_result(tmp_path):
    done = cmacexp("scenario=quadruped", "posture.gain=0", f"hydra.run.dir={tmp_path}", folder=tmp_path)
    assert done.returncode == 3
    assert "fell at step" in done.stdout
    assert (tmp_path / "recording.rrd").exists()
    assert python("-m", "cmacexp.verify", str(tmp_path), folder=tmp_path).returncode == 0


def test_score_gives_the_same_metrics_again(run, tmp_path):
    folder = tmp_path / "copy"
    subprocess.run(["cp", "-r", str(run[0]), str(folder)], check=True)
    before = (folder / "metrics.parquet").read_bytes()
    (folder / "metrics.parquet").unlink()
    assert python("-m", "cmacexp.score", str(folder), folder=tmp_path).returncode == 0
    assert (folder / "metrics.parquet").read_bytes() == before
    assert python("-m", "cmacexp.verify", str(folder), folder=tmp_path).returncode == 0


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_run_that_is_ended_keeps_what_there_is(tmp_path, number, code):
    process = started("cycles=1000000", "feedforward=none", "record.cycles=[1]", "hydra.run.dir=r", folder=tmp_path)
    while not list(tmp_path.glob("r/.cmacexp-new/*.parquet*")) and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(number)
    _, err = process.communicate()
    assert process.returncode == code
    assert err.splitlines()[-1] == "interrupted"
    assert "Traceback" not in err
    assert json.loads((tmp_path / "r" / "manifest.json").read_text())["status"] == "interrupted"
    assert python("-m", "cmacexp.verify", "r", folder=tmp_path).returncode == 0
