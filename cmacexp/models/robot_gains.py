"""Gains of every robot by one rule from its masses, legs and sampling period, and the delay margin that they leave.

Constants in the equations were measured for this project: docs/robots.md.
"""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.models.lead import Lead
from cmacexp.models.leg import GRAVITY
from cmacexp.models.loop_delay import LoopDelay, Margin, add_delays, find_drive_margin
from cmacexp.models.robot import Robot, load_mujoco
from cmacexp.models.robot_legs import LEGS
from cmacexp.typing import Array

STABLE_SHARE = 0.3
"""Velocity feedback by rule over the critical one, from which on the lightest foot is unstable."""
MOST_SHARE = 0.5
"""Largest velocity feedback over the critical one that is accepted; with 0.5 two robots fall."""
MOST_FEEDBACK = 0.6
"""Largest velocity feedback over the one that would stop the lightest foot within a sample."""
DECAY_TIME = 0.1
"""K_av / K_ap, and V_fn / P_fn, s."""
BODY_RATE = 27.0
"""Natural angular frequency of the body on its legs, rad/s."""
DRIVEN_RATE = 34.0
"""Natural angular frequency of the body on drives with loops of their own, rad/s. With 27 the final error of a Go2 is
larger: a crawl of 60 cycles ends at 0.4 to 1.0 mm instead of 0.2 to 0.3, a trot of 200 at 0.6 to 0.8 instead of 0.5
to 0.6 (both grounds, three seeds each)."""
DRIVEN_DECAY = 0.075
"""Damping over stiffness of a drive, s: five times the lag of a Go2's torques."""
SAMPLED_SHARE = 0.45
"""Largest damping by rule, over the critical one, of drives that compute once a command: joints of other models of a
Go2 have down to 0.6 of the inertia."""
SAMPLED_PERIODS = 3.0
"""Least damping over stiffness of such drives, in sampling periods; 1.5 of them take all damping away."""
YIELD = 0.25
"""P_fn K_ap: displacement of the reference per force error, times the position gain."""
DEPTH = 0.003
"""Depression of the ground under a quarter of the weight, m."""
HEIGHT_OF_LINKS = 0.7
"""Height of the hips over the length of the stretched leg."""
PERIODS = ((0.001, 0.004), (0.002, 0.017), (0.004, 0.02))
"""Sampling periods, s, each with the least m_f/m of the robots that walked with it."""
PERIOD_WITHOUT_ROTORS = 0.00025
"""Longest sampling period, s, for joints without rotor inertia, as in models made for ROS; with 0.5 ms one of 16 such
robots falls, with 1 ms half."""
SHORT_LEG = 0.25
"""Length of a stretched leg, m, below which the sampling period is the first of PERIODS at most: with the second, two
of five models with legs of 0.11 to 0.24 m fall, and the others walk with larger errors."""
HEAVY_FOOT = 0.035
"""m_f/m above which a robot is warned of a longer period than the first of PERIODS: of five models with wheels one
falls with the second, and three have larger errors."""
ROTOR_INERTIA = 0.004
"""Nominal inertia of a rotor, reflected to its joint, over mass of the robot and squared length of a leg. Of the ten
shipped robots seven have 0.0019 to 0.013; the other three, with 0.0001 to 0.0005, have the lightest feet."""
RECOMMENDED = PERIODS[:2]
"""Those of PERIODS with which robots walk as well as with a shorter one."""
NO_DELAY = LoopDelay()
"""Feedback without delay beyond the sampling period."""
LATE_MARGIN = 1.3
"""Factor by which delayed feedback raises the required m_f/m; with 1.22 on B2, and 1.06 on Spot, learning
diverges."""

SLOWEST, FASTEST = 3.0, 0.95
"""Range of angular frequencies for the margin of a standing robot: from, rad/s, and up to, over the Nyquist
frequency."""
FREQUENCIES = 400


class Basis(NamedTuple):
    """Quantities that depend on the model of a robot only."""

    mass: float
    """Total mass, m, kg."""
    foot_mass: float
    """Least effective mass of a foot, m_f, kg."""
    hip_height: float
    """Height of the thigh joints above the undepressed ground, m."""
    stiffness: float
    """K_n of the ground, N/m."""
    damping: float
    """Damping of the ground, N s/m."""

    @property
    def ratio(self) -> float:
        """m_f/m."""
        return self.foot_mass / self.mass


class Gains(NamedTuple):
    """Gains from a :class:`Basis`, the sampling period, the LEAD compensator and the delay of the feedback."""

    position_gain: float
    """K_ap, N/m."""
    velocity_gain: float
    """K_av, N s/m."""
    posture_gain: float
    """Downward displacement of a foot over the height that its hip is too low."""
    posture_rate_gain: float
    """Downward speed of a foot over the speed at which its hip sinks."""
    elasticity: float
    """P_fn, m/N."""
    admittance: float
    """V_fn, m/(N s)."""


class Contact(NamedTuple):
    """Spring and damper that hold a sticking foot on elastic ground."""

    friction_stiffness: float
    """Stiffness, N/m."""
    friction_damping: float
    """Damping, N s/m."""


STIFFEST = Contact(10_000.0, 50.0)
"""Largest values, for all but light feet: a quadruped of 2 kg fell on them, and walks with those by rule."""
STIFF_SHARE, DAMPED_SHARE = 0.3, 0.6
"""Largest k T^2 / m_f and c T / m_f of the spring k and the damper c, integrated with the sampling period T."""


class DriveGains(NamedTuple):
    """Gains of drives that close their own loops."""

    drive_stiffness: float
    """K, N m/rad."""
    drive_damping: float
    """D, N m s/rad."""


class Standing(NamedTuple):
    """Linear model of a robot with V degrees of freedom about a posture."""

    inertia: Array
    """(V, V): inertia matrix with the inertias of the rotors, kg m^2 or kg."""
    damping: Array
    """(V, V): damping of the joints, N m s/rad."""
    feet: Array
    """(4, 3, V): Jacobians of the feet along x, y and z of the world, m/rad or 1."""
    moved: Array
    """(4, 3, V): those Jacobians with only the columns of the foot's own leg, m/rad."""
    hips: Array
    """(4, V): Jacobians of the heights of the thigh joints, m/rad or 1."""


def linearise(robot: Robot, posture: Array | None = None) -> Standing:
    """Linearise a robot about a ``posture`` (4, 3), rad; None: about home.

    The damping of the joints is the only damping of the legs; friction is left out.
    """
    mujoco = load_mujoco()
    model = robot.model
    data = robot.at(robot.home if posture is None else posture)
    mujoco.mj_fwdPosition(model, data)
    inertia = np.zeros((model.nv, model.nv))
    for row, unit in zip(inertia, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    feet, moved, hips = np.zeros((3, LEGS, 3, model.nv))
    for i, (dof, geom, thigh) in enumerate(
        zip(robot.legs.dof, robot.legs.foot_geom, robot.legs.joint[:, 1], strict=True)
    ):
        mujoco.mj_jacGeom(model, data, feet[i], None, int(geom))
        mujoco.mj_jac(model, data, hips[i], None, data.xanchor[thigh], robot.legs.base)
        moved[i][:, dof] = feet[i][:, dof]
    return Standing(inertia, np.diag(model.dof_damping), feet, moved, hips[:, 2])


def list_jacobians(robot: Robot, posture: Array | None = None) -> list[tuple[Array, Array]]:
    """Return the joint inertia (3, 3), kg m^2, and the Jacobian (3, 3) of the foot, m/rad, for each leg.

    ``posture`` (4, 3) are the angles of all legs, rad; None: at home.
    """
    standing = linearise(robot, posture)
    return [
        (standing.inertia[np.ix_(dof, dof)], foot[:, dof])
        for dof, foot in zip(robot.legs.dof, standing.feet, strict=True)
    ]


def compute_foot_mass(robot: Robot) -> float:
    """Compute the least effective mass of a foot of the robot at home, kg.

    It is the least eigenvalue, over all legs, of the inertia (J M^-1 J^T)^-1 that a foot shows to a force while the
    trunk is held, with the inertias of the rotors in M (Khatib 1987).
    """
    mobilities = [foot @ np.linalg.solve(inertia, foot.T) for inertia, foot in list_jacobians(robot)]
    return min(1.0 / float(np.linalg.eigvalsh(mobility)[-1]) for mobility in mobilities)


class Sampling(NamedTuple):
    """Period and delays of drives that compute their torques once a command."""

    period: float
    """Time from command to command, s."""
    delay: LoopDelay
    """Delay from a motion of the joint to the torque, in addition to the sampling period."""


def make_sampling(period: float, delay: int, lag: float, latency: float) -> Sampling:
    """Make the sampling of drives that compute once a ``period``, s, from readings that are at least one period old.

    ``delay``, samples, and ``lag``, s, are those of the torque; ``latency``, s, is declared, and above the period
    counts in its place.
    """
    return Sampling(period, add_delays((delay, lag), latency=max(period, latency)))


def derive_drive_gains(robot: Robot, sampling: Sampling | None = None) -> DriveGains:
    """Derive gains of drives with which the body on its legs, at home, has the natural frequency DRIVEN_RATE.

    The gains of drives with a ``sampling`` are lower where they would be unstable.
    """
    vertical = [float(np.linalg.inv(foot @ foot.T)[2, 2]) for _, foot in list_jacobians(robot)]
    stiffness = DRIVEN_RATE**2 * robot.mass / sum(vertical)
    damping = DRIVEN_DECAY * stiffness
    if sampling is not None:
        damping = min(damping, SAMPLED_SHARE * find_critical_damping(robot, sampling))
        stiffness = min(stiffness, damping / (SAMPLED_PERIODS * sampling.period))
    return DriveGains(stiffness, damping)


def find_critical_damping(robot: Robot, sampling: Sampling) -> float:
    """Find the damping, N m s/rad, from which on drives that compute once a command shake the lightest joint at home.

    Friction and stiffness are left out.
    """
    return sampling.delay.find_critical_gain(sampling.period) * _find_least_inertia(robot) / sampling.period


def _find_least_inertia(robot: Robot) -> float:
    """Find the least eigenvalue of the joint inertia of a leg at home, kg m^2."""
    return min(float(np.linalg.eigvalsh(inertia)[0]) for inertia, _ in list_jacobians(robot))


def find_joint_margin(robot: Robot, gains: DriveGains, lag: float) -> Margin:
    """Find the delay margin of the drive of the lightest joint at home, without friction.

    ``lag`` is the time constant of its torque, s.
    """
    return find_drive_margin(_find_least_inertia(robot), *gains, lag)


def derive_contact(basis: Basis, period: float) -> Contact:
    """Derive spring and damper of a sticking foot for a sampling ``period``, s."""
    return Contact(
        min(STIFFEST.friction_stiffness, STIFF_SHARE * basis.foot_mass / period**2),
        min(STIFFEST.friction_damping, DAMPED_SHARE * basis.foot_mass / period),
    )


def choose_feedback(loop_delay: LoopDelay, period: float) -> float:
    """Choose K_av b0 T_s / m_f, the velocity feedback over the one that stops the lightest foot within a sample.

    ``period`` is the sampling period T_s, s.
    """
    return min(MOST_FEEDBACK, STABLE_SHARE * loop_delay.find_critical_gain(period))


def recommend_period(ratio: float, loop_delay: LoopDelay = NO_DELAY, gain: float = 0.0) -> float:
    """Return the longest sampling period, s, with which a robot walks as well as with a shorter one.

    ``ratio`` is m_f/m. Below the lightest feet that were measured the period shrinks with them, to a half, a fifth,
    a tenth and so on. Delayed feedback lowers the gains, which has the effect of lighter feet, and a margin is
    added. A gait that stands on two feet at times needs at least ``gain`` times the largest gains at the first of
    PERIODS. Raises BadInput if lags limit the gains at any period.
    """
    period, least = PERIODS[0]
    divisors = (digits * 10**power for power in range(12) for digits in (2, 5, 10))
    shorter = ((period / divisor, least / divisor) for divisor in divisors)
    margin = MOST_FEEDBACK * (1.0 if loop_delay == NO_DELAY else LATE_MARGIN)
    for period, least in (*reversed(RECOMMENDED), *shorter):
        if choose_feedback(loop_delay, period) < gain * MOST_FEEDBACK * period / PERIODS[0][0]:
            continue
        if ratio * choose_feedback(loop_delay, period) > margin * least:
            return period
    allowed = "none suits feet so light with feedback that late: use controller=drives, or set it and all gains"
    raise BadInput("sampling_period", "by rule", allowed)


def limit_period(robot: Robot) -> float:
    """Return the longest sampling period, s, for joints without rotor inertia or short legs; else infinity."""
    if not robot.armature.any():
        return PERIOD_WITHOUT_ROTORS
    return PERIODS[0][0] if sum(robot.links) < SHORT_LEG else math.inf


def require_period(ratio: float, period: float, loop_delay: LoopDelay = NO_DELAY) -> None:
    """Require a sampling period, s, that suits a robot with m_f/m = ``ratio``; raise BadInput, with one that does."""
    shortest, least = PERIODS[0]
    if period < shortest:
        least *= period / shortest
    else:
        least = next((least for longest, least in PERIODS if period <= longest), math.inf)
    if ratio * choose_feedback(loop_delay, period) / MOST_FEEDBACK <= least:
        late, more = ("", "") if loop_delay == NO_DELAY else (" and feedback is late", ", or take controller=drives")
        light = f"gains by rule fail where a foot feels {ratio:.2g} of the mass of the robot{late}"
        recommended = recommend_period(ratio, loop_delay)
        raise BadInput("sampling_period", period, f"is too long, {light}: use {recommended:g}, or set gains{more}")


def derive_basis(robot: Robot) -> Basis:
    """Derive the quantities that depend on the robot only (measured for this project: docs/robots.md)."""
    stiffness = robot.mass * GRAVITY / LEGS / DEPTH
    return Basis(
        mass=robot.mass,
        foot_mass=compute_foot_mass(robot),
        hip_height=HEIGHT_OF_LINKS * sum(robot.links),
        stiffness=stiffness,
        damping=math.sqrt(stiffness * robot.mass / LEGS) / 4.0,
    )


def derive_gains(basis: Basis, sampling_period: float, lead_gain: float, loop_delay: LoopDelay = NO_DELAY) -> Gains:
    """Derive the gains of a robot for a sampling period, s (measured for this project: docs/robots.md).

    ``lead_gain`` is b0, the gain of the LEAD compensator for the newest error, ``loop_delay`` the delay of velocity
    feedback. Raises BadInput, with a period that works, if the feet are too light for this one.
    """
    require_period(basis.ratio, sampling_period, loop_delay)
    feedback = choose_feedback(loop_delay, sampling_period)
    velocity_gain = feedback * basis.foot_mass / (lead_gain * sampling_period)
    position_gain = velocity_gain / DECAY_TIME
    elasticity = YIELD / position_gain
    return Gains(
        position_gain=position_gain,
        velocity_gain=velocity_gain,
        # All feet together act on the body as a spring of stiffness BODY_RATE^2 m, critically damped.
        posture_gain=max(0.0, BODY_RATE**2 * basis.mass / (LEGS * position_gain) - 1.0),
        posture_rate_gain=max(0.0, 2.0 * BODY_RATE * basis.mass / (LEGS * velocity_gain) - 1.0),
        elasticity=elasticity,
        admittance=DECAY_TIME * elasticity,
    )


def find_delay_margin(
    foot_mass: float, gain: float, lead_gain: float, period: float, loop_delay: LoopDelay
) -> Margin:
    """Find the delay, beyond ``loop_delay``, with which the feedback of the lightest foot, kg, becomes unstable.

    ``gain`` is K_av, N s/m, ``lead_gain`` b0, ``period`` the sampling period, s. Raises BadInput, with a gain that
    works, if the feedback exceeds MOST_SHARE of the critical one.
    """
    feedback = gain * lead_gain * period / foot_mass
    critical = loop_delay.find_critical_gain(period)
    if feedback > MOST_SHARE * critical:
        most = gain * choose_feedback(loop_delay, period) / feedback
        words = f"{feedback / critical:.2g} of what makes the lightest foot unstable, with feedback that late"
        raise BadInput("controller.velocity_gain", gain, f"is {words}; use {most:.4g}, as by rule")
    return loop_delay.find_margin(feedback, period)


def find_standing_margin(
    robot: Robot, ground: tuple[float, float], gains: Gains, lead: Lead, period: float, loop_delay: LoopDelay
) -> Margin:
    """Find the delay, beyond ``loop_delay``, with which the feedback of a robot on four feet becomes unstable.

    The robot is linear about home, its feet stick to ``ground``, K_n in N/m and damping in N s/m in all directions,
    and control is the combined law with posture control, see :mod:`cmacexp.control.hybrid_kernels`; ``period`` is in
    s. Each eigenvalue of the loop gain L(j w), (12, 12), that has magnitude 1 reaches -1 after a delay of its angle
    from -1 over w (generalised Nyquist criterion, MacFarlane & Postlethwaite 1977). The delay is infinite if there
    is none.

    A foot in the air is the other limit, see :func:`find_delay_margin`. The gains decide which one is lower: those
    of the posture grow where those of a foot are small.
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
