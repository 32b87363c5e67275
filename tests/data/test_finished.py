"""Which runs are taken for finished, and so are not run again."""

import os
import shutil

import pytest
from support.command import ROOT, cmacexp, python
from support.doors import compose_config, run_scenario
from support.manifests import change_manifest
from support.robots import ROBOT, SHORT, change

from cmacexp.data.integrity import is_finished

JOB = ("scenario=force_step",)


@pytest.fixture
def run(stored, tmp_path):
    return shutil.copytree(stored(*JOB).folder, tmp_path / "run")


def test_a_run_is_finished_for_its_config_whatever_is_recorded_and_for_no_other(run):
    assert is_finished(run, compose_config(JOB))
    assert is_finished(run, compose_config([*JOB, "record=metrics"]))
    assert not is_finished(run, compose_config([*JOB, "record.weights=true"])), "it did not store them"
    assert not is_finished(run, compose_config([*JOB, "machine.mass=0.6"]))


@pytest.mark.parametrize(
    ("change", "finished"),
    [
        ({"status": "fell"}, True),
        ({"status": "diverged"}, True),
        ({"status": "failed"}, False),
        ({"status": "interrupted"}, False),
        ({"code_hash": "0" * 16}, False),
        ({"files": {"no": "0" * 64}}, False),
    ],
)
def test_a_run_is_finished_if_it_has_a_whole_result_of_this_code(run, change, finished):
    change_manifest(run, **change)
    assert is_finished(run, compose_config(JOB)) == finished


OWN_CODE = """
import helper
class Own:
    acts, reads = True, ("own.csv",)
    def __init__(self, table): self.table = open(table).read()
    def reset(self, setup): pass
    def predict(self, reference, learning_error): return 0.0 * learning_error
"""
OWN = (
    *JOB,
    "gait.cycle_time=0.5",
    "record=trace",
    "feedforward._target_=own_code.Own",
    "+feedforward.table=named.csv",
)


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder with a custom component, and data that its class lists, that its field names, and others."""
    monkeypatch.chdir(tmp_path)
    files = {
        "own_code.py": OWN_CODE,
        "helper.py": "",
        "unused.py": "",
        "own.csv": "1",
        "named.csv": "1",
        "other.csv": "1",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_run_of_a_custom_component_is_not_once_its_data_have_changed(own):
    config = compose_config(OWN)
    run_scenario(config, own / "run")
    for name in ("own.csv", "named.csv", "other.csv"):
        assert is_finished(own / "run", config)
        (own / name).write_text("2")
        assert is_finished(own / "run", config) == (name == "other.csv")
        (own / name).write_text("1")


ASK = """
from pathlib import Path
from support.doors import compose_config
from cmacexp.data.integrity import is_finished
print(is_finished(Path("run"), compose_config({job})))
"""


@pytest.mark.ci
def test_a_run_of_a_custom_component_is_not_once_its_code_has_changed(own):
    """A process has the code that it began with."""
    done = cmacexp(*OWN, "hydra.run.dir=run", folder=own)
    assert done.returncode == 0, done.stderr
    for name, finished in (("unused.py", "True"), ("helper.py", "False")):
        (own / name).write_text("GAIN = 2.0")
        ask = python("-c", ASK.format(job=OWN), folder=own, PYTHONPATH=f"{ROOT}:{ROOT / 'tests'}")
        assert ask.stdout.strip() == finished, ask.stderr


@pytest.mark.ci
def test_a_run_of_a_robot_is_not_once_its_model_has_changed_but_for_the_spelling(tmp_path):
    model = change(tmp_path, 'mass="6"', 'mass="6.0"')
    config = compose_config([*ROBOT, f"machine.path={model}", *SHORT, "feedforward=none", "record=trace"])
    run_scenario(config, tmp_path / "run")
    for mass, finished in (("6", True), ("6.1", False)):
        model.write_text(model.read_text().replace('mass="6.0"', f'mass="{mass}"'))
        os.utime(model, ns=(1, len(mass)))  # files are read anew when their time changes, which may be coarse
        assert is_finished(tmp_path / "run", config) == finished
        model.write_text(model.read_text().replace(f'mass="{mass}"', 'mass="6.0"'))
