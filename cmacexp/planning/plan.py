"""The plan of a cycle: phases, desired motion and force of every foot, and the reference of the controller."""

from typing import NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.config.machine import QuadrupedMachine, RobotMachine
from cmacexp.models.ground import NEVER
from cmacexp.models.mechanism import LEGS_UNDER_BODY, POINT_MASS, SPACE, Mechanism, has_body
from cmacexp.planning.body_load import BodyLoad, dynamic_load, static_load
from cmacexp.planning.columns import MOTION_COLUMNS, VX, VY, X, Y, Z
from cmacexp.planning.crossing import check_crossing
from cmacexp.planning.gait import Timing, make_timing
from cmacexp.planning.motion import plan_force, plan_horizontal, plan_joints, plan_motion
from cmacexp.planning.reach import check_reach
from cmacexp.planning.reference import plan_reference
from cmacexp.planning.robot import plan_robot
from cmacexp.planning.robot_dynamics import compute_load
from cmacexp.planning.stability import check_stability, margins
from cmacexp.typing import Array, Mask

LOAD_PASSES = 2
"""Forces depress the feet, which moves the masses that cause them: one pass reduces the error a thousandfold."""
LEAST_LOAD = 0.1
"""Share of the planned load that the feet always share."""


class Plan(NamedTuple):
    """One cycle of N samples for L legs; it repeats. Frames and signs as in the trace."""

    support: Mask
    """(N, L): whether the foot is planned to support."""
    progress: Array
    """(N, L): 0 to 1 within the phase."""
    desired: Array
    """(N, L, 6), of a robot (N, L, 9): desired motion of the foot; columns as in :mod:`cmacexp.planning.columns`."""
    joints: Array
    """The same motion in joint angles, rad; of a point mass equal to ``desired``."""
    force_desired: Array
    """(N, L): desired contact force, N."""
    reference: Array
    """(2, N, L, columns): reference of the controller, per stage."""
    load: BodyLoad
    """What the feet of a body share."""
    margins: Array
    """(N, 3): stability margin, front and rear margin of a body over its planned support polygon, m; else NaN."""
    start_step: int
    """First step at which the feedforward learns and acts; beyond any run if there is none."""


class Met(NamedTuple):
    """What a body met in a cycle that its plan did not know."""

    weight: float
    """That its feet carried beyond the planned one, N."""
    x: float
    """How far forward of where the plan has it the centre of the load was, m."""
    y: float
    """To the left."""
    slope_x: float
    """Rise of the ground forward, m/m."""
    slope_y: float
    """To the left."""


NOTHING = Met(0.0, 0.0, 0.0, 0.0, 0.0)


def _plan_under_load(
    config: Config, mechanism: Mechanism, timing: Timing, feet: Array, load: BodyLoad, met: Met = NOTHING
) -> tuple[Array, Array, Array]:
    """Desired motion (N, L, columns) of feet that share a load, the same of joints, and desired forces (N, L)."""
    force, rate = plan_force(config, timing, feet, load)
    desired = plan_motion(config, timing, mechanism, force, rate)
    desired[..., X] += met.x
    if desired.shape[2] > MOTION_COLUMNS[2]:
        desired[..., Z] += met.y
    desired[..., Y] -= met.slope_x * feet[..., 0] + met.slope_y * feet[..., 1]
    desired[..., VY] -= met.slope_x * desired[..., VX]
    joints = np.empty_like(desired)
    if isinstance(config.machine, RobotMachine):
        plan_robot(config, config.machine, mechanism, desired, joints)
        return desired, joints, force
    if mechanism.kind != POINT_MASS:
        check_reach(config, mechanism, desired)
    plan_joints(mechanism, desired, joints)
    return desired, joints, force


def _moving_load(config: Config, mechanism: Mechanism, desired: Array, joints: Array) -> BodyLoad:
    """Gravity and inertia of all masses of a machine with a body along its planned motion."""
    if isinstance(config.machine, RobotMachine):
        return compute_load(config, joints)
    assert isinstance(config.machine, QuadrupedMachine)
    return dynamic_load(mechanism, config.machine.body_mass, desired, joints)


def _plan_feet(config: Config, mechanism: Mechanism, timing: Timing) -> Array:
    """Places (N, L, 2) of the feet, forward and left of the body's centre, m."""
    feet = np.zeros((*timing.support.shape, 2))
    feet[..., X] = plan_horizontal(config, timing)[..., 0]
    return feet + mechanism.hips


def make_plan(config: Config, mechanism: Mechanism, feedforward_acts: bool) -> Plan:
    """Plan one cycle.

    Args:
        config: a checked config.
        mechanism: the machine.
        feedforward_acts: False for feedback alone, which stays in the stage BEFORE.

    Raises:
        BadInput: a foot path leaves the reach of its leg, legs would cross, or the gait is not statically stable.
    """
    timing = make_timing(config.gait, config.steps_per_cycle)
    feet = _plan_feet(config, mechanism, timing)
    planned_margins = margins(feet, timing.support)
    if has_body(mechanism):
        check_stability(config, timing.support, planned_margins)
    load = static_load(mechanism.weight, len(feet))
    desired, joints, force = _plan_under_load(config, mechanism, timing, feet, load)
    if config.force_control.load_sharing != "static":
        for _ in range(LOAD_PASSES):
            load = _moving_load(config, mechanism, desired, joints)
            desired, joints, force = _plan_under_load(config, mechanism, timing, feet, load)
    if mechanism.kind == LEGS_UNDER_BODY:
        check_crossing(config, mechanism, joints)
    return Plan(
        timing.support,
        timing.progress,
        desired,
        joints,
        force,
        plan_reference(config, timing.support, mechanism.hip_height, desired, force),
        load,
        planned_margins,
        (config.learning.start_cycle - 1) * config.steps_per_cycle if feedforward_acts else NEVER,
    )


def adapt_plan(config: Config, mechanism: Mechanism, plan: Plan, met: Met) -> Plan:
    """The plan of a body that carries and meets what it ``met``, with the same steps; its feet follow the load.

    Args:
        config: of the run.
        mechanism: the machine.
        plan: that knows of nothing met.
        met: beyond it.

    Raises:
        BadInput: a foot path leaves the reach of its leg.
    """
    timing = make_timing(config.gait, config.steps_per_cycle)
    feet, shift = _plan_feet(config, mechanism, timing), np.array([met.x, met.y])
    weight = np.maximum(plan.load.force + met.weight, LEAST_LOAD * plan.load.force)
    added = weight.mean() * (plan.load.mean_centre + shift) - plan.load.force.mean() * plan.load.mean_centre
    moment = plan.load.force[:, None] * plan.load.centre + added
    load = BodyLoad(weight, moment / weight[:, None])
    feet += shift if mechanism.shape[1] == len(SPACE) else [met.x, 0.0]
    desired, joints, force = _plan_under_load(config, mechanism, timing, feet, load, met)
    reference = plan_reference(config, plan.support, mechanism.hip_height, desired, force)
    rise = met.slope_x * feet[..., 0] + met.slope_y * feet[..., 1]
    reference[:, plan.support, Y] -= rise[plan.support]
    reference[:, plan.support, VY] -= met.slope_x * desired[plan.support, VX]
    return plan._replace(desired=desired, joints=joints, force_desired=force, reference=reference)
