"""Configs composed for studies are those that the command line composes."""

import pytest
from hydra import compose, initialize_config_dir

from cmacexp.config import config_folder, to_config
from cmacexp.config.compose import compose_config
from cmacexp.errors import CmacexpError

COMMANDS = [
    [],
    ["scenario=quadruped"],
    ["scenario=quadruped", "terrain=patchy", "posture.gain=0", "machine.legs.left_front.mass_1=0.6"],
    ["cmac.inputs=[angle]", "scenario=one_leg", "reference=aware", "record=trace"],
    ["learning.start_cycle=3", "feedforward=inverse_dynamics"],
    ["force_control=explicit", "terrain.assumed_stiffness=10", "scenario=force_step", "actuator.torque_limit=5.5"],
    ["gait.touch_down=[0.0,0.5,0.8,0.3]", "scenario=quadruped", "record.cycles=[1,2]"],
    ["~posture.gain", "+posture.gain=3"],
]


def by_hydra(overrides):
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        return to_config(compose("config", overrides))


@pytest.mark.parametrize("overrides", COMMANDS)
def test_the_same_as_hydra_composes(overrides):
    assert compose_config(overrides) == by_hydra(overrides)
    assert compose_config(overrides) == by_hydra(overrides), "and again, from what was kept"


def test_what_one_run_sets_no_other_has():
    compose_config(["cycles=77", "cmac.inputs=[angle]"])
    assert compose_config([]) == by_hydra([])


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["cmac.layerz=8"], "did you mean cmac.layers?"),
        (["scenario=two_legs"], "choose from force_step, one_leg, quadruped"),
        (["cmac.layers=0"], "cmac.layers=0: must be at least 1"),
        (["cmac.layers"], "write key=value"),
        (["cmac.layers=many"], "cmac.layers=many"),
    ],
)
def test_mistakes_are_told_as_on_the_command_line(overrides, message):
    with pytest.raises(CmacexpError) as caught:
        compose_config(overrides)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_hydra_raises_as_a_value_error_is_a_message_too():
    with pytest.raises(CmacexpError, match="a group takes the name of an option"):
        compose_config(["cmac=null"])
