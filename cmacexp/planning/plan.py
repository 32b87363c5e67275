"""The plan of a cycle: phases, desired motion and force of every foot, and what the controller is fed."""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.config.machine import QuadrupedMachine
from cmacexp.errors import BadInput
from cmacexp.jit.compiler import program
from cmacexp.models.ground import NEVER, depression_for
from cmacexp.models.leg import inverse_kinematics, joint_acceleration, joint_velocity, trigonometry
from cmacexp.models.mechanism import LEGS_UNDER_BODY, POINT_MASS, Mechanism, leg_of
from cmacexp.planning.body_load import BodyLoad, dynamic_load, static_load
from cmacexp.planning.columns import (
    ACTING,
    AX,
    AY,
    BEFORE,
    DDQ1,
    DDQ2,
    DQ1,
    DQ2,
    FORCE_ADDED,
    FORCE_DESIRED,
    FORCE_REFERENCE,
    Q1,
    Q2,
    REFERENCE_COLUMNS,
    VX,
    VY,
    X,
    Y,
)  # fmt: skip
from cmacexp.planning.crossing import check_crossing
from cmacexp.planning.foot_path import VERTICAL, line, quintic
from cmacexp.planning.gait import Timing, make_timing
from cmacexp.planning.load_sharing import share_load, without_pull
from cmacexp.planning.reach import check_reach
from cmacexp.planning.reference import SUPPORT_REFERENCES, Gains, keeps_static_load
from cmacexp.planning.stability import check_stability, plan_margins
from cmacexp.typing import Array, Mask

LOAD_PASSES = 2
"""Forces press feet in, which moves the masses that load them: each pass comes a thousand times nearer."""


class Plan(NamedTuple):
    """One cycle of N samples for L legs; it repeats. Frames and signs as in the trace."""

    support: Mask
    """(N, L): whether the foot is planned to support."""
    progress: Array
    """(N, L): 0 to 1 within the phase."""
    desired: Array
    """(N, L, 6): motion of where the foot should really be; columns of all arrays in :mod:`columns`."""
    joints: Array
    """(N, L, 6): the same motion in joint angles, rad; of a point mass equal to ``desired``."""
    force_desired: Array
    """(N, L): desired contact force, N."""
    reference: Array
    """(2, N, L, 7): what the controller is fed, per stage."""
    margins: Array
    """(N, 3): stability margin, front and rear margin of a body over its planned support polygon, m; else NaN."""
    start_step: int
    """First step at which the feedforward learns and acts; beyond any run if there is none."""


@program
def plan_joints(mechanism: Mechanism, desired: Array, joints: Array) -> None:
    """Joint angles, velocities and accelerations along ``desired`` (N, L, 6); fills ``joints`` (N, L, 6)."""
    for k in range(desired.shape[0]):
        for i in range(desired.shape[1]):
            x, y, vx, vy, ax, ay = desired[k, i]
            if mechanism.kind == POINT_MASS:
                q1, q2, dq1, dq2, ddq1, ddq2 = x, y, vx, vy, ax, ay
            else:
                leg = leg_of(mechanism, i)
                q1, q2 = inverse_kinematics(leg, x, y)
                trig = trigonometry(q1, q2)
                dq1, dq2 = joint_velocity(leg, trig, vx, vy)
                ddq1, ddq2 = joint_acceleration(leg, trig, dq1, dq2, ax, ay)
            joints[k, i, Q1], joints[k, i, Q2] = q1, q2
            joints[k, i, DQ1], joints[k, i, DQ2] = dq1, dq2
            joints[k, i, DDQ1], joints[k, i, DDQ2] = ddq1, ddq2


def _horizontal(config: Config, timing: Timing) -> Array:
    """Desired x, vx, ax (N, L, 3) of every foot in the frame of its hip."""
    support_time = timing.support_samples * config.sampling_period
    transfer_time = timing.transfer_samples * config.sampling_period
    front, rear = config.gait.stroke / 2.0, -config.gait.stroke / 2.0
    motion = np.zeros((*timing.support.shape, 3))
    support, progress = timing.support, timing.progress
    motion[support] = np.stack(line(front, rear, progress[support], support_time), axis=1)
    if timing.transfer_samples:
        path = quintic(rear, front, (rear - front) / support_time, progress[~support], transfer_time)
        motion[~support] = np.stack(path, axis=1)
    return motion


def _desired_force(config: Config, timing: Timing, feet: Array, load: BodyLoad) -> tuple[Array, Array]:
    """Desired force (N, L), N, and its rate, N/s; a foot takes it by a ramp if the gait has one.

    One leg presses with F_d; under a body the feet (N, L, 2) share the load.
    """
    elapsed, ramp = timing.sample * config.sampling_period, config.gait.load_ramp
    rising = timing.support & (elapsed < ramp)
    willing = np.where(timing.support, np.where(rising, elapsed / ramp if ramp else 1.0, 1.0), 0.0)
    force = config.force_control.desired_force
    if force is None:
        # The rate matters for the path of a soft foot only: the depression of a quadruped's is a few mm.
        shared = share_load(load.force, feet - load.centre[:, None, :], timing.support, willing)
        if config.force_control.load_sharing == "dynamic":
            # A swinging leg may move the load out of the three feet that are down, by little and not for long.
            shared = without_pull(shared)
        return shared, np.zeros_like(willing)
    return force * willing, np.where(rising, force / ramp if ramp else 0.0, 0.0)


def _desired_motion(config: Config, timing: Timing, hip_height: float, force: Array, rate: Array) -> Array:
    """Desired motion (N, L, 6) of every foot; in support at the depression that gives the desired force."""
    gait, stiffness = config.gait, config.assumed_stiffness
    transfer_time = timing.transfer_samples * config.sampling_period
    desired = np.zeros((*timing.support.shape, 6))
    desired[..., [X, VX, AX]] = _horizontal(config, timing)
    for i in range(timing.support.shape[1]):
        support, s = timing.support[:, i], timing.progress[:, i]
        desired[support, i, Y] = hip_height + depression_for(stiffness, force[support, i])
        desired[support, i, VY] = depression_for(stiffness, rate[support, i])
        if timing.transfer_samples:
            s = s[~support]
            first, last = timing.sample[:, i] == 0, timing.sample[:, i] == timing.support_samples - 1
            take_off, touch_down = desired[support & last, i, Y][0], desired[support & first, i, Y][0]
            check_apex(config, touch_down - take_off)
            vertical = VERTICAL[gait.vertical](take_off, touch_down, gait.lift, s, transfer_time)
            for column, values in zip((Y, VY, AY), vertical, strict=True):
                desired[~support, i, column] = values
    return desired


def check_apex(config: Config, gap: float) -> None:
    """Hold the lift of a single cubic to what keeps its only extreme at mid transfer.

    Args:
        config: of the run.
        gap: of the touch-down below the take-off point, m; not 0 where the foot presses differently at both.

    Raises:
        BadInput: the cubic would go through the ground instead.
    """
    gait = config.gait
    if gait.vertical == "cubic" and abs(gap) > 1e-12 and gait.lift < 1.25 * abs(gap):
        raise BadInput(
            "gait.lift",
            gait.lift,
            f"must be at least {1.25 * abs(gap):.6g} m for one cubic between ends {abs(gap):.3g} m apart in height; "
            "or take gait.vertical=two_cubics",
        )


def _reference(config: Config, timing: Timing, hip_height: float, desired: Array, force: Array) -> Array:
    """What the controller is fed, (2, N, L, 7): the desired motion in transfer, the force laws in support.

    A controller without K_ap and K_av gets the laws without their terms in 1/K_a and K_av/K_ap.
    """
    method = config.force_control
    gains = Gains(
        *(config.gains or (math.inf, 0.0)),
        method.force_gain,
        method.elasticity,
        method.admittance,
        config.assumed_stiffness,
    )
    reference = np.zeros((2, *force.shape, REFERENCE_COLUMNS))
    copied = [X, Y, VX, VY]
    reference[..., copied], reference[..., FORCE_DESIRED] = desired[..., copied], force
    support = timing.support
    for stage in (BEFORE, ACTING):
        keeps = config.gains is not None and keeps_static_load(config.reference, stage == ACTING)
        law = SUPPORT_REFERENCES[method.method](gains, keeps)
        reference[stage, support, Y] = hip_height + law.depression * force[support]
        reference[stage, support, VY] = law.velocity * force[support]
        reference[stage, support, FORCE_REFERENCE] = law.force * force[support]
        if config.reference == "force_feedforward":
            reference[stage, support, FORCE_ADDED] = force[support]
    return reference


def _motion_under(
    config: Config, mechanism: Mechanism, timing: Timing, feet: Array, load: BodyLoad
) -> tuple[Array, Array, Array]:
    """Desired motion (N, L, 6) of feet that share a load, the same in joint angles, and desired forces (N, L)."""
    force, rate = _desired_force(config, timing, feet, load)
    desired = _desired_motion(config, timing, mechanism.hip_height, force, rate)
    joints = np.empty_like(desired)
    if mechanism.kind != POINT_MASS:
        check_reach(config, mechanism, desired)
    plan_joints(mechanism, desired, joints)
    return desired, joints, force


def make_plan(config: Config, mechanism: Mechanism, feedforward_acts: bool) -> Plan:
    """Plan one cycle.

    Args:
        config: a checked config.
        mechanism: the machine.
        feedforward_acts: False for feedback alone, whose references never leave their first stage.

    Raises:
        BadInput: a foot path leaves the reach of its leg, legs would cross, or the gait is not statically stable.
    """
    timing = make_timing(config.gait, config.steps_per_cycle)
    feet = np.zeros((*timing.support.shape, 2))
    feet[..., X] = _horizontal(config, timing)[..., 0]
    feet += mechanism.hips
    margins = plan_margins(mechanism, feet, timing.support)
    if mechanism.kind == LEGS_UNDER_BODY:
        check_stability(config, timing.support, margins)
    load = static_load(mechanism.weight, len(feet))
    desired, joints, force = _motion_under(config, mechanism, timing, feet, load)
    if isinstance(config.machine, QuadrupedMachine) and config.force_control.load_sharing == "dynamic":
        for _ in range(LOAD_PASSES):
            load = dynamic_load(mechanism, config.machine.body_mass, desired, joints)
            desired, joints, force = _motion_under(config, mechanism, timing, feet, load)
    if mechanism.kind == LEGS_UNDER_BODY:
        check_crossing(config, mechanism, joints)
    return Plan(
        timing.support,
        timing.progress,
        desired,
        joints,
        force,
        _reference(config, timing, mechanism.hip_height, desired, force),
        margins,
        (config.learning.start_cycle - 1) * config.steps_per_cycle if feedforward_acts else NEVER,
    )
