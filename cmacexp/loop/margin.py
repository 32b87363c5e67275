"""What a robot has in reserve against delay, damping, torque and roll, with a warning where that is little."""

from typing import NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.config.machine import read_model
from cmacexp.control import DriveController, HybridController
from cmacexp.models.lead import discretise
from cmacexp.models.loop_delay import LoopDelay, Margin
from cmacexp.models.mechanism import Mechanism
from cmacexp.models.robot_gains import (
    Gains,
    derive_basis,
    find_critical_damping,
    find_delay_margin,
    find_standing_margin,
    make_sampling,
)
from cmacexp.planning.machine import planned_torques
from cmacexp.planning.plan import Plan
from cmacexp.planning.stability import STABILITY
from cmacexp.protocols import HasReceiver, offers
from cmacexp.typing import Array

SMALL_MARGIN = 0.004
"""Delay margin below which a warning is given, s: typical delay of the buses of robots."""
JOINT_NAMES = ("hip", "thigh", "calf")
LEAST_ROLL_STIFFNESS = 1.8
"""Roll stiffness of the feet over that with which gravity tips the body over, below which a warning is given: a
robot of 12 kg fell with 1.5, also with feedback only, and walked with 2.1 and more."""


def find_margin(
    config: Config, control: HybridController.Config, loop_delay: LoopDelay, stands: bool = True
) -> Margin:
    """Compute the delay margin of a robot: the additional feedback delay at which it becomes unstable.

    It is the margin of a foot in the air or, if ``stands`` is True, the smaller one of that and of the linearised
    standing robot. The latter exists only for ``force_control.method=combined``. ``loop_delay`` is the delay counted
    so far. Raises BadInput if a foot is already unstable.
    """
    lead = discretise(control.lead_omega, control.lead_alpha, config.sampling_period, control.lead_gain)
    robot = read_model(config.machine)
    force = config.force_control
    foot_mass = derive_basis(robot).foot_mass
    margin = find_delay_margin(foot_mass, control.velocity_gain, lead.b0, config.sampling_period, loop_delay)
    if not stands or force.method != "combined":
        return margin
    gains = Gains(
        control.position_gain,
        control.velocity_gain,
        config.posture.gain,
        config.posture.rate_gain,
        force.elasticity,
        force.admittance,
    )
    standing = find_standing_margin(
        robot,
        (config.terrain.stiffness, config.terrain.damping),
        gains,
        lead,
        config.sampling_period,
        loop_delay,
    )
    return min(margin, standing, key=lambda margin: margin.delay)


def check_margin(config: Config, control: HybridController.Config, loop_delay: LoopDelay) -> str:
    """Return a warning if the delay margin is below SMALL_MARGIN; else, or with ``warn=false``, an empty text.

    A robot with no delay at all (``loop_delay``) gets no warning. Raises BadInput if a foot is unstable.
    """
    warns = config.warn and loop_delay != LoopDelay()
    margin = find_margin(config, control, loop_delay, stands=warns).delay
    if not warns or margin >= SMALL_MARGIN:
        return ""
    little = f"feedback bears {1e3 * margin:.2g} ms of delay that is not counted, less than"
    advice = "declare what a robot has, or use controller=drives"
    return f"machine.latency={config.machine.latency:g}: {little} {1e3 * SMALL_MARGIN:g} ms; {advice}"


def find_sampled_limit(config: Config) -> float:
    """Find the damping, N m s/rad, from which on drives that compute once a command shake the lightest joint.

    Whether the receiver of commands computes so is declared by ``plant.bus.sampled``.
    """
    actuator = config.actuator
    sampling = make_sampling(config.sampling_period, actuator.delay, actuator.lag, config.machine.latency)
    return find_critical_damping(read_model(config.machine), sampling)


def check_drives(config: Config, control: DriveController.Config) -> str:
    """Return a warning if drives that compute once a command have too much damping; else an empty text."""
    plant = config.plant
    if not (config.warn and offers(plant, HasReceiver) and plant.bus.sampled):
        return ""
    limit = find_sampled_limit(config)
    if control.damping < limit:
        return ""
    return (
        f"controller.damping={control.damping:g}: drives that compute every {config.sampling_period:g} s shake "
        f"from {limit:.3g} N m s/rad on; leave it out, or use at most half of that"
    )


class Walk(NamedTuple):
    """Needs of a planned walk of a robot."""

    torque: Array
    """(3,): largest planned torque of hip, thigh and calf, N m."""
    share: Array
    """(3,): that torque over the largest one of the joint; 0 without a limit."""
    widths: Array
    """(2,): distance between the feet in front and in the rear, m."""
    margin: float
    """Least planned stability margin, m; NaN if there are fewer than three feet down at times."""
    roll_stiffness: float
    """Stiffness of four feet against rolling, over that with which gravity tips the body over; NaN on drives."""

    def list_warnings(self) -> list[str]:
        """List why the robot may fall."""
        warnings = []
        if self.roll_stiffness < LEAST_ROLL_STIFFNESS:
            warnings.append(
                f"roll stiffness on four feet is {self.roll_stiffness:.3g} of that with which the body tips over, "
                f"below {LEAST_ROLL_STIFFNESS:g}: it may fall to its side; use a larger gait.width or posture.gain"
            )
        if weak := [name for name, over in zip(JOINT_NAMES, self.share, strict=True) if over > 1.0]:
            verb = "needs" if len(weak) == 1 else "need"
            warnings.append(f"{' and '.join(weak)} {verb} more torque than the model has: it may fall")
        return warnings


def judge_walk(config: Config, mechanism: Mechanism, plan: Plan) -> Walk:
    """Compute what the planned walk of the robot of a config needs."""
    force = plan.force_desired
    torque = np.abs(planned_torques(config.nominal, mechanism, plan.joints, plan.sway, force, force)).max(axis=(0, 1))
    roll_stiffness = np.nan
    if config.gains is not None and config.gains[0]:
        foot = config.gains[0] * (1.0 + config.posture.gain)
        foot *= config.terrain.stiffness / (foot + config.terrain.stiffness)  # in series
        tipping = mechanism.weight * mechanism.hip_height
        roll_stiffness = foot * float((mechanism.hips[:, 1] ** 2).sum()) / tipping
    return Walk(
        torque=torque,
        share=torque / read_model(config.machine).torque_limits,
        widths=np.abs(np.diff(mechanism.hips[:, 1].reshape(2, 2))[:, 0]),
        margin=float(plan.margins[:, STABILITY].min()),
        roll_stiffness=roll_stiffness,
    )
