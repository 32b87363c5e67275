"""The command line: what a run leaves behind, exit codes, help, and how it is ended."""

import json
import re
import shutil
import signal
import sys

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from support.command import call, cmacexp, interrupted, started

import cmacexp as package
from cmacexp.__main__ import COMMANDS, main
from cmacexp.config import config_folder
from cmacexp.entry_points import list_commands

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
KEPT = {"seed", "config", "config_hash", "versions", "git_commit", "rollout_seconds", "wall_seconds"}


def test_a_run_has_the_files_and_columns_of_the_contract(leg):
    schema = pq.read_schema(leg.folder / "trace.parquet")
    assert schema.names == TRACE
    assert all(field.metadata[b"meaning"] for field in schema)
    assert schema.field("tau_feedback_1").metadata[b"unit"] == b"N m"
    assert leg.trace.cycle.tolist() == np.repeat([1, 2, 3], 600).tolist()
    assert (leg.trace.phase == np.tile(np.repeat(["transfer", "support"], [120, 480]), 3)).all()
    assert set(leg.metrics.columns) >= METRICS
    pd.testing.assert_frame_equal(leg.metrics, pd.read_csv(leg.folder / "metrics.csv"), check_dtype=False)
    manifest = json.loads((leg.folder / "manifest.json").read_text())
    assert (manifest["status"], manifest["steps"]) == ("completed", 1800)
    files = {"trace.parquet", "memory.parquet", "metrics.parquet", "weights.npz"}
    assert set(manifest["files"]) == files
    assert set(manifest) >= KEPT


@pytest.mark.parametrize("name", ["leg", "walk"])
def test_score_gives_the_same_metrics_again(name, request, tmp_path):
    folder = shutil.copytree(request.getfixturevalue(name).folder, tmp_path / "copy")
    before = {path: path.read_bytes() for path in folder.glob("*metrics.parquet")}
    for path in before:
        path.unlink()
    assert call("verify", folder).returncode == 4
    assert call("score", folder).returncode == 0
    assert {path: path.read_bytes() for path in folder.glob("*metrics.parquet")} == before
    assert call("verify", folder).returncode == 0


FALL = pytest.param("posture.gain=0 scenario=quadruped", marks=pytest.mark.ci)


@pytest.mark.parametrize(
    "words", ["controller.velocity_gain=80", "hydra.job.chdir=true controller.velocity_gain=80", FALL]
)
def test_a_run_that_diverges_or_falls_is_a_result_with_an_exit_code_of_its_own(words, tmp_path):
    done = call("main", *words.split(), "cycles=1", "record=trace", "hydra.run.dir=r", folder=tmp_path)
    assert done.returncode == 3
    assert " at step " in done.stdout
    assert "\nreport:    cmacexp report r\n" in done.stdout
    assert done.stdout.splitlines()[-1] == str(tmp_path / "r")
    assert package.load(tmp_path / "r").status in ("diverged", "fell")


@pytest.mark.ci
def test_help_fits_a_screen_and_lists_every_option_of_a_group_that_it_names():
    lines = call("main", "--help").stdout.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    for group in ("scenario", "force_control", "feedforward"):
        (listed,) = re.findall(rf"^  {group}=((?:.*\|\n)*.*)$", "\n".join(lines), re.MULTILINE)
        assert set(re.findall(r"\w+", listed)) == {path.stem for path in (config_folder() / group).glob("*.yaml")}


@pytest.mark.ci
def test_a_run_that_is_ended_keeps_what_there_is(tmp_path):
    def begun():
        return list(tmp_path.glob(".r.*.part/*/*.parquet"))

    words = ("cycles=1000000", "feedforward=none", "record.cycles=[1]", "hydra.run.dir=r")
    done = interrupted(*words, folder=tmp_path, once=begun, number=signal.SIGTERM)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (143, "interrupted")
    assert package.load(tmp_path / "r").status == "interrupted"
    assert call("verify", tmp_path / "r").returncode == 0


@pytest.mark.ci
def test_ctrl_c_while_a_command_is_imported_ends_it_without_a_word(tmp_path):
    (tmp_path / "hydra.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    process = started("cycles=1", folder=tmp_path)
    assert (process.communicate()[1], process.returncode) == ("", -signal.SIGINT)


@pytest.mark.ci
def test_a_command_is_called_by_its_name_and_its_words_follow(tmp_path):
    for words in (["run", "scenario=force_step", "cycles=1", "hydra.run.dir=a"], ["score", "a"], ["verify", "a"]):
        done = cmacexp(*words, folder=tmp_path)
        assert done.returncode == 0, done.stderr
    assert "did you mean report?" in cmacexp("reprot", "a", folder=tmp_path).stderr


def test_help_lists_the_commands_and_the_package_its_names(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["cmacexp", "--help"])
    assert main() == 0
    assert set(re.findall(r"^  (\w+) ", capsys.readouterr().out, re.MULTILINE)) == {*COMMANDS, *list_commands()}
    assert {"Run", "BadInput", "Plant", "gym", "run_many"} <= set(dir(package))
    assert issubclass(package.BadInput, ValueError)
    for name in package.__all__:
        assert getattr(package, name)


@pytest.mark.ci
def test_warm_compiles_what_it_names(tmp_path):
    assert re.fullmatch(r"one_leg: ready after [\d.]+ s\n", call("warm", "one_leg", folder=tmp_path).stdout)
