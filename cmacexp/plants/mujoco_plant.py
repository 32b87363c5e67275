"""Base of the plants in MuJoCo: one leg, four planar legs and robots."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config import number
from cmacexp.errors import Diverged, require
from cmacexp.models.mujoco_library import load_library
from cmacexp.models.robot import load_mujoco
from cmacexp.planning.plan import Setup
from cmacexp.plants.as_built import AsBuiltConfig, make_ground, make_payload
from cmacexp.plants.instruments import new_instruments
from cmacexp.plants.kernels import new_state
from cmacexp.plants.mujoco_kernels import (
    NO_PUSH,
    Bodies,
    Engine,
    Feet,
    Push,
    Stages,
    advancing,
    apply_forces,
    observe,
)
from cmacexp.plants.touch import Joints, Touch
from cmacexp.protocols import Measurement, copy_state
from cmacexp.typing import Array, Counts

WARNINGS = {
    "mjWARN_BADQPOS": "the position of {} is not finite or huge",
    "mjWARN_BADQVEL": "the velocity of {} is not finite or huge",
    "mjWARN_BADQACC": "the acceleration of {} is not finite or huge",
    "mjWARN_INERTIA": "the inertia at {} is nearly singular",
}
"""Causes of divergence, by MuJoCo's names of its warnings; any other is reported by its name."""


@dataclass
class MujocoConfig(AsBuiltConfig):
    """Integration of a machine in MuJoCo."""

    substeps: int = number("", at_least=1, at_most=10000)
    """Steps of MuJoCo per sampling period: Runge-Kutta, for a robot semi-implicit Euler."""


@dataclass
class FrictionConfig(MujocoConfig):
    """Integration, and friction of the feet."""

    friction: float = number("", above=0, at_most=10)
    """Coulomb friction coefficient of a foot: largest tangential over normal force."""
    friction_stiffness: float = number("N/m", above=0, at_most=1e7)
    """Stiffness of the spring that holds a sticking foot."""
    friction_damping: float = number("N s/m", at_least=0, at_most=1e5)
    """Damping parallel to the spring of a sticking foot."""

    def touch(self, setup: Setup) -> Touch:
        """Make the contact of a foot with the elastic ground of a run."""
        ground = make_ground(setup.config.terrain, setup.config.sampling_period)
        return Touch(ground, self.friction, self.friction_stiffness, self.friction_damping)


class Model(NamedTuple):
    """A model of MuJoCo, and the indices of the machine in its arrays."""

    model: Any
    """MjModel; the plant changes it."""
    trunk: int
    """Number of the body with the free joint; for legs on a stand 0, the world."""
    joint: Counts
    """(L, J) numbers of the joints."""
    foot: Counts
    """(L,) numbers of the geoms of the feet."""
    origin: Array
    """(3,): origin of the body frame in the frame of the trunk, m."""


class MujocoPlant:
    """A machine that moves under joint torques, the forces of the ground on its feet, and a payload on its trunk."""

    def __init__(self, config: MujocoConfig):
        self.config = config

    def begin(
        self,
        setup: Setup,
        machine: Model,
        touch: Touch,
        floor: Counts | None = None,
        moving: bool = False,
        push: Push = NO_PUSH,
        joints: Joints | None = None,
    ) -> Measurement:
        """Start with the trunk level and the feet sticking, with ``moving`` at the planned velocities, else at rest.

        Each foot sticks where it is at the start. Values of MuJoCo's sensors at ``floor`` (L,) are normal forces of
        its own contacts; None: ``touch`` acts. ``joints`` adds torques to those of the actuators; None: as in the
        model.
        """
        config = setup.config
        mechanism = setup.mechanism
        self.mujoco = mujoco = load_mujoco()
        model, trunk, joint, foot, origin = machine
        self.model = model
        self.data = data = mujoco.MjData(model)
        q, dq = (addresses[joint].astype(np.int64) for addresses in (model.jnt_qposadr, model.jnt_dofadr))
        model.opt.timestep = config.sampling_period / self.config.substeps
        trunk_rate = np.zeros(6)
        self._floats = int(trunk > 0)
        if trunk:
            free = model.body_jntadr[trunk]
            first = model.jnt_qposadr[free]
            first_rate = model.jnt_dofadr[free]
            data.qpos[first : first + 3] = np.array([0.0, 0.0, mechanism.hip_height]) - origin
            data.qpos[first + 3 : first + 7] = [1.0, 0.0, 0.0, 0.0]
            trunk_rate = data.qvel[first_rate : first_rate + 6]
        data.qpos[q] = setup.start
        if moving:
            trunk_rate[:2] = setup.plan.sway.velocity[0] + np.array([config.body_speed, 0.0])
            data.qvel[dq] = setup.plan.joints.velocity[0]
        mujoco.mj_step1(model, data)
        fixed_to = model.geom_bodyid[foot]
        point, body, root = (indices.astype(np.int64) for indices in (foot, fixed_to, model.body_rootid[fixed_to]))
        self.state = new_state(mechanism.shape[0], mechanism.axes)
        self.state.body[0] = mechanism.hip_height
        stages = None
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            stages = Stages(model.opt.timestep, np.zeros(model.nq), np.zeros(model.nv), *np.zeros((2, 4, model.nv)))
        load_library()
        self.engine = Engine(
            model=model._address,  # the bindings have no public name for it
            data=data._address,
            substeps=self.config.substeps,
            stages=stages,
            warned=data.warning.number,
            position=data.qpos,
            velocity=data.qvel,
            acceleration=data.qacc_smooth,
            torque=data.qfrc_applied,
            q=q,
            dq=dq,
            bodies=Bodies(
                *(data.geom_xpos, data.cvel, data.subtree_com, data.xipos, data.xfrc_applied),
                *(data.xpos[trunk], data.xmat[trunk], trunk_rate),
            ),
            feet=Feet(point, body, root, trunk),
            origin=origin,
            mechanism=mechanism,
            payload=make_payload(config.payload, config.sampling_period),
            push=push,
            touch=touch,
            anchor=data.geom_xpos[foot, :2].copy(),
            sensors=data.sensordata,
            floor=floor,
            travel=np.zeros(3) if trunk else None,
            joints=joints,
            instruments=new_instruments(*mechanism.shape, config.sampling_period)
            if mechanism.chains is not None
            else None,
        )
        self.signals = None if self.engine.instruments is None else self.engine.instruments.signals
        self._torque = np.zeros(mechanism.shape)
        self._advancing: Iterator[int] | None = None
        apply_forces(floor, self.engine, self.state, False)
        return self.measure()

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (L, J), N m, over one sampling period; raise Diverged if MuJoCo warns of its state."""
        self._torque[...] = torque
        if self._advancing is None:
            self._advancing = advancing(self.engine, self.state, self._torque)
        next(self._advancing)
        if self.divergence:
            raise Diverged(self.divergence)
        return copy_state(self.state, self.engine.travel, self.signals)

    def hold(self) -> Array:
        """Store this step as the one to which :meth:`put` returns; return its state (n,).

        It contains positions, m and rad, velocities, m/s and rad/s, and where feet stick, m; under a floating trunk
        all are relative to its position.
        """
        kind = self.mujoco.mjtState.mjSTATE_INTEGRATION
        whole = np.empty(self.mujoco.mj_stateSize(self.model, kind))
        self.mujoco.mj_getState(self.model, self.data, whole, kind)
        self._held = whole, self.state.force.copy(), self.state.clock.copy(), self.engine.anchor.copy()
        return self.pack_state()

    def pack_state(self) -> Array:
        """Return the current state (n,), in units of MuJoCo: m, rad, m/s, rad/s; see :meth:`hold`."""
        trunk_position = self.data.qpos[: 2 * self._floats]
        anchor = self.engine.anchor - (trunk_position if self._floats else 0.0)
        return np.concatenate([self.data.qpos[2 * self._floats :], self.data.qvel, anchor.ravel()])

    def put(self, state: Array | None = None) -> Measurement:
        """Return to the step of :meth:`hold`, with ``state`` (n,); None: with the stored state, to the last bit.

        Its units are those of :meth:`pack_state`, m, rad, m/s and rad/s.
        """
        data = self.data
        anchor = self.engine.anchor
        whole, self.state.force[...], self.state.clock[...], anchor[...] = self._held
        self.mujoco.mj_setState(self.model, data, whole, self.mujoco.mjtState.mjSTATE_INTEGRATION)
        self.engine.warned[...] = 0
        if state is not None:
            positions = len(data.qpos) - 2 * self._floats
            data.qpos[2 * self._floats :] = state[:positions]
            data.qvel[:] = state[positions : positions + len(data.qvel)]
            anchor[...] = state[positions + len(data.qvel) :].reshape(anchor.shape)
            anchor += data.qpos[:2] if self._floats else 0.0
        self.mujoco.mj_step1(self.model, data)
        apply_forces(self.engine.floor, self.engine, self.state, False)
        return self.measure()

    def measure(self) -> Measurement:
        """Measure the current state of MuJoCo as if the machine kept its velocity."""
        for _ in range(2):  # an acceleration is the difference of two velocities
            observe(self.engine, self.state, np.zeros(self.state.q.shape))
        return copy_state(self.state, self.engine.travel, self.signals)

    @property
    def divergence(self) -> str:
        """First of MuJoCo's warnings, in one line, with the joint that it concerns; empty without a warning.

        A singular inertia, number 0, follows from any other: it is reported only if it is the only one.
        """
        if not self.engine.warned.any():
            return ""
        warning = int(min(np.flatnonzero(self.engine.warned), key=lambda number: number == 0))
        name = self.mujoco.mjtWarning(warning).name
        velocity = int(self.data.warning.lastinfo[warning])
        if name == "mjWARN_BADQPOS":  # a body that floats has a position, of its quaternion, more than velocities
            velocity = max(0, velocity - (self.model.nq - self.model.nv))
        joint = self.model.joint(int(self.model.dof_jntid[velocity])).name or "the trunk"
        return f"MuJoCo reports {f'that {WARNINGS[name].format(joint)}' if name in WARNINGS else name}"


def require_machine(setup: Setup, kind: str, option: str, scenario: str) -> None:
    """Check that a plant can move the machine; raise BadInput otherwise."""
    actual = setup.config.machine.kind
    require(actual == kind, "machine.kind", actual, f"must be {kind} with plant={option}: use scenario={scenario}")
