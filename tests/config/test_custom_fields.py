"""The fields that a component takes: of the replaced option, or typed by a config class."""

import pytest

from cmacexp.config.component import find_new_name
from cmacexp.config.compose import compose_config
from cmacexp.errors import BadInput

COMPONENTS = """
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


class Wrong(Typed):
    @dataclass
    class Config(ComponentConfig):
        gain: float = number("N m/rad", above=0, default=-5.0)


class Heir(HybridController):
    Config = None

    def __init__(self, stiffness=1.0, **gains):
        super().__init__(HybridController.Config(**gains))
        self.stiffness = stiffness
"""


def test_fields_of_the_replaced_option_and_of_the_scenario_are_dropped(here, tmp_path):
    (tmp_path / "controller").mkdir()
    (tmp_path / "controller" / "mine.yaml").write_text(f"_target_: {here}.Still\ngain: 2\n")
    config = compose_config(["scenario=quadruped", "controller=mine"], tmp_path)  # it sets gains of any controller
    assert config.controller == {"_target_": f"{here}.Still", "gain": 2}
    left = compose_config(["plant=mujoco_quadruped", "scenario=quadruped", f"plant._target_={here}.Still"])
    assert left.plant == {"_target_": f"{here}.Still"}


def test_a_class_with_a_config_gets_typed_and_checked_fields(here):
    typed = f"controller._target_={here}.Typed"
    config = compose_config([typed, "+controller.gain=3"])
    assert (config.controller.gain, type(config.controller.gain)) == (3.0, float)
    assert compose_config([f"controller._target_={here}.Same"]).controller.gain == 2.0
    for wrong, reason in {
        "gain=-1": "controller.gain=-1.0: must be above 0 (N m/rad)",
        "gain=much": "controller.gain=much: must be a number",
        "legs=[0]": "controller.legs=0: must be at least 1 (leg)",
        "gian=1": "takes gain, legs; did you mean gain?",
    }.items():
        with pytest.raises(BadInput) as caught:
            compose_config([typed, f"+controller.{wrong}"])
        assert reason in str(caught.value)
    with pytest.raises(BadInput, match=r"controller\.gain=-5\.0: must be above 0"):
        compose_config([f"controller._target_={here}.Wrong"])
    with pytest.raises(ValueError, match="no such leg"):
        compose_config([typed, "+controller.legs=[2]"])


def test_a_target_that_has_moved_keeps_working_and_its_new_name_is_printed_once(capsys):
    find_new_name.cache_clear()
    for _ in range(2):
        assert compose_config(["feedforward._target_=cmacexp.control.CmacFeedforward"]) == compose_config([])
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "cmacexp.control.CmacFeedforward is now cmacexp.feedforward.CmacFeedforward"
