"""Onboard sensors of a robot: joints, motor torques and inertial unit, with a state estimator for the rest."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from cmacexp.config import Config, choice, number
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.errors import CmacexpError, require
from cmacexp.models.chain import FOOT, to_hip
from cmacexp.models.loop_delay import first_order_share
from cmacexp.models.robot import Robot, load_mujoco
from cmacexp.models.robot_gains import list_jacobians
from cmacexp.planning.machine import Stance, find_stance
from cmacexp.planning.plan import Setup
from cmacexp.protocols import SIGNALS, TRAVEL, Measurement, RobotSignals, copy_state
from cmacexp.sensors.config import ChannelsConfig, LegSignalConfig, SignalConfig
from cmacexp.sensors.estimator import BODY_CHANNELS, JOINT_CHANNELS, Errors, Estimator, estimate
from cmacexp.sensors.kernels import new_observation
from cmacexp.sensors.place_filter import new_filter
from cmacexp.sensors.real import JointSensors, make_sensing
from cmacexp.typing import Array

ELASTIC = "elastic"
RIGID = "mujoco"


@dataclass
class ProprioceptiveConfig(ChannelsConfig):
    """Imperfections of the onboard sensors, and parameters of the state estimator."""

    position: LegSignalConfig
    """Joint angles from encoders, rad."""
    velocity: LegSignalConfig
    """Joint velocities, rad/s."""
    torque: LegSignalConfig
    """Motor torques, N m; contact forces are estimated from them."""
    tilt: SignalConfig
    """Pitch and roll from the inertial unit, rad."""
    heading: SignalConfig
    """Yaw from the inertial unit, rad."""
    gyroscope: SignalConfig
    """Angular velocity of the body from the inertial unit, rad/s."""
    accelerometer: SignalConfig
    """Acceleration of the body from the inertial unit, m/s^2."""
    encoder_offset: float = number("rad", at_least=0, at_most=1)
    """Largest constant error of a joint angle; the seed determines the error of each joint."""
    torque_gain_error: float = number("", at_least=0, below=1)
    """Largest constant relative error of a motor torque; the seed determines the error of each motor."""
    tilt_bias: float = number("rad", at_least=0, at_most=0.5)
    """Amplitude of a slow sinusoidal error of pitch and roll; the seed determines the phases."""
    tilt_bias_period: float = number("s", above=0, at_most=1e6, needs=("own.tilt_bias > 0",))
    """Period of the slow error of pitch and roll."""
    heading_drift: float = number("rad/s", at_least=-1, at_most=1)
    """Drift rate of the heading."""
    accelerometer_bias: float = number("m/s^2", at_least=0, at_most=10)
    """Largest constant error of an acceleration; the seed determines the error of each axis."""
    force_lag: float = number("s", at_least=0, at_most=1)
    """Time constant of a first-order low-pass filter of the estimated forces; 0: not filtered."""
    momentum: bool = field(kw_only=True)
    """True: subtract the torque that changes the joint momentum from force estimates (inertia of the home pose)."""
    contact: str = choice(ELASTIC, RIGID)
    """Ground model of the estimator. elastic: feet stick at their centres and sink by force / nominal stiffness K_n;
    mujoco: the ground is rigid and spherical feet roll on it."""

    @property
    def draws(self) -> bool:  # type: ignore[override]
        """True if the seed affects a reading: noise, drop-outs or constant and slow errors."""
        return super().draws or any(
            (self.encoder_offset, self.torque_gain_error, self.tilt_bias, self.accelerometer_bias)
        )

    def check(self, config: Config) -> None:
        """Check that the machine is a robot without fault detection, then each signal; raises BadInput."""
        kind = config.machine.kind
        require(
            kind == "robot", "machine.kind", kind, "must be robot with sensors=proprioceptive: use scenario=robot"
        )
        require(
            not config.plausibility.enabled,
            "plausibility.enabled",
            True,
            "must be false with sensors=proprioceptive, whose forces are estimates and lag behind a touch-down",
        )
        super().check(config)


class ProprioceptiveSensors(JointSensors):
    """Onboard sensors of a robot: encoders, motor torques and inertial unit, with a state estimator for the rest.

    Height, position, velocity and contact forces are estimated from :class:`RobotSignals` only, never the true state.
    """

    Config = ProprioceptiveConfig
    alters = (*SIGNALS, TRAVEL)

    def reset(self, setup: Setup) -> None:
        """Restart the estimator, with the nominal parameters of robot and ground."""
        config = self.config
        machine = setup.config.machine
        mechanism = self.mechanism = setup.mechanism
        assert isinstance(machine, RobotMachine)
        legs, joints = mechanism.shape
        self.support = setup.plan.support
        self.step = 0
        channels = [(name, leg + 1) for leg in range(legs) for name in JOINT_CHANNELS for _ in range(joints)]
        self.sensing = make_sensing(config, [*channels, *((name, 0) for name in BODY_CHANNELS)], setup)
        robot = read_model(machine)
        links, masses = find_links(robot, find_stance(robot, machine.hip_height, machine.width))
        period = setup.config.sampling_period
        self.estimator = Estimator(
            period=period,
            weight=mechanism.weight,
            stiffness=setup.config.assumed_stiffness,
            radius=float(robot.legs.foot_radius.mean()) if config.contact == RIGID else 0.0,
            hips=mechanism.hips,
            links=links,
            link_masses=masses,
            force_share=first_order_share(config.force_lag, period),
            inertia=np.array([inertia if config.momentum else 0.0 * inertia for inertia, _ in list_jacobians(robot)]),
            momentum=np.zeros((legs, joints)),
            errors=Errors(
                config.encoder_offset,
                config.torque_gain_error,
                config.tilt_bias,
                2.0 * math.pi / config.tilt_bias_period,
                config.heading_drift,
                config.accelerometer_bias,
            ),
            places=new_filter(legs),
            force=np.zeros(legs),
            torque=np.zeros((legs, joints)),
            depth=np.zeros(legs),
        )
        self.observation = new_observation(legs, mechanism.axes)._replace(travel=np.zeros(3))

    def measure(self, true: Measurement) -> Measurement:
        """Return the estimate from the signals of ``true``; raises CmacexpError if it has no RobotSignals."""
        if true.signals is None:
            raise CmacexpError("sensors=proprioceptive needs a plant that gives RobotSignals: use plant=mujoco_robot")
        return self.observe(true.signals)

    def observe(self, signals: RobotSignals, run: Callable[..., None] = estimate) -> Measurement:
        """Return the estimate from ``signals``; ``run`` is :func:`estimate` or a program compiled from it."""
        support = self.support[self.step % len(self.support)]
        run(self.estimator, self.sensing, self.mechanism, signals, self.step, support, self.observation)
        self.step += 1
        return copy_state(self.observation, self.observation.travel)


def find_links(robot: Robot, stance: Stance) -> tuple[Array, Array]:
    """Return chains (3, 4, 21), m, that end at the centres of mass of hips, thighs and calves, and masses (3, 4), kg.

    Bodies welded to a link count as part of it.
    """
    model = robot.model
    joints = robot.legs.joint
    data = robot.at(np.zeros(3))
    load_mujoco().mj_comPos(model, data)
    links = np.stack([stance.chains] * 3)
    masses = np.zeros((3, len(stance.chains)))
    for i, n in np.ndindex(joints.shape):
        welded = model.body_weldid == model.body_weldid[model.jnt_bodyid[joints[i, n]]]
        masses[n, i] = model.body_mass[welded].sum()
        centre = model.body_mass[welded] @ data.xipos[welded] / masses[n, i]
        links[n, i, FOOT:] = to_hip(centre - stance.hips[i] - stance.origin)
    return links, masses
