"""The command line: what a run leaves behind, exit codes, bad input, faults."""

import json
import re
import signal
import subprocess
import time

import pandas as pd
import pyarrow.parquet as pq
import pytest
from support.command import ROOT, cmacexp, python, started

from cmacexp.report.terminal import COMPILING

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


BAD = {
    "scenario=one_lag": "choose from force_step, one_leg, quadruped, quadruped_lasting, robot; did you mean one_leg?",
    "cmca=one_leg": "cmac, controller",
    "a=[": "cannot be read",
    "cmac=null": "a group takes the name of an option",
    "~plant": "plant=None: must be a group of fields",
    "cycles=${nope}": "interpolation key 'nope' not found",
    "cmac.layers=many": "cmac.layers=many: must be a whole number",
    "sampling_period=0.007": "sampling_period=0.007: must divide gait.cycle_time=3 s",
    "gait.stroke=2": "gait.stroke=2.0: the foot of leg 1 would be",
    "feedforward._target_=os.system": "feedforward._target_=os.system: must be a class",
    "optimize=transfer_rmse": "optimize=transfer_rmse: choose from transfer_rmse_x, transfer_rmse_y",
}
"""A mistake of each kind; ``test_messages.py`` has them all."""


@pytest.mark.parametrize("override", BAD)
def test_bad_input_is_one_line_before_anything_is_simulated(override, tmp_path):
    done = cmacexp(*override.split(), folder=tmp_path)
    assert done.returncode == 2
    assert BAD[override] in done.stderr
    assert len([line for line in done.stderr.strip().splitlines() if line != COMPILING]) == 1
    assert not done.stdout
    assert not list(tmp_path.rglob("*.parquet"))


def test_divergence_is_a_result(tmp_path):
    done = cmacexp("controller.velocity_gain=80", f"hydra.run.dir={tmp_path}", folder=tmp_path)
    assert done.returncode == 3
    assert re.search(r"diverged at step \d+ \(t = .* s\): joint \d of leg 1 moves at", done.stdout)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["status"] == "diverged"
    assert len(pd.read_parquet(tmp_path / "trace.parquet")) == manifest["steps"] > 0
    assert python("-m", "cmacexp.verify", str(tmp_path), folder=tmp_path).returncode == 0


def test_a_sweep_goes_on_past_divergence_and_bad_input(tmp_path):
    done = cmacexp("-m", "controller.velocity_gain=5,80,-1", "cycles=1", "hydra.sweep.dir=s", folder=tmp_path)
    assert done.returncode == 1
    statuses = [json.loads((tmp_path / "s" / n / "manifest.json").read_text())["status"] for n in "01"]
    assert statuses == ["completed", "diverged"]
    assert "error: #2: controller.velocity_gain=-1.0: must be at least 0" in done.stderr


def test_a_sweep_with_a_divergence_alone_has_not_failed(tmp_path):
    assert cmacexp("-m", "controller.velocity_gain=80", folder=tmp_path).returncode == 0


def test_a_run_folder_that_cannot_be_made_is_bad_input(tmp_path):
    (tmp_path / "file").touch()
    done = cmacexp("cycles=1", "hydra.run.dir=file/run", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "error: hydra.run.dir=file/run: cannot be made: Not a directory; choose another folder\n"


def test_bad_input_leaves_no_folder(tmp_path):
    cmacexp("cycles=0", folder=tmp_path)
    assert not list(tmp_path.rglob(".hydra"))


def test_score_refuses_a_changed_trace(run, tmp_path):
    folder = tmp_path / "copy"
    subprocess.run(["cp", "-r", str(run[0]), str(folder)], check=True)
    table = pq.read_table(folder / "trace.parquet")
    pq.write_table(table, folder / "trace.parquet")
    done = python("-m", "cmacexp.score", str(folder), folder=tmp_path)
    assert done.returncode == 2
    assert "changed since it was written" in done.stderr


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


def test_verify_sees_a_changed_byte_and_a_missing_file(run, tmp_path):
    folder = tmp_path / "copy"
    subprocess.run(["cp", "-r", str(run[0]), str(folder)], check=True)
    assert python("-m", "cmacexp.verify", str(folder), folder=tmp_path).returncode == 0
    data = bytearray((folder / "trace.parquet").read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "trace.parquet").write_bytes(data)
    (folder / "metrics.csv").unlink()
    done = python("-m", "cmacexp.verify", str(folder), folder=tmp_path)
    assert done.returncode == 4
    assert "trace.parquet: changed" in done.stdout
    assert "metrics.csv: missing" in done.stdout


def test_score_gives_the_same_metrics_again(run, tmp_path):
    folder = tmp_path / "copy"
    subprocess.run(["cp", "-r", str(run[0]), str(folder)], check=True)
    before = (folder / "metrics.parquet").read_bytes()
    (folder / "metrics.parquet").unlink()
    assert python("-m", "cmacexp.score", str(folder), folder=tmp_path).returncode == 0
    assert (folder / "metrics.parquet").read_bytes() == before
    assert python("-m", "cmacexp.verify", str(folder), folder=tmp_path).returncode == 0


@pytest.mark.parametrize("command", ["score", "verify", "replay"])
def test_commands_refuse_a_folder_without_a_run(command, tmp_path):
    done = python("-m", f"cmacexp.{command}", str(tmp_path), folder=tmp_path)
    assert done.returncode == 2
    assert "contains no run" in done.stderr


def test_interrupt_keeps_what_there_is(tmp_path):
    process = started("cycles=27000", "learning.lead=1", "record=trace", f"hydra.run.dir={tmp_path}", folder=ROOT)
    time.sleep(4.0)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate()
    assert process.returncode == 130
    assert err.splitlines()[-1] == "interrupted"
    assert "Traceback" not in err
    if (tmp_path / "manifest.json").exists():
        assert json.loads((tmp_path / "manifest.json").read_text())["status"] == "interrupted"
        assert python("-m", "cmacexp.verify", str(tmp_path), folder=tmp_path).returncode == 0
