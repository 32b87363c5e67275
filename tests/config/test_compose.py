"""Configs composed for studies are those that the command line composes."""

import pytest
from hydra import compose, initialize_config_dir

from cmacexp.config import config_folder, to_config
from cmacexp.config.compose import compose_config

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
