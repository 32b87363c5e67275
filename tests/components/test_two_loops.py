"""Both loops give a walk the same bits, and plain Python those of compiled code."""

import os
import subprocess
import sys
from random import Random

import numpy as np
import pytest
from support.robot_walks import RIGID, ROBOT, SHORT
from support.robots import OWN

from cmacexp.loop import roll_out
from cmacexp.loop.compiled import fused_loop
from cmacexp.loop.external import coroutine_loop
from cmacexp.loop.scenario import make_scenario

QUADRUPED = "scenario=quadruped"
SPREAD = {
    "terrain": ["soft_flat", "patchy"],
    "feedforward": ["none", "cmac", "inverse_dynamics"],
    "reference": ["literal", "aware", "force_feedforward"],
    "machine.legs.right_rear.mass_1": [0.5, 0.8],
    "machine.legs.left_front.length_2": [0.35, 0.4],
    "gait.load_ramp": [0.0, 0.1],
    "gait.vertical": ["cubic", "two_cubics"],
    "posture.gain": [0.0, 8.0],
    "learning.lead": [0, 1],
    "plant.substeps": [1, 3],
    "actuator.torque_limit": ["null", 8.0],
    "actuator.lag": [0.0, 0.003],
}


def cases(count):
    """Draws of a value for each key; every value is taken equally often."""
    random = Random(1997)
    return list(zip(*(random.sample((values * count)[:count], count) for values in SPREAD.values()), strict=True))


def same_bits(one, other):
    return one.shape == other.shape and one.tobytes() == other.tobytes()


@pytest.mark.parametrize("case", cases(12), ids=lambda case: "-".join(map(str, case)))
def test_fused_loop_equals_stepped_loop_to_the_bit(make_config, case):
    overrides = [f"{key}={value}" for key, value in zip(SPREAD, case, strict=True)]
    config = make_config(
        "scenario=quadruped", *overrides, "cycles=2", "gait.cycle_time=1.5", "cmac.memory_bytes=65536"
    )
    fused, stepped = roll_out(make_scenario(config)), roll_out(make_scenario(config), fused=False)
    assert (fused.status, fused.cause) == (stepped.status, stepped.cause)
    assert same_bits(fused.samples, stepped.samples)
    assert same_bits(fused.body_samples, stepped.body_samples)


ELSEWHERE = """
import sys
import numpy as np
from hydra import compose, initialize_config_dir
from cmacexp.config import config_folder, to_config
from cmacexp.loop import roll_out
from cmacexp.loop.scenario import make_scenario

with initialize_config_dir(str(config_folder()), version_base="1.3"):
    rollout = roll_out(make_scenario(to_config(compose("config", sys.argv[2:]))))
np.savez(sys.argv[1], samples=rollout.samples, body=rollout.body_samples, cause=rollout.cause)
"""


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize(
    "overrides",
    [
        [QUADRUPED, "cycles=2", "gait.cycle_time=1.5", "learning.lead=1", "machine.legs.left_front.mass_1=0.6"],
        [QUADRUPED, "cycles=1", "terrain=patchy", "gait.load_ramp=0.1", "learning.start_cycle=1", "plant.substeps=2"],
        [QUADRUPED, "cycles=1", "posture.gain=0"],
        [QUADRUPED, "cycles=1", "plant=mujoco_quadruped", "plant.start_spread=0.01"],
        [*ROBOT, f"machine.path={OWN}", *SHORT, "payload.weight=5", "plant.substeps=2"],
        [*ROBOT, f"machine.path={OWN}", *SHORT, RIGID, "sensors=encoders", "actuator.delay=1"],
    ],
    ids=["learning", "patchy", "falling", "friction", "robot", "robot on a rigid floor"],
)
def test_plain_python_gives_the_bits_of_compiled_code(make_config, tmp_path, overrides):
    command = [sys.executable, "-c", ELSEWHERE, str(tmp_path / "plain.npz"), *overrides]
    subprocess.run(command, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, check=True)
    compiled = roll_out(make_scenario(make_config(*overrides)))
    with np.load(tmp_path / "plain.npz") as plain:
        assert same_bits(plain["samples"], compiled.samples)
        assert same_bits(plain["body"], compiled.body_samples)
        assert str(plain["cause"]) == compiled.cause


@pytest.mark.usefixtures("compiled")
def test_the_compiled_generator_gives_the_bits_of_the_fused_loop(make_config):
    config = make_config("cycles=2", "learning.lead=1", "cmac.memory_bytes=65536")
    fused, stepped = roll_out(make_scenario(config)), roll_out(make_scenario(config), fused=False)
    assert coroutine_loop.chosen == coroutine_loop.compiled
    assert fused_loop.chosen == fused_loop.compiled
    assert same_bits(fused.samples, stepped.samples)
