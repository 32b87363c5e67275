"""What the loop writes down of every step and leg, and why it stops."""

import math

import numpy as np

from cmacexp.arrays import Array
from cmacexp.compile import kernel

SAMPLES = (
    "x", "y", "vx", "vy", "q1", "q2", "dq1", "dq2", "force", "force_measured", "x_reference", "y_reference",
    "tau_feedback_1", "tau_feedback_2", "tau_feedforward_1", "tau_feedforward_2",
)  # fmt: skip
"""Columns of the trace that a run gives; the rest is planned."""

RUNNING, DIVERGED = range(2)

FASTEST_JOINT = 100.0
"""A joint faster than this has diverged, rad/s (m/s for a point mass)."""


@kernel
def write_samples(
    samples: Array,
    k: int,
    foot: Array,
    velocity: Array,
    q: Array,
    dq: Array,
    force: Array,
    force_measured: Array,
    reference: Array,
    feedback: Array,
    feedforward: Array,
) -> None:
    """Fill ``samples[k]`` (L, columns) in the order of SAMPLES.

    Forces are (L,), ``reference`` is (L, 6), a row of the plan; the rest is (L, 2).
    """
    for i in range(force.shape[0]):
        for j in range(2):
            samples[k, i, j] = foot[i, j]
            samples[k, i, 2 + j] = velocity[i, j]
            samples[k, i, 4 + j] = q[i, j]
            samples[k, i, 6 + j] = dq[i, j]
            samples[k, i, 10 + j] = reference[i, j]
            samples[k, i, 12 + j] = feedback[i, j]
            samples[k, i, 14 + j] = feedforward[i, j]
        samples[k, i, 8] = force[i]
        samples[k, i, 9] = force_measured[i]


@kernel
def stop_reason(q: Array, dq: Array, foot: Array, force: Array) -> int:
    """DIVERGED if a value is not finite or a joint is too fast, else RUNNING."""
    for i in range(q.shape[0]):
        finite = math.isfinite(force[i])
        for j in range(2):
            finite = finite and math.isfinite(q[i, j]) and math.isfinite(foot[i, j])
            if not abs(dq[i, j]) <= FASTEST_JOINT:
                return DIVERGED
        if not finite:
            return DIVERGED
    return RUNNING


def describe_stop(step: int, sampling_period: float, q: Array, dq: Array) -> str:
    """Step, time and cause of a divergence, in words; ``q`` and ``dq`` (L, 2) are the state it was seen in."""
    when = f"at step {step} (t = {step * sampling_period:.3f} s)"
    bad = np.argwhere(~np.isfinite(q) | ~np.isfinite(dq))
    if len(bad):
        return f"{when}: joint {bad[0][1] + 1} of leg {bad[0][0] + 1} is not finite"
    leg, joint = np.unravel_index(int(np.argmax(np.abs(dq))), dq.shape)
    speed = abs(dq[leg, joint])
    return f"{when}: joint {joint + 1} of leg {leg + 1} moves at {speed:.3g} rad/s, above {FASTEST_JOINT:g} rad/s"
