"""Configs composed from Python are those of the command line; what they say reaches the machine and its reports."""

import random

import pytest
from hydra import compose, initialize_config_dir
from numpy.testing import assert_array_equal
from support.doors import BadInput, make_mechanism

from cmacexp.config import config_folder, to_config
from cmacexp.config.compose import compose_config, compose_untyped, set_plain_values

COMMANDS = [
    [],
    ["scenario=quadruped", "terrain=patchy", "posture.gain=0", "machine.legs.left_front.mass_1=0.6"],
    ["force_control=explicit", "terrain.assumed_stiffness=10", "scenario=force_step", "actuator.torque_limit=5.5"],
    ["gait.touch_down=[0.0,0.5,0.8,0.3]", "scenario=quadruped", "record.cycles=[1,2]"],
    ["~posture.gain", "+posture.gain=3"],
    ["cycles=2", "seed=5", "learning.rate=5e-1", "cycles=3", "scenario=one_leg", "cycles=2"],
    ["machine.leg.length_1=0.41", "scenario=quadruped", "machine.hip_height=0.5"],
    ["actuator.torque_limit=3", "terrain.step_time=1.5", "terrain.slope=-0.01"],
    ["learning.rate=auto", "++learning.rate=0.5", "cmac.inputs=[phase]", "cmac.layers=8", "warn=false", "seed=4"],
    ["feedforward._target_=cmacexp.feedforward.NoFeedforward", "learning.guard=none", "gait.stroke=0.2", "cycles=2"],
    ["cmac={layers:8}", "learning.rate=0.2", "learning={rate:0.3}", "cmac.layers=16", "terrain={slope:0.01}"],
    ["cmac.inputs=[angle, velocity]", "gait.vertical=two_cubics", "plant.gravity_factors=[0,-1,-1.5,1]", "seed=1"],
    [
        "gait.touch_down=null",
        "controller.lead_reset=true",
        "cmac.weight_type=int8",
        "scenario=quadruped",
        "warn=false",
    ],
    ["seed=3", "learning.guard=none", "seed=4", "sensors=encoders", "sensors.velocity.delay=1", "cycles=2"],
]
TYPED = [
    "scenario=one_leg",
    "scenario=quadruped",
    "terrain=patchy",
    "feedforward=none",
    "sensors=encoders",
    "cmac=phase",
    "record=metrics",
    "learning.rate=0.1",
    "learning.rate=auto",
    "++learning.rate=0.2",
    "learning={rate:0.3}",
    "learning={rate:0.05,guard:none}",
    "learning.guard=freeze",
    "cmac.layers=8",
    "cmac={layers:16}",
    "cmac.inputs=[phase]",
    "seed=4",
    "++seed=5",
    "seed=${cycles}",
    "cycles=3",
    "terrain.slope=0.01",
    "terrain={slope:0.02}",
    "posture.gain=0",
    "warn=false",
    "actuator.delay=1",
    "actuator={delay:2,lag:0.01}",
    "machine.hip_height=0.45",
    "record.trace=true",
    "cmac.inputs=[angle,velocity]",
    "gait.vertical=two_cubics",
    "record.cycles=[1,2]",
    "record.cycles=null",
]
"""Overrides that go together, in any order."""
CHANCE = random.Random(1)
DRAWN = [pytest.param(CHANCE.choices(TYPED, k=6), marks=pytest.mark.nightly, id=f"drawn {n}") for n in range(300)]


@pytest.mark.parametrize("overrides", [*COMMANDS, *DRAWN])
def test_a_config_is_that_of_hydra_whatever_was_composed_before(overrides):
    compose_config(["scenario=quadruped", "cycles=77", "cmac.inputs=[angle]"])
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        expected = to_config(compose("config", overrides))
    assert compose_config(overrides) == expected


def test_a_flag_of_a_job_as_hydra_writes_it_is_set_without_hydra():
    assert set_plain_values(compose_config([]), ["warn=False"]) == compose_config(["warn=false"])


def test_the_file_of_a_scenario_that_lacks_its_first_line_is_refused_with_that_line(tmp_path):
    (tmp_path / "scenario").mkdir()
    (tmp_path / "scenario" / "mine.yaml").write_text("cycles: 3\n")
    composed, _ = compose_untyped(["scenario=mine"], tmp_path)
    with pytest.raises(BadInput, match=r"'# @package _global_'$"):
        to_config(composed)


def test_what_is_set_for_all_legs_goes_to_all_of_them_but_those_with_their_own(make_config):
    own = ["length_1=0.3", "length_2=0.4", "hip_x=0.25", "hip_y=-0.2", "knee=back", "mass_2=0.4"]
    own = [f"machine.legs.right_front.{value}" for value in own]
    mechanism = make_mechanism(make_config("scenario=quadruped", "machine.leg.mass_1=0.6", *own).machine)
    assert_array_equal(mechanism.legs[1, :5], [0.3, 0.4, 0.6, 0.4, -1.0])
    assert_array_equal(mechanism.hips[1], [0.25, -0.2])
    assert_array_equal(mechanism.legs[[0, 2, 3], 2:5], [[0.6, 0.5, 1.0], [0.6, 0.5, -1.0], [0.6, 0.5, -1.0]])
