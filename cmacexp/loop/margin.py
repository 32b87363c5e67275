"""How much more delay the feedback of a robot under hybrid control bears, and whether that is little."""

from cmacexp.config import Config
from cmacexp.config.machine import read_model
from cmacexp.control import HybridController
from cmacexp.models.lead import discretise
from cmacexp.models.loop_delay import LoopDelay, Margin
from cmacexp.models.robot_gains import Gains, derive_basis, find_delay_margin, find_standing_margin

SMALL_MARGIN = 0.004
"""Delay that feedback should bear beyond what is counted, s: buses of robots have it."""


def find_margin(
    config: Config, control: HybridController.Config, loop_delay: LoopDelay, stands: bool = True
) -> Margin:
    """By how much a robot's feedback may be later before it shakes, a foot in the air or all of it as it ``stands``.

    How it stands is known under the combined law alone. Raises BadInput if a foot shakes already.
    """
    lead = discretise(control.lead_omega, control.lead_alpha, config.sampling_period)
    robot, force = read_model(config.machine), config.force_control
    foot_mass, gain = derive_basis(robot).foot_mass, control.velocity_gain
    margin = find_delay_margin(foot_mass, gain, lead.b0, config.sampling_period, loop_delay)
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
    ground = (config.terrain.stiffness, config.terrain.damping)
    standing = find_standing_margin(robot, ground, gains, lead, config.sampling_period, loop_delay)
    return min(margin, standing, key=lambda margin: margin.delay)


def check_margin(config: Config, control: HybridController.Config, loop_delay: LoopDelay) -> str:
    """Why the margin of late feedback is small; empty if it is not, or nobody wants to hear it.

    Raises BadInput if a foot shakes.
    """
    warns = config.warn and loop_delay != LoopDelay()
    margin = find_margin(config, control, loop_delay, stands=warns).delay
    if not warns or margin >= SMALL_MARGIN:
        return ""
    little = f"feedback bears {1e3 * margin:.2g} ms of delay that is not counted, less than"
    advice = "declare what a robot has, or use controller=drives"
    return f"machine.latency={config.machine.latency:g}: {little} {1e3 * SMALL_MARGIN:g} ms; {advice}"
