"""Sensors of a robot that measures its joints, its motors' torques and its attitude, and estimates all else."""

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
from cmacexp.sensors.estimator import OF_A_BODY, OF_A_JOINT, Errors, Estimator, Proprioception, estimate
from cmacexp.sensors.kernels import new_observation
from cmacexp.sensors.place_filter import new_filter
from cmacexp.sensors.real import JointSensors, make_sensing
from cmacexp.typing import Array, KernelParts

ELASTIC, RIGID = "elastic", "mujoco"


@dataclass
class ProprioceptiveConfig(ChannelsConfig):
    """Imperfections of what a robot measures, and what its estimator assumes."""

    position: LegSignalConfig
    """Encoders, rad."""
    velocity: LegSignalConfig
    """Joint velocities, rad/s."""
    torque: LegSignalConfig
    """Torques of the motors, N m; from them follow the contact forces."""
    tilt: SignalConfig
    """Pitch and roll by the inertial unit, rad."""
    heading: SignalConfig
    """Yaw likewise, rad."""
    gyroscope: SignalConfig
    """rad/s."""
    accelerometer: SignalConfig
    """m/s^2."""
    encoder_offset: float = number("rad", at_least=0, at_most=1)
    """Largest constant error of a joint angle; that of each joint follows from the seed."""
    torque_gain_error: float = number("", at_least=0, below=1)
    """Largest constant error of a torque over its value, likewise."""
    tilt_bias: float = number("rad", at_least=0, at_most=0.5)
    """Amplitude of a slow error of pitch and roll, whose phases follow from the seed."""
    tilt_bias_period: float = number("s", above=0, at_most=1e6, needs=("own.tilt_bias > 0",))
    """Its period."""
    heading_drift: float = number("rad/s", at_least=-1, at_most=1)
    """Rate of the error of the heading."""
    accelerometer_bias: float = number("m/s^2", at_least=0, at_most=10)
    """Largest constant error of an acceleration, as of a joint angle."""
    force_lag: float = number("s", at_least=0, at_most=1)
    """Time constant of a first-order low-pass filter of the estimated forces; 0: not filtered."""
    momentum: bool = field(kw_only=True)
    """Whether estimated forces count what changes the momentum of the joints, with their inertia at home."""
    contact: str = choice(ELASTIC, RIGID)
    """What the estimator assumes of the ground: elastic, feet stick at their centres and sink by their force over the
    assumed K_n; mujoco, it is rigid, and feet roll."""

    @property
    def draws(self) -> bool:  # type: ignore[override]
        """Whether anything follows from the seed."""
        return super().draws or any(
            (self.encoder_offset, self.torque_gain_error, self.tilt_bias, self.accelerometer_bias)
        )

    def check(self, config: Config) -> None:
        """Check that the machine is a robot, and each signal against it and the run; raises BadInput."""
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
    """What a robot knows of itself: encoders and inertial unit measure, an estimator does the rest.

    The true state does not reach it: height, place, speed and contact follow from :class:`RobotSignals` alone.
    """

    Config = ProprioceptiveConfig
    alters = (*SIGNALS, TRAVEL)

    def reset(self, setup: Setup) -> None:
        """Begin to estimate anew, by what the designer believes of robot and ground."""
        config, machine, mechanism = self.config, setup.config.machine, setup.mechanism
        assert isinstance(machine, RobotMachine)
        legs, joints = mechanism.shape
        self.mechanism, self.support, self.step = mechanism, setup.plan.support, 0
        channels = [(name, leg + 1) for leg in range(legs) for name in OF_A_JOINT for _ in range(joints)]
        self.sensing = make_sensing(config, [*channels, *((name, 0) for name in OF_A_BODY)], setup)
        robot = read_model(machine)
        links, masses = find_links(robot, find_stance(robot, machine.hip_height))
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

    def kernel_parts(self) -> KernelParts:
        """Channels, estimator, and the observation that it fills."""
        return {"sensing": Proprioception(self.sensing, self.estimator), "observation": self.observation}

    def measure(self, true: Measurement) -> Measurement:
        """What the robot knows by the signals of ``true``; raises CmacexpError if there are none."""
        if true.signals is None:
            raise CmacexpError("sensors=proprioceptive needs a plant that gives RobotSignals: use plant=mujoco_robot")
        return self.observe(true.signals)

    def observe(self, signals: RobotSignals, run: Callable[..., None] = estimate) -> Measurement:
        """What the robot knows by ``signals``; ``run`` is the estimator, or the program that was made of it."""
        support = self.support[self.step % len(self.support)]
        run(self.estimator, self.sensing, self.mechanism, signals, self.step, support, self.observation)
        self.step += 1
        return copy_state(self.observation, self.observation.travel)


def find_links(robot: Robot, stance: Stance) -> tuple[Array, Array]:
    """Chains (3, 4, 21) whose feet are the centres of mass of hips, thighs and calves, and masses (3, 4), kg.

    A link has what is welded to it.
    """
    model, legs = robot.model, robot.legs
    data = robot.at(np.zeros(3))
    load_mujoco().mj_comPos(model, data)
    links, masses = np.stack([stance.chains] * 3), np.zeros((3, len(stance.chains)))
    for i, n in np.ndindex(legs.joint.shape):
        welded = model.body_weldid == model.body_weldid[model.jnt_bodyid[legs.joint[i, n]]]
        masses[n, i] = model.body_mass[welded].sum()
        centre = model.body_mass[welded] @ data.xipos[welded] / masses[n, i]
        links[n, i, FOOT:] = to_hip(centre - stance.hips[i] - stance.origin)
    return links, masses
