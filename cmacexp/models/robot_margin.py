"""How much more delay hybrid control of a robot bears while it stands: a linear model of robot, ground and control.

A foot in the air is the other limit, see :func:`cmacexp.models.robot_gains.find_delay_margin`. Which one is lower
depends on the gains: those of the posture grow where those of a foot are small.
"""

import math

import numpy as np

from cmacexp.models.lead import Lead
from cmacexp.models.loop_delay import LoopDelay, Margin
from cmacexp.models.robot import Robot
from cmacexp.models.robot_gains import Gains, linearise

SLOWEST, FASTEST = 3.0, 0.95
"""Angular frequencies that are looked at: from, rad/s, and up to, over the Nyquist frequency."""
FREQUENCIES = 400


def find_standing_margin(
    robot: Robot, ground: tuple[float, float], gains: Gains, lead: Lead, period: float, loop_delay: LoopDelay
) -> Margin:
    """By how much feedback of a robot on four feet may be later, beyond ``loop_delay``, before it is unstable.

    The robot is linear about home, its feet stick to ``ground``, K_n in N/m and damping in N s/m in all directions,
    and control is the combined law with posture control, see :mod:`cmacexp.control.hybrid_kernels`; ``period`` is in
    s. Of the loop gain L(j w), (12, 12), each eigenvalue of magnitude 1 is at -1 after a delay of its angle from -1
    over w (generalised Nyquist criterion, MacFarlane & Postlethwaite 1977). Infinite if none has.
    """
    standing = linearise(robot)
    feet, moved = (jacobian.reshape(-1, len(standing.inertia)) for jacobian in (standing.feet, standing.moved))
    rates = np.geomspace(SLOWEST, FASTEST * math.pi / period, FREQUENCIES)
    s = 1j * rates[:, None, None]
    contact = ground[0] + ground[1] * s
    impedance = standing.inertia * s**2 + standing.damping * s + contact * (feet.T @ feet)
    motion = np.linalg.solve(impedance, moved.T)
    error = (gains.position_gain + gains.velocity_gain * s) * moved
    posture = gains.position_gain * gains.posture_gain + gains.velocity_gain * gains.posture_rate_gain * s
    yielding = gains.position_gain * gains.elasticity + gains.velocity_gain * gains.admittance
    error[:, 2::3] += yielding * contact * feet[2::3] - posture * standing.hips
    shift = np.exp(-s * period)
    filtered = (lead.b0 + lead.b1 * shift) / (1.0 + lead.a1 * shift) * loop_delay.respond(s, period)
    loci = np.linalg.eigvals(filtered * (error @ motion))
    order = np.argsort(abs(loci), axis=1)  # sorted magnitudes are continuous in the frequency
    loci = np.take_along_axis(loci, order, axis=1)
    at, which = np.nonzero(np.diff(abs(loci) > 1.0, axis=0))
    if not len(at):
        return Margin(0.0, math.inf)
    delays = np.angle(-loci[at, which]) % (2.0 * math.pi) / rates[at]
    first = int(np.argmin(delays))
    return Margin(float(rates[at[first]]), float(delays[first]))
