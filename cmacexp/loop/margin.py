"""Delay margin of a robot under hybrid control, with a warning if it is small."""

from cmacexp.config import Config
from cmacexp.config.machine import read_model
from cmacexp.control import DriveController, HybridController
from cmacexp.models.lead import discretise
from cmacexp.models.loop_delay import LoopDelay, Margin
from cmacexp.models.robot_gains import (
    Gains,
    derive_basis,
    find_critical_damping,
    find_delay_margin,
    find_standing_margin,
    make_sampling,
)
from cmacexp.protocols import HasReceiver, offers

SMALL_MARGIN = 0.004
"""Delay margin below which a warning is given, s: typical delay of the buses of robots."""


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
