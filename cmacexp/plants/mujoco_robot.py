"""A robot in MuJoCo, from its own model, on the project's elastic ground or on MuJoCo's rigid one."""

import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cmacexp.config import Config, choice, number
from cmacexp.config.fields import listed
from cmacexp.config.machine import read_model
from cmacexp.errors import require
from cmacexp.models.robot import compile_spec, load_mujoco
from cmacexp.models.robot_legs import Legs
from cmacexp.planning.machine import find_stance
from cmacexp.planning.plan import Setup
from cmacexp.plants.drives import BusConfig
from cmacexp.plants.mujoco_kernels import Push, read_floor
from cmacexp.plants.mujoco_plant import FrictionConfig, Model, MujocoPlant, require_machine
from cmacexp.plants.touch import Joints
from cmacexp.protocols import Measurement
from cmacexp.typing import Counts

ELASTIC = "elastic"
RIGID = "mujoco"
FLOOR = "floor of cmacexp"
JOINTS_KEY = "plant.as_built.joints"
PUSH_DURATION = 0.1
"""Duration of a push, s."""
SOLREF = (0.01, 1.0)
"""Time constant (s) and damping ratio of MuJoCo's contacts."""
SOLIMP = (0.99, 0.99, 0.001, 0.5, 2.0)
"""Impedance of MuJoCo's contacts, whatever a model specifies: some have soft feet, and with MuJoCo's default, 0.9 to
0.95, feet sink as deep as into the elastic ground."""


@dataclass
class BuiltJoint:
    """Parameters of one joint, as :mod:`cmacexp.gap` identifies them from a log of a robot."""

    rotor_inertia: float = number("kg m^2", at_least=0, at_most=1e3)
    """Inertia of the rotor, reflected to the joint."""
    viscous_friction: float = number("N m s/rad", at_least=0, at_most=1e3)
    """Viscous friction (damping)."""
    coulomb_friction: list[float] = number("N m", at_least=0, at_most=1e3)
    """Dry friction at equally spaced angles over ``range``; outside it that of its ends."""
    range: list[float] = number("rad", at_least=-100, at_most=100)
    """First and last angle of ``coulomb_friction``."""
    offset: float = number("N m", at_least=-1e3, at_most=1e3, default=0.0)
    """Constant torque, e.g. from an encoder with a different zero."""
    spring: float = number("N m", at_least=-1e3, at_most=1e3, default=0.0)
    """Torque at the end of ``range``; the opposite at its beginning, linear between them."""


@dataclass
class AsBuilt:
    """Differences of the robot from its model; planner, controller and feedforward know the model only."""

    joint_friction: float | None = number("N m", at_least=0, at_most=1e3)
    """Dry friction of every joint; null: as modelled."""
    joint_damping: float | None = number("N m s/rad", at_least=0, at_most=1e3)
    """Damping of every joint; null: as modelled."""
    rotor_inertia: float | None = number("kg m^2", at_least=0, at_most=1e3)
    """Inertia of the rotor at every joint; null: as modelled."""
    trunk_mass_factor: float = number("", above=0, at_most=10)
    """Mass of the trunk over that in the model."""
    trunk_inertia_factor: float = number("", above=0, at_most=10)
    """Inertia of the trunk over that in the model."""
    trunk_shift: float = number("m", at_least=-1, at_most=1)
    """Forward distance of the trunk's centre of mass from that in the model."""
    leg_mass_factor: float = number("", above=0, at_most=10)
    """Mass and inertia of thighs and calves over those in the model."""
    joints: dict[str, BuiltJoint] = field(default_factory=dict, kw_only=True)
    """Parameters of each leg joint by its name in the model, which replace the values for all joints; or empty."""

    def change(self, mujoco: Any, model: Any, legs: Legs) -> Joints | None:
        """Change ``model``, an MjModel, into the actual robot; return joint torques that act besides its motors.

        Raises BadInput if ``joints`` are not those of its legs.
        """
        as_built = (self.joint_friction, self.joint_damping, self.rotor_inertia)
        as_modelled = (model.dof_frictionloss, model.dof_damping, model.dof_armature)
        for values, value in zip(as_modelled, as_built, strict=True):
            if value is not None:
                values[legs.dof] = value
        model.body_mass[legs.base] *= self.trunk_mass_factor
        model.body_inertia[legs.base] *= self.trunk_inertia_factor
        model.body_ipos[legs.base, 0] += self.trunk_shift
        links = model.jnt_bodyid[legs.joint[:, 1:]]
        model.body_mass[links] *= self.leg_mass_factor
        model.body_inertia[links] *= self.leg_mass_factor
        joints = self._make_joints(model, legs) if self.joints else None
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return joints

    def _make_joints(self, model: Any, legs: Legs) -> Joints:
        names = [model.joint(int(joint)).name for joint in legs.joint.ravel()]
        allowed = f"must be the joints of the legs, {listed(names)}"
        require(sorted(names) == sorted(self.joints), JOINTS_KEY, listed(list(self.joints)), allowed)
        joints = [self.joints[name] for name in names]
        is_table = joints[0].coulomb_friction and len({len(joint.coulomb_friction) for joint in joints}) == 1
        allowed = "must have as many values, at least one, for every joint"
        require(is_table, JOINTS_KEY, "coulomb_friction", allowed)
        for name, joint in zip(names, joints, strict=True):
            is_range = len(joint.range) == 2 and joint.range[0] < joint.range[1]
            require(is_range, f"{JOINTS_KEY}.{name}.range", joint.range, "must be two angles, the lower one first")
        shape = legs.joint.shape
        model.dof_armature[legs.dof] = np.reshape([joint.rotor_inertia for joint in joints], shape)
        model.dof_damping[legs.dof] = np.reshape([joint.viscous_friction for joint in joints], shape)
        model.dof_frictionloss[legs.dof] = np.reshape([np.mean(joint.coulomb_friction) for joint in joints], shape)
        return Joints(
            model.dof_frictionloss,
            np.reshape([joint.range[0] for joint in joints], shape),
            np.reshape([joint.range[1] for joint in joints], shape),
            np.reshape([joint.coulomb_friction for joint in joints], (*shape, -1)),
            np.reshape([joint.offset for joint in joints], shape),
            np.reshape([joint.spring for joint in joints], shape),
        )


class MujocoRobot(MujocoPlant):
    """A robot under joint torques. Its feet touch the ground where their centres are at the height 0.

    On elastic ground a spring and a damper hold a foot at the point where it touched down, as long as their force
    stays within the limit of friction; beyond it the foot drags the point along.
    """

    @dataclass
    class Config(FrictionConfig):
        """Integration, ground, friction of the feet."""

        contact: str = choice(ELASTIC, RIGID)
        """elastic: the ground of the project, see ``terrain``; mujoco: MuJoCo's own contacts with a flat rigid
        floor."""
        friction_stiffness: float = number("N/m", above=0, at_most=1e7, needs=("own.contact == 'elastic'",))
        """Stiffness of the spring that holds a sticking foot."""
        friction_damping: float = number("N s/m", at_least=0, at_most=1e5, needs=("own.contact == 'elastic'",))
        """Damping parallel to the spring of a sticking foot."""
        start_moving: bool = field(kw_only=True)
        """Start with the planned velocities, as in the middle of a walk; false: from rest."""
        push: float = number("N", at_least=-1e5, at_most=1e5)
        """Force on the centre of the trunk, to the left, for PUSH_DURATION; 0: none."""
        push_time: float = number("s", at_least=0, needs=("own.push",))
        """Time at which the push begins."""
        as_built: AsBuilt = field(kw_only=True)
        """Differences of the robot from its model."""
        bus: BusConfig = field(default_factory=BusConfig, kw_only=True)
        """Bus to drives with loops of their own (``controller=drives``)."""

        def check(self, config: Config) -> None:
            """Check that the terrain is flat and uniform with MuJoCo's rigid floor; raise BadInput otherwise."""
            terrain = config.terrain
            changed = {"slope": terrain.slope, "patch_spread": terrain.patch_spread, "step_time": terrain.step_time}
            reason = f"has no effect with plant.contact={RIGID}, a flat rigid floor; use plant=mujoco_robot"
            for key, value in changed.items():
                require(self.contact != RIGID or not value, f"terrain.{key}", value, reason)

    config: Config

    def reset(self, setup: Setup) -> Measurement:
        """Start near the planned joint angles, at rest, the body level at its planned height; raises BadInput."""
        require_machine(setup, "robot", "mujoco_robot", "robot")
        self.mujoco = load_mujoco()
        self.robot = read_model(setup.config.machine)
        legs = self.robot.legs
        machine = setup.config.machine
        origin = find_stance(self.robot, machine.hip_height, machine.width).origin
        if self.config.contact == ELASTIC:
            model = copy.copy(self.robot.model)
            feet = legs.foot_geom
            floor = None
            unread = self.mujoco.mjtDisableBit.mjDSBL_SENSOR  # without a floor no sensor is read
            model.opt.disableflags |= self.mujoco.mjtDisableBit.mjDSBL_CONTACT | unread
        else:
            model, feet, floor = self._make_floor()
        model.body_mass *= self.config.mass_factor
        model.body_inertia *= self.config.mass_factor
        joints = self.config.as_built.change(self.mujoco, model, legs)
        model.opt.integrator = self.mujoco.mjtIntegrator.mjINT_EULER
        model.opt.disableflags |= self.mujoco.mjtDisableBit.mjDSBL_AUTORESET
        machine = Model(model, legs.base, legs.joint, feet, origin)
        setup = self.config.build(setup)
        times = (self.config.push_time, self.config.push_time + PUSH_DURATION)
        push = Push(self.config.push, *(round(time / setup.config.sampling_period) for time in times))
        measured = self.begin(setup, machine, self.config.touch(setup), floor, self.config.start_moving, push, joints)
        if floor is None:
            return measured
        self.mujoco.mj_forward(self.model, self.data)
        read_floor(floor, self.engine.sensors, self.state.force)
        return self.measure()

    def _make_floor(self) -> tuple[Any, Counts, Counts]:
        """Make the robot's model with a rigid floor that touches its feet and nothing else.

        Returns the model, the geoms of the feet, and the indices of their normal forces among its sensors' values.
        """
        spec = self.robot.spec.copy()
        names = [self.robot.model.geom(int(foot)).name for foot in self.robot.legs.foot_geom]
        floor = spec.worldbody.add_geom(
            type=self.mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0.0, 0.0, 1.0],
            pos=[0.0, 0.0, -float(self.robot.legs.foot_radius.max())],
            name=FLOOR,
        )
        for geom in (floor, *map(spec.geom, names)):
            geom.contype = geom.conaffinity = 1  # without them MuJoCo compiles a geom that can never touch anything
        geom = self.mujoco.mjtObj.mjOBJ_GEOM
        force_of_one = [1 << int(self.mujoco.mjtConDataField.mjCONDATA_FORCE), 0, 1]  # a sphere touches a plane once
        sensors = [
            spec.add_sensor(
                type=self.mujoco.mjtSensor.mjSENS_CONTACT,
                objtype=geom,
                objname=FLOOR,
                reftype=geom,
                refname=foot,
                intprm=force_of_one,
            )
            for foot in names
        ]
        model = compile_spec(self.robot.path, spec)
        feet = np.array([model.geom(name).id for name in names])
        touching = np.array([*feet, model.geom(floor.name).id])
        model.geom_contype[:] = model.geom_conaffinity[:] = 0
        model.geom_contype[touching[-1]] = model.geom_conaffinity[feet] = 1
        model.geom_friction[touching, 0] = self.config.friction
        model.geom_condim[touching] = 3
        model.geom_margin[touching] = model.geom_gap[touching] = 0.0
        model.pair_margin[:] = -1.0  # geom pairs listed in a model ignore contype and conaffinity: they never touch
        model.geom_solref[touching] = SOLREF
        model.geom_solimp[touching] = SOLIMP
        model.geom_priority[touching] = 0
        return model, feet, model.sensor_adr[[sensor.id for sensor in sensors]].astype(np.int64)
