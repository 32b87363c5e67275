"""Which runs are taken for finished, and so are not run again; and reports that know what they rest on."""

import os

import pytest
from support.command import python
from support.manifests import change_manifest
from support.robots import change

from cmacexp.config.compose import compose_config
from cmacexp.data import manifest as manifests
from cmacexp.data.integrity import faults, is_finished
from cmacexp.experiment.collect import collect
from cmacexp.experiment.run import run_scenario
from cmacexp.experiment.workers import workers
from cmacexp.report.page import Report, write_report
from cmacexp.study import Request

JOB = ["scenario=force_step", "gait.cycle_time=1.0", "record=trace"]


@pytest.fixture
def finished(tmp_path):
    config = compose_config(JOB)
    run_scenario(config, tmp_path / "run")
    return tmp_path / "run", config


def test_a_whole_run_of_the_same_config_is_finished(finished):
    folder, config = finished
    assert is_finished(folder, config)
    assert is_finished(folder, compose_config([*JOB, "record=full"])), "what is recorded changes no result"


def test_a_run_of_another_config_is_not(finished):
    folder, _ = finished
    assert not is_finished(folder, compose_config([*JOB, "machine.mass=0.6"]))


@pytest.mark.parametrize(
    "change", [{"status": "failed"}, {"status": "interrupted"}, {"code_hash": "0" * 16}, {"files": {"no": "such"}}]
)
def test_a_run_that_broke_off_or_that_other_code_made_is_not(finished, change):
    folder, config = finished
    change_manifest(folder, **change)
    assert not is_finished(folder, config)


def test_a_run_of_a_custom_component_whose_data_changed_is_not(tmp_path, monkeypatch):
    """Files that its class lists, and those that its fields name, count as its code does."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "with_data.py").write_text("""
from support.fields import Mine
class Own(Mine):
    reads = ("own.csv",)
    def __init__(self, table): self.table = open(table).read()
""")
    listed, named = tmp_path / "own.csv", tmp_path / "named.csv"
    listed.write_text("1")
    named.write_text("1")
    config = compose_config([*JOB, "feedforward._target_=with_data.Own", "+feedforward.table=named.csv"])
    run_scenario(config, tmp_path / "run")
    for file in (listed, named):
        assert is_finished(tmp_path / "run", config)
        file.write_text("2")
        assert not is_finished(tmp_path / "run", config)
        file.write_text("1")


def test_a_run_of_a_robot_whose_model_changed_is_not(tmp_path):
    model = change(tmp_path, 'mass="6"', 'mass="6.0"')
    walk = ["scenario=robot", "machine=mjcf", f"machine.path={model}", "cycles=1", "gait.cycle_time=0.4"]
    steps = ["gait.load_ramp=0", "gait.unload_ramp=0", "gait.stroke=0.01", "gait.lift=0.01", "feedforward=none"]
    config = compose_config([*walk, *steps, "record=trace"])
    run_scenario(config, tmp_path / "run")
    model.write_text(model.read_text().replace('mass="6.0"', 'mass="6"'))
    assert is_finished(tmp_path / "run", config), "a number in other words is the same model"
    model.write_text(model.read_text().replace('mass="6"', 'mass="6.1"'))
    os.utime(model, ns=(1, 1))  # files are read anew when their time changes, which may be coarse
    assert not is_finished(tmp_path / "run", config)


@pytest.mark.parametrize("status", ["fell", "diverged"])
def test_a_run_that_fell_or_diverged_has_a_result(finished, status):
    folder, config = finished
    change_manifest(folder, status=status)
    assert is_finished(folder, config)


def test_runs_are_reused_and_equal_ones_run_once(tmp_path, capfd):
    one, same, other = (
        Request((*JOB,), {"name": "a"}),
        Request((*JOB,), {"name": "b"}),
        Request((*JOB, "machine.mass=0.7")),
    )
    with workers() as each:
        first = collect(each, [one, same, other], tmp_path)
    assert "2 runs, 2 of them to be run" in capfd.readouterr().err
    assert first[one] == first[same] != first[other]
    times = {folder: (folder / "trace.parquet").stat().st_mtime_ns for folder, _ in first.values()}
    with workers() as each:
        again = collect(each, [one, other], tmp_path)
    assert "2 runs, 0 of them to be run" in capfd.readouterr().err
    assert {folder: (folder / "trace.parquet").stat().st_mtime_ns for folder, _ in again.values()} == times


def test_a_report_notices_a_config_that_was_changed_by_hand(finished, tmp_path):
    run = finished[0]
    report = Report("T", "S", [], [], runs={run: manifests.read(run)["config_hash"]})
    folder = write_report(report, tmp_path / "report", "key").parent
    assert not faults(folder)
    config = manifests.read(run)["config"]
    change_manifest(run, config={**config, "seed": 1})
    assert faults(folder) == ["../run: its config is not the one of the report"]


def test_a_run_of_own_code_is_not_once_that_code_has_changed(tmp_path):
    job = [*JOB, "feedforward._target_=mine.Mine", "record=metrics"]
    base = "from cmacexp.feedforward import NoFeedforward"
    (tmp_path / "mine.py").write_text(f"import helper, json\n{base}\nclass Mine(NoFeedforward): pass\n")
    (tmp_path / "helper.py").write_text("GAIN = 1.0\n")
    (tmp_path / "unused.py").write_text("GAIN = 1.0\n")
    assert python("-m", "cmacexp", *job, "hydra.run.dir=run", folder=tmp_path).returncode == 0

    def finished():
        imports = "from pathlib import Path; from cmacexp.config.compose import compose_config; "
        imports += "from cmacexp.data.integrity import is_finished; "
        ask = f"print(is_finished(Path('run'), compose_config({job})))"
        return python("-c", imports + ask, folder=tmp_path).stdout.strip()

    assert finished() == "True"
    (tmp_path / "unused.py").write_text("GAIN = 2.0\n")
    assert finished() == "True"
    (tmp_path / "helper.py").write_text("GAIN = 2.0\n")
    assert finished() == "False"
