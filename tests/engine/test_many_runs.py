"""Many runs: metrics alone, chunks, runs in memory, studies in tasks of a launcher."""

import json

import numpy as np
import pandas as pd
import pytest
from omegaconf import OmegaConf
from support.command import cmacexp, python

from cmacexp import load_sweep, run, run_many
from cmacexp.config.compose import compose_untyped, parse_override, set_values
from cmacexp.errors import BadInput, WithoutEffect
from cmacexp.experiment.launch import set_value

JOBS = ["seed=1,2", "cycles=1", "warn=false"]


@pytest.mark.parametrize("given", [["-m", "sweep.chunk=2"], ["-m", "sweep.chunk=0"]])
def test_options_of_sweeps_that_make_no_sense_are_refused(given, tmp_path):
    done = cmacexp(*given, "cycles=1", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {given[-1].partition('=')[0]}=")


@pytest.mark.parametrize("override", ["cmac.layers=8", "record.cycles=[1,2]", "gait={lift: 0.2}", "cmac.inputs.0=x"])
def test_values_of_a_job_are_set_as_omegaconf_sets_them(override):
    composed, _ = compose_untyped([])
    plain, parsed = OmegaConf.to_container(composed), parse_override(override)
    set_values(composed, [override])
    set_value(plain, parsed.key_or_group.split("."), parsed.value())
    assert plain == OmegaConf.to_container(composed)


@pytest.fixture(scope="module")
def lean(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lean")
    done = cmacexp("-m", *JOBS, "record=metrics", "hydra.sweep.dir=s", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder / "s"


def test_a_job_with_metrics_alone_has_two_files_and_the_metrics_of_any_other(lean, tmp_path):
    assert {path.name for path in (lean / "0").iterdir()} == {"manifest.json", "metrics.parquet"}
    full = run(["seed=1", "cycles=1", "record=trace", "warn=false"], tmp_path / "full")
    one = load_sweep(lean).query("run == 0")
    pd.testing.assert_frame_equal(one[full.metrics.columns].reset_index(drop=True), full.metrics)


@pytest.mark.parametrize("command", ["report", "score", "replay --no-viewer"])
def test_what_needs_a_trace_says_that_there_is_none(lean, command):
    done = python("-m", *f"cmacexp.{command}".split(), str(lean / "0"), folder=lean)
    assert done.returncode == 2
    assert "keeps metrics alone (record.trace=false); run it again with record=trace" in done.stderr


def test_metrics_alone_are_whole_and_finished_unless_traces_are_asked_for(lean):
    for command in ("verify", "report", "stability"):
        assert python("-m", f"cmacexp.{command}", str(lean), folder=lean.parent).returncode == 0, command
    resume = ["-m", *JOBS, "hydra.sweep.dir=s", "sweep.resume=true"]
    again = cmacexp(*resume, "record=metrics", folder=lean.parent)
    assert again.stdout.count("finished before") == 2
    more = cmacexp(*resume, "record=trace", folder=lean.parent)
    assert more.stdout.count("finished before") == 0
    fewer = cmacexp(*resume, "record=metrics", folder=lean.parent)
    assert fewer.stdout.count("finished before") == 2, "a run with traces has metrics too"


def test_a_recording_needs_traces(tmp_path):
    done = cmacexp("record=metrics", "record.recording=true", folder=tmp_path)
    assert "record.recording=True: must be false with record.trace=false" in done.stderr


def test_runs_in_memory_are_those_on_disk(lean, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    overrides = [["seed=1", *JOBS[1:]], ["seed=2", *JOBS[1:]]]
    many, stored = run_many(overrides, processes=2), load_sweep(lean)
    metrics = many.columns.difference(["run", "warn", "record"])
    pd.testing.assert_frame_equal(many[metrics], stored[metrics])
    trace = run_many(overrides[:1], "trace", processes=1)
    assert np.array_equal(trace["q1"], run(overrides[0], tmp_path / "full").trace["q1"])
    assert list(tmp_path.iterdir()) == [tmp_path / "full"]


def test_a_script_without_a_guard_can_run_many(tmp_path):
    (tmp_path / "script.py").write_text("import cmacexp\nprint(len(cmacexp.run_many([['cycles=1']] * 2)))\n")
    done = python("script.py", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, "2\n"), done.stderr


@pytest.mark.parametrize("runs", [[], ["cycles=1"], [["cycles=0"]]])
def test_runs_that_cannot_be_are_refused(runs):
    with pytest.raises(BadInput):
        run_many(runs)


STUDY = """
from cmacexp.study import Study, grid
RUNS = grid("cycles=1", "feedforward=none", over={"seed": [1, 2, 3]})
STUDY = Study(title="Few", question="Does it run?", runs=lambda quick: RUNS)
"""


def test_a_study_runs_in_tasks_of_a_launcher(tmp_path):
    (tmp_path / "few.py").write_text(STUDY)
    (tmp_path / "few.md").write_text("Nothing to say.\n")
    command = ["-m", "cmacexp.study", "few.py", "--folder", "st", "--launcher", "submitit_local", "--workers", "2"]
    done = python(*command, "--setting", "timeout_min=5", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "3 runs, 3 of them to be run" in done.stderr
    assert "note: seed changes nothing here, one is enough: runs one_leg-" in done.stderr
    manifests = [json.loads(path.read_text()) for path in (tmp_path / "st" / "runs").glob("*/manifest.json")]
    assert [manifest["status"] for manifest in manifests] == ["completed"] * 3
    assert len(list((tmp_path / "st" / "tasks" / ".submitit").iterdir())) >= 2
    wrong = python(*command[:4], "other", *command[5:-3], "nosuch", folder=tmp_path)
    assert (wrong.returncode, wrong.stderr[:24]) == (2, "error: hydra/launcher=no")


def test_a_key_without_effect_is_warned_of_a_seed_noted(capsys):
    runs = [["feedforward=none", f"cmac.layers={n}", f"seed={s}", "cycles=1"] for n in (8, 16) for s in (0, 1)]
    with pytest.warns(WithoutEffect) as caught:
        run_many(runs)
    texts = [str(warning.message) for warning in caught]
    assert texts == ["cmac.layers had no effect: runs 0, 2 gave equal results; the same in 1 more group of runs"]
    assert caught[0].filename == __file__
    note = "note: seed changes nothing here, one is enough: runs 0, 1 gave equal results; the same in 1 more group"
    assert note in capsys.readouterr().err
