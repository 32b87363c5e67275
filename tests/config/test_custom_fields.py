"""The fields that a component takes: of the replaced option, or typed by a config class."""

import pytest
from omegaconf import OmegaConf

from cmacexp.config import to_config, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.config.targets import find_new_name
from cmacexp.errors import BadInput

CLASSES = """
from dataclasses import dataclass
from cmacexp.config import ComponentConfig, number
from cmacexp.control import HybridController


class Still:
    def __init__(self, gain=1.0):
        self.gain = gain

    def reset(self, setup, feedforward):
        pass

    def act(self, reference, measurement):
        pass


class Typed(Still):
    @dataclass
    class Config(ComponentConfig):
        gain: float = number("N m/rad", above=0, default=2.0)
        legs: list[int] | None = number("leg", at_least=1, default=None)

        def check(self, config):
            if self.legs and max(self.legs) > config.legs:
                raise ValueError("no such leg")

    def __init__(self, config: Config):
        self.config = config


class Same(Typed):
    pass


class Heir(HybridController):
    Config = None

    def __init__(self, stiffness=1.0, **gains):
        super().__init__(HybridController.Config(**gains))
        self.stiffness = stiffness
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, with classes in it that no other test has imported."""
    monkeypatch.chdir(tmp_path)
    name = f"fields_{abs(hash(tmp_path))}"
    (tmp_path / f"{name}.py").write_text(CLASSES)
    return name


def compose(*overrides):
    return compose_config(overrides)


UNKNOWN = {
    "controller._target_={}.Still +controller.friction=1": "{}.Still takes gain",
    "plant=mujoco_leg plant._target_={}.Still +plant.gravity=1": "{}.Still takes gain",
    "+controller.gian=3": "cmacexp.control.HybridController takes position_gain, velocity_gain,",
}
"""Fields that no option of the group has."""


@pytest.mark.parametrize("overrides", UNKNOWN)
def test_a_field_that_no_one_takes_is_an_error_unless_an_option_has_it(here, overrides):
    with pytest.raises(BadInput) as caught:
        compose(*overrides.format(here).split())
    key = overrides.rpartition("+")[2].partition("=")[0]
    assert str(caught.value).startswith(f"{key}=")
    assert UNKNOWN[overrides].format(here) in str(caught.value)


def test_fields_of_the_replaced_option_and_of_the_scenario_are_dropped(here, tmp_path):
    (tmp_path / "controller").mkdir()
    (tmp_path / "controller" / "mine.yaml").write_text(f"_target_: {here}.Still\ngain: 2\n")
    for name in ("quadruped", "quadruped_lasting"):  # they set gains of whatever controller there is
        config = compose_config([f"scenario={name}", "controller=mine"], tmp_path)
        assert config.controller == {"_target_": f"{here}.Still", "gain": 2}
    left = compose("plant=mujoco_quadruped", "scenario=quadruped", f"plant._target_={here}.Still")
    assert left.plant == {"_target_": f"{here}.Still"}


def test_a_class_with_a_config_gets_typed_and_checked_fields(here):
    typed = f"controller._target_={here}.Typed"
    config = compose(typed, "+controller.gain=3")
    assert (config.controller.gain, type(config.controller.gain)) == (3.0, float)
    assert compose(f"controller._target_={here}.Same").controller.gain == 2.0
    for wrong, told in {
        "gain=-1": "controller.gain=-1.0: must be above 0 (N m/rad)",
        "gain=much": "controller.gain=much: must be a number",
        "legs=[0]": "controller.legs=0: must be at least 1 (leg)",
        "gian=1": "takes gain, legs; did you mean gain?",
    }.items():
        with pytest.raises(BadInput) as caught:
            compose(typed, f"+controller.{wrong}")
        assert told in str(caught.value)
    with pytest.raises(ValueError, match="no such leg"):
        compose(typed, "+controller.legs=[2]")


def test_a_class_with_another_constructor_than_its_base_says_that_it_has_no_config(here):
    heir = compose(f"controller._target_={here}.Heir", "+controller.stiffness=3").controller
    assert (heir["stiffness"], heir["position_gain"]) == (3, 100.0)


def test_a_target_that_has_moved_keeps_working_and_its_new_name_is_printed_once(capsys):
    find_new_name.cache_clear()
    for _ in range(2):
        assert compose("feedforward._target_=cmacexp.control.CmacFeedforward") == compose()
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "cmacexp.control.CmacFeedforward is now cmacexp.feedforward.CmacFeedforward"


def test_a_manifest_may_hold_fields_of_a_replaced_option(here):
    plain = to_plain(compose("feedforward=ilc"))
    plain["controller"]["_target_"] = f"{here}.Still"  # with the fields of the option that it replaced
    config = to_config(OmegaConf.create(plain))
    assert config.feedforward == compose("feedforward=ilc").feedforward
    assert config.controller == {"_target_": f"{here}.Still"}
