"""A robot in MuJoCo, from its own model, on the project's elastic ground or on MuJoCo's rigid one."""

import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.config import ComponentConfig, Config, choice, number
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.errors import BadInput, Diverged
from cmacexp.models.mechanism import GEOMETRY_FIELDS, SPACE
from cmacexp.models.robot import load_mujoco, warnings_dropped
from cmacexp.planning.robot import find_stance
from cmacexp.planning.setup import Setup
from cmacexp.plants.environment import make_ground, make_payload
from cmacexp.plants.mujoco_engine import explain_warning
from cmacexp.plants.mujoco_kernels import Measured, Touch
from cmacexp.plants.protocol import Measurement
from cmacexp.plants.robot_kernels import Contacts, Feet, RobotBodies, Room, observing_robot, pressing_robot
from cmacexp.typing import Array

ELASTIC, RIGID = "elastic", "mujoco"
FLOOR = "floor of cmacexp"
SOLREF = (0.01, 1.0)
"""Time constant (s) and damping ratio of MuJoCo's contacts."""
SOLIMP = (0.99, 0.99, 0.001, 0.5, 2.0)
"""Their impedance, whatever a model says: some have soft feet, and with MuJoCo's default, 0.9 to 0.95, feet sink as
deep as into the elastic ground."""


class MujocoRobot:
    """A robot under joint torques. Its feet touch the ground where their centres are at the height 0.

    On elastic ground a spring and a damper hold a foot at the point where it touched down, as long as their force
    stays within the limit of friction; beyond it the foot drags the point along.
    """

    @dataclass
    class Config(ComponentConfig):
        """Integration, ground, friction of the feet, and where the joints start."""

        substeps: int = number("", at_least=1, at_most=10000)
        """Steps of MuJoCo (semi-implicit Euler) per sampling period."""
        contact: str = choice(ELASTIC, RIGID)
        """elastic: the ground of the project, see ``terrain``; mujoco: MuJoCo's own contacts with a flat floor."""
        friction: float = number("", above=0, at_most=10)
        """Largest tangential over normal force of a foot (Coulomb)."""
        friction_stiffness: float = number("N/m", above=0, at_most=1e7, needs=("own.contact == 'elastic'",))
        """Stiffness of the spring that holds a sticking foot."""
        friction_damping: float = number("N s/m", at_least=0, at_most=1e5, needs=("own.contact == 'elastic'",))
        """Damping beside that spring."""
        start_spread: float = number("rad", at_least=0, at_most=0.5)
        """Largest difference of the joint angles at the start from the planned ones."""
        start_seed: int = number("", at_least=0, below=2**32, needs=("own.start_spread > 0",))
        """Seed of the joint angles at the start."""

        def check(self, config: Config) -> None:
            """Check that MuJoCo's floor is asked for nothing but to be flat and rigid."""
            terrain = config.terrain
            changed = {"slope": terrain.slope, "patch_spread": terrain.patch_spread, "step_time": terrain.step_time}
            for key, value in changed.items() if self.contact == RIGID else ():
                if value:
                    reason = f"has no effect with plant.contact={RIGID}, a flat rigid floor; use plant=mujoco_robot"
                    raise BadInput(f"terrain.{key}", value, reason)

    def __init__(self, config: Config):
        self.config = config
        self.grip = (config.friction, config.friction_stiffness, config.friction_damping)
        self._wrench = np.zeros(6)

    def reset(self, setup: Setup) -> Measurement:
        """Start near the planned joint angles, at rest, the body level at its planned height.

        Raises:
            BadInput: the machine is no robot, or its model cannot be used.
        """
        machine = setup.config.machine
        if not isinstance(machine, RobotMachine):
            raise BadInput("machine.kind", machine.kind, "must be robot with plant=mujoco_robot: use scenario=robot")
        self.robot, self.mujoco = read_model(machine), load_mujoco()
        self.origin = find_stance(self.robot, machine.hip_height).origin
        self.model = self._make_model(machine, setup.config.sampling_period / self.config.substeps)
        self.data = self.mujoco.MjData(self.model)
        draw = np.random.default_rng(self.config.start_seed)
        legs, height = self.robot.legs, np.array([0.0, 0.0, machine.hip_height])
        start = setup.start + draw.uniform(-self.config.start_spread, self.config.start_spread, setup.start.shape)
        self.data.qpos[legs.base_qpos : legs.base_qpos + 7] = [*(height - self.origin), 1.0, 0.0, 0.0, 0.0]
        self.data.qpos[legs.qpos] = start
        self._begin(setup)
        return self.measure()

    def _make_model(self, machine: RobotMachine, step: float) -> Any:
        """The robot's model for the steps of this plant."""
        mujoco, disable = self.mujoco, self.mujoco.mjtDisableBit
        model = self._make_floor(machine) if self.config.contact == RIGID else copy.copy(self.robot.model)
        model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_EULER
        model.opt.disableflags |= disable.mjDSBL_AUTORESET
        if self.config.contact == ELASTIC:
            model.opt.disableflags |= disable.mjDSBL_CONTACT
        return model

    def _make_floor(self, machine: RobotMachine) -> Any:
        """The robot's model with a rigid floor, which touches its feet and nothing else."""
        spec = self.mujoco.MjSpec.from_file(str(self.robot.path))
        floor = spec.worldbody.add_geom(
            type=self.mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0.0, 0.0, 1.0],
            pos=[0.0, 0.0, -float(self.robot.legs.foot_radius.max())],
            name=FLOOR,
        )
        for geom in (floor, *map(spec.geom, machine.feet)):
            geom.contype = geom.conaffinity = 1  # without them MuJoCo compiles a geom that can never touch anything
        with warnings_dropped(self.mujoco):
            model = spec.compile()
        model.opt.gravity[:] = self.robot.model.opt.gravity
        self.feet = np.array([model.geom(name).id for name in machine.feet])
        self.leg_of = {int(geom): leg for leg, geom in enumerate(self.feet)}
        touching = np.array([*self.feet, model.geom(floor.name).id])
        model.geom_contype[:], model.geom_conaffinity[:] = 0, 0
        model.geom_contype[touching[-1]], model.geom_conaffinity[self.feet] = 1, 1
        model.geom_friction[touching, 0], model.geom_condim[touching] = self.grip[0], 3
        model.geom_margin[touching], model.geom_gap[touching] = 0.0, 0.0
        model.pair_margin[:] = -1.0  # pairs of geoms that a model lists touch whatever else it says: these never do
        model.opt.disableflags &= ~int(self.mujoco.mjtDisableBit.mjDSBL_CONTACT)
        model.opt.enableflags &= ~int(self.mujoco.mjtEnableBit.mjENBL_OVERRIDE)
        model.geom_solref[touching], model.geom_solimp[touching], model.geom_priority[touching] = SOLREF, SOLIMP, 0
        return model

    def _begin(self, setup: Setup) -> None:
        """Prepare contacts and measurements of the state in ``data``."""
        config, data, legs, mechanism = setup.config, self.data, self.robot.legs, setup.mechanism
        ground = make_ground(config.terrain, config.sampling_period)
        touch = Touch(ground, *self.grip) if self.config.contact == ELASTIC else None
        payload = make_payload(config.payload, config.sampling_period)
        self.warned = data.warning.number
        bodies = RobotBodies(
            data.geom_xpos,
            data.cvel,
            data.subtree_com,
            data.xipos,
            data.xfrc_applied,
            data.xpos[legs.base],
            data.xmat[legs.base],
            data.qvel[legs.base_dof : legs.base_dof + 6],
        )
        if self.config.contact == ELASTIC:
            self.feet = legs.foot_geom
        feet = Feet(self.feet.astype(np.int64), legs.foot_body, legs.base)
        self.q, self.dq = np.empty(mechanism.shape), np.empty(mechanism.shape)
        self.mujoco.mj_step1(self.model, data)
        anchor = data.geom_xpos[self.feet, :2].copy()
        self.contacts = Contacts(np.zeros(4), np.zeros(4), anchor, np.zeros(1))
        self.measured = Measured(
            np.empty(mechanism.shape), np.empty(mechanism.shape), np.empty(3), np.empty(3), np.empty(3)
        )
        origin, room = self.origin, Room(np.zeros(3), np.zeros((2, 3)), np.zeros((4, GEOMETRY_FIELDS[SPACE])))
        # Compiled generators do not keep their arrays alive.
        self._kept = (bodies, feet, room, mechanism)
        self._pressing = pressing_robot(touch, payload, origin, bodies, feet, self.contacts, room)
        self._observing = observing_robot(mechanism, ground, bodies, origin, self.q, self.dq, room, self.measured)
        next(self._pressing)
        if self.config.contact == RIGID:
            self.mujoco.mj_forward(self.model, data)
            self._read_forces()

    def _read_forces(self) -> None:
        """Normal forces of MuJoCo's contacts in the last step, N; a plane comes before the sphere that touches it."""
        self.contacts.force[:] = 0.0
        for k, (_, foot) in enumerate(self.data.contact.geom.tolist()):
            self.mujoco.mj_contactForce(self.model, self.data, k, self._wrench)
            self.contacts.force[self.leg_of[foot]] += self._wrench[0]

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (4, 3), N m, over one sampling period.

        Raises:
            Diverged: MuJoCo warns of its state.
        """
        self.data.qfrc_applied[self.robot.legs.dof] = torque
        with warnings_dropped(self.mujoco):
            for substep in range(self.config.substeps):
                self.mujoco.mj_step2(self.model, self.data)
                if self.config.contact == RIGID:
                    self._read_forces()
                self.mujoco.mj_step1(self.model, self.data)
                if self.warned.any():
                    raise Diverged(explain_warning(self.mujoco, self.data, self._name_joint))
                self.contacts.clock[0] += substep + 1 == self.config.substeps
                next(self._pressing)
        return self.measure()

    def _name_joint(self, velocity: int) -> str:
        """The joint to which one of MuJoCo's velocities belongs."""
        return self.model.joint(int(self.model.dof_jntid[velocity])).name or "the trunk"

    def measure(self) -> Measurement:
        """A copy of the present state."""
        legs = self.robot.legs
        self.q[:], self.dq[:] = self.data.qpos[legs.qpos], self.data.qvel[legs.dof]
        next(self._observing)
        foot, velocity, pose, rate, travel = (part.copy() for part in self.measured)
        force = self.contacts.force.copy()
        return Measurement(self.q.copy(), self.dq.copy(), foot, velocity, force, pose, rate, travel)
