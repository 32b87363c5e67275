"""Checks that stop a run early: divergence, a fall of the machine, or values of components that are not finite."""

import math
from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.models.body import depth, make_pose
from cmacexp.models.mechanism import POINT_MASS, Mechanism, has_body
from cmacexp.plants.kernels import PlantState
from cmacexp.protocols import Measurement
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import Array, Clock, Status


@kernel
def is_finite(values: Array) -> bool:
    """Return True if all ``values``, of any shape and unit, are finite."""
    for value in values.flat:  # noqa: SIM110  # numba knows no all() of a generator
        if not math.isfinite(value):
            return False
    return True


@kernel
def observes_finite(observation: Observation) -> bool:
    """Return True if all values of an observation are finite."""
    return (
        is_finite(observation.force)
        and is_finite(observation.body)
        and is_finite(observation.body_rate)
        and is_finite(observation.q)
        and is_finite(observation.dq)
        and is_finite(observation.foot)
        and is_finite(observation.velocity)
    )


@kernel
def moves_finite(machine: PlantState) -> bool:
    """Return True if the velocities of body and feet are finite."""
    return is_finite(machine.body_rate) and is_finite(machine.velocity)


RUNNING, DIVERGED, FELL = range(3)
"""Status of the loop after a step: it continues, or stops for one of two reasons."""
STATUSES = {DIVERGED: Status.DIVERGED, FELL: Status.FELL}
"""Status of a run, by the reason of a stop."""

FASTEST_JOINT = 100.0
"""Joint speed above which a run has diverged, rad/s (m/s for a point mass)."""
STEEPEST = 0.5
"""Pitch or roll beyond which a body has fallen, rad."""
LOWEST_HIP = 0.25
"""Hip height above the undepressed ground below which the paper's machine has fallen, m."""
LOWEST_SHARE = 0.5
"""Ratio of hip height to planned height below which a robot has fallen."""
LONGEST_UNSTABLE = 0.25
"""Time without support, or with a negative planned stability margin, after which a body has fallen, s."""


class StopLimits(NamedTuple):
    """Limits at which a run stops, and their counters."""

    mechanism: Mechanism
    margin: Array
    """(N,): planned stability margin over a cycle, m; NaN where there is none."""
    lowest_hip: float
    """Height below which a hip has fallen, m."""
    longest_unstable: int
    """Largest value of the counters, steps."""
    unstable: Clock
    """(2,): consecutive steps with a negative margin, and without any foot on the ground."""


def new_limits(mechanism: Mechanism, margin: Array, sampling_period: float) -> StopLimits:
    """Make the limits of a run, with counters at zero.

    ``margin`` (N,) is the planned stability margin over a cycle, m; ``sampling_period`` is in s.
    """
    lowest_hip = LOWEST_HIP if mechanism.chains is None else LOWEST_SHARE * mechanism.hip_height
    longest_unstable = round(LONGEST_UNSTABLE / sampling_period)
    return StopLimits(mechanism, np.ascontiguousarray(margin), lowest_hip, longest_unstable, np.zeros(2))


@kernel
def has_diverged(mechanism: Mechanism, q: Array, dq: Array, foot: Array) -> bool:
    """Return True if a value is not finite or a joint is faster than FASTEST_JOINT.

    ``q``, rad, ``dq``, rad/s, and the feet ``foot``, m, are of shape (L, J).
    """
    for i in range(q.shape[0]):
        for j in range(len(mechanism.axes)):
            if not (math.isfinite(q[i, j]) and math.isfinite(foot[i, j]) and abs(dq[i, j]) <= FASTEST_JOINT):
                return True
    return False


@kernel
def has_fallen(limits: StopLimits, body: Array) -> bool:
    """Return True if the ``body`` (3,), height in m, pitch and roll in rad, has fallen.

    It has no equilibrium (NaN), is too steep or too low, or was unstable for too long.
    """
    if not (math.isfinite(body[0]) and abs(body[1]) <= STEEPEST and abs(body[2]) <= STEEPEST):
        return True
    hips = limits.mechanism.hips
    pose = make_pose(body)
    for i in range(hips.shape[0]):
        if -depth(pose, hips[i, 0], hips[i, 1], 0.0) < limits.lowest_hip:
            return True
    return limits.unstable[0] > limits.longest_unstable or limits.unstable[1] > limits.longest_unstable


@kernel
def count_unborne(limits: StopLimits, force: Array) -> None:
    """Count consecutive steps in which no foot carries load; ``force`` (L,) is the contact force, N."""
    limits.unstable[1] += 1
    for i in range(force.shape[0]):
        if force[i] > 0.0:
            limits.unstable[1] = 0


@kernel
def stop_reason(limits: StopLimits, sample: int, state: PlantState | Measurement) -> int:
    """Check the state at the start of a step, ``sample`` of its cycle; return RUNNING, DIVERGED or FELL."""
    if has_diverged(limits.mechanism, state.q, state.dq, state.foot):
        return DIVERGED
    if has_body(limits.mechanism):
        limits.unstable[0] = limits.unstable[0] + 1 if limits.margin[sample] < 0.0 else 0
        count_unborne(limits, state.force)
        if has_fallen(limits, state.body):
            return FELL
    return RUNNING if is_finite(state.force) else DIVERGED


def _explain_divergence(limits: StopLimits, q: Array, dq: Array) -> str:
    bad = np.argwhere(~np.isfinite(q) | ~np.isfinite(dq))
    if len(bad):
        return f"joint {bad[0][1] + 1} of leg {bad[0][0] + 1} is not finite"
    leg, joint = np.unravel_index(int(np.argmax(np.abs(dq))), dq.shape)
    speed = abs(dq[leg, joint])
    if speed <= FASTEST_JOINT:
        return "a foot or a contact force is not finite"
    if limits.mechanism.kind == POINT_MASS:
        return f"the point mass moves at {speed:.3g} m/s along {'xy'[joint]}, above {FASTEST_JOINT:g} m/s"
    return f"joint {joint + 1} of leg {leg + 1} moves at {speed:.3g} rad/s, above {FASTEST_JOINT:g} rad/s"


def _explain_fall(limits: StopLimits, body: Array) -> str:
    if not np.isfinite(body[0]):
        return "the body has no static equilibrium"
    for name, angle in (("pitch", body[1]), ("roll", body[2])):
        if abs(angle) > STEEPEST:
            return f"{name} {angle:.3f} rad, beyond {STEEPEST:g} rad"
    pose = make_pose(body)
    heights = [-depth(pose, x, y, 0.0) for x, y in limits.mechanism.hips]
    lowest = int(np.argmin(heights))
    if heights[lowest] < limits.lowest_hip:
        return f"hip of leg {lowest + 1} at {heights[lowest]:.3f} m, below {limits.lowest_hip:g} m"
    if limits.unstable[1] > limits.longest_unstable:
        return f"no foot has borne the body for more than {LONGEST_UNSTABLE:g} s"
    return f"planned stability margin negative for more than {LONGEST_UNSTABLE:g} s"


def describe_stop(
    limits: StopLimits, status: int, step: int, sampling_period: float, state: Measurement, reported: str = ""
) -> str:
    """Describe a stop at the start of ``step``: step, time in s and cause.

    ``status`` is DIVERGED or FELL; a cause that the plant ``reported`` takes precedence over one found in ``state``.
    """
    why = reported or (
        _explain_divergence(limits, state.q, state.dq) if status == DIVERGED else _explain_fall(limits, state.body)
    )
    return f"at step {step} (t = {step * sampling_period:.3f} s): {why}"
