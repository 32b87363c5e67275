"""A machine in MuJoCo on the project's ground: the common code of one leg and four legs."""

from collections.abc import Callable
from typing import Any

import numpy as np

from cmacexp.errors import BadInput, Diverged
from cmacexp.models.ground import stiffness_under
from cmacexp.models.mechanism import LEGS_UNDER_BODY, Mechanism
from cmacexp.models.robot import load_mujoco, warnings_dropped
from cmacexp.planning.setup import Setup
from cmacexp.plants.kernels import Payload
from cmacexp.plants.mujoco_kernels import Bodies, Touch, pressing, sticking
from cmacexp.plants.mujoco_model import Torso, describe
from cmacexp.typing import Array

WARNINGS = {
    "mjWARN_BADQPOS": "the position of {} is not finite or huge",
    "mjWARN_BADQVEL": "the velocity of {} is not finite or huge",
    "mjWARN_BADQACC": "the acceleration of {} is not finite or huge",
    "mjWARN_INERTIA": "the inertia at {} is nearly singular",
}
"""Causes of divergence, by MuJoCo's names of its warnings; any other is reported by its name."""


def explain_warning(mujoco: Any, data: Any, name_joint: Callable[[int], str]) -> str:
    """The first of MuJoCo's warnings, in one line.

    Args:
        mujoco: the module.
        data: with a warning.
        name_joint: names the joint to which one of its velocities belongs.
    """
    kind = int(np.flatnonzero(data.warning.number)[0])
    name, velocity = mujoco.mjtWarning(kind).name, int(data.warning.lastinfo[kind])
    if name == "mjWARN_BADQPOS":  # a body that floats has a position, of its quaternion, more than velocities
        velocity = max(0, velocity - (len(data.qpos) - len(data.qvel)))
    cause = f"that {WARNINGS[name].format(name_joint(velocity))}" if name in WARNINGS else name
    return f"MuJoCo reports {cause}"


class MujocoEngine:
    """A model in MuJoCo that moves under joint torques and the project's contact forces.

    MuJoCo's classical Runge-Kutta method evaluates the contact forces in every stage, as the project's own does: held
    over a step they would excite oscillations of the ground.

    Args:
        mechanism: legs on a stand, or under a body that floats.
        touch: contact of a foot with the ground.
        step: time of one integration step, s.
        torso: the body, if it floats.
        payload: load on the body, with weight but without inertia.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        touch: Touch,
        step: float,
        torso: Torso | None = None,
        payload: Payload | None = None,
    ):
        self.payload, self.clock = payload, 0
        self.mujoco = load_mujoco()
        with warnings_dropped(self.mujoco):
            self.model = self.mujoco.MjModel.from_xml_string(describe(mechanism, step, torso))
        self.data = data = self.mujoco.MjData(self.model)
        self.touch, self.floats = touch, int(torso is not None)
        self.legs = legs = mechanism.legs.shape[0]
        # A view: how often MuJoCo has given each of its warnings.
        self.warned = data.warning.number
        self.bodies = Bodies(data.xipos, data.cvel, data.subtree_com, data.xfrc_applied, data.ximat)
        # Views: MuJoCo uses what is written into them.
        self.q, self.dq, self.torque = (
            values[-2 * legs :].reshape(legs, 2) for values in (data.qpos, data.qvel, data.qfrc_applied)
        )
        self.stiffness, self.force = np.full(legs, touch.ground.stiffness), np.zeros(legs)
        self.anchor = np.zeros((legs, 2))
        self._pressing = pressing(touch, self.bodies, self.floats, self.stiffness, self.force, self.anchor)
        self._sticking = sticking(touch, self.bodies, self.floats, self.force, self.anchor)

    def start(self, q: Array) -> None:
        """Set the joint angles to ``q`` (L, 2), rad, at rest; every foot sticks where it is."""
        self.q[:] = q
        self._update_bodies()
        self.anchor[:] = self.bodies.place[1 + self.floats :][1::2, :2]
        self.update_stiffness()
        self._update_bodies()

    def update_stiffness(self) -> None:
        """Set the stiffness under each foot to that of its place and time."""
        ground = self.touch.ground
        if ground.patch_spread > 0.0 or self.clock >= ground.step_at:
            for i, (x, y, _) in enumerate(self.bodies.place[1 + self.floats :][1::2]):
                self.stiffness[i] = stiffness_under(ground, i, self.clock, x, y)
            self._press()

    def advance(self, torque: Array, steps: int) -> None:
        """Integrate ``steps`` steps, a sampling period in all, under the held ``torque`` (L, 2), N m.

        Raises:
            Diverged: MuJoCo warns of its state.
        """
        self.torque[:] = torque
        with warnings_dropped(self.mujoco):
            for step in range(steps):
                # Only during the step: MuJoCo calls it for every model of the process.
                self.mujoco.set_mjcb_passive(self._press)
                try:
                    self.mujoco.mj_step(self.model, self.data)
                finally:
                    self.mujoco.set_mjcb_passive(None)
                if self.warned.any():
                    raise Diverged(explain_warning(self.mujoco, self.data, self._name_joint))
                self.clock += step + 1 == steps
                self._update_bodies()
                if self.touch.friction > 0.0:
                    next(self._sticking)
                self.update_stiffness()

    def _name_joint(self, velocity: int) -> str:
        """The joint to which one of MuJoCo's velocities belongs; those of the legs are the last."""
        joint = velocity - (len(self.data.qvel) - 2 * self.legs)
        return "the body" if joint < 0 else f"joint {joint % 2 + 1} of leg {joint // 2 + 1}"

    def _press(self, model: Any = None, data: Any = None) -> None:
        next(self._pressing)
        if self.payload is not None and self.clock >= self.payload.start:
            (weight, x, y), turn, pull = self.payload.load, self.bodies.turn[1], self.bodies.pull[1]
            pull[2] = -weight
            pull[3], pull[4] = -weight * (turn[3] * x + turn[4] * y), weight * (turn[0] * x + turn[1] * y)

    def _update_bodies(self) -> None:
        """Update positions, velocities and contact forces; a step leaves those of its last stage."""
        mujoco, model, data = self.mujoco, self.model, self.data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        self._press()


def check_kind(setup: Setup, kind: int, option: str) -> None:
    """Check that a plant can move the machine.

    Raises:
        BadInput: the machine is of another kind.
    """
    if setup.mechanism.kind != kind:
        needed = "quadruped" if kind == LEGS_UNDER_BODY else "leg"
        scenario = "quadruped" if kind == LEGS_UNDER_BODY else "one_leg"
        allowed = f"must be {needed} with plant={option}: use scenario={scenario}"
        raise BadInput("machine.kind", setup.config.machine.kind, allowed)
