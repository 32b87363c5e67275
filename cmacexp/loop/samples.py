"""What the loop writes down of every step."""

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.plants.protocol import Measurement
from cmacexp.sensors.kernels import Seen
from cmacexp.typing import Array

SAMPLES = (
    "x", "y", "vx", "vy", "q1", "q2", "dq1", "dq2", "force", "force_measured", "x_reference", "y_reference",
    "tau_feedback_1", "tau_feedback_2", "tau_feedforward_1", "tau_feedforward_2",
)  # fmt: skip
"""Columns of the trace that a run gives for every leg; the rest is planned."""

POSE, TRAVEL = ("height", "pitch", "roll"), ("cog_x", "cog_y", "yaw")
BODY_SAMPLES = (*POSE, *TRAVEL)
"""Columns of the body that a run gives; the last three are those of the plan unless the plant measures them."""
GONE = slice(len(POSE), len(BODY_SAMPLES))
"""Those three."""

MEASURED = ("x", "y", "vx", "vy", "q1", "q2", "dq1", "dq2")
"""Columns that follow SAMPLES, as ``x_measured``, where sensors alter something; the force has its own always."""

TRUSTED = "force_trusted"
"""Follows MEASURED: whether the controller goes by the force sensor."""

RATES = ("height_rate", "pitch_rate", "roll_rate")
BODY_MEASURED = (*POSE, *RATES)
"""Likewise of the body, after BODY_SAMPLES and RATES."""


def names_of(samples: Array) -> tuple[str, ...]:
    """Names of the columns of leg samples (steps, L, columns)."""
    return (*SAMPLES, *(f"{name}_measured" for name in MEASURED), TRUSTED)[: samples.shape[2]]


def body_names_of(samples: Array) -> tuple[str, ...]:
    """Names of the columns of body samples (steps, columns)."""
    return (*BODY_SAMPLES, *RATES, *(f"{name}_measured" for name in BODY_MEASURED))[: samples.shape[1]]


def room_for(steps: int, legs: int, measured: bool) -> tuple[Array, Array]:
    """Room for the samples of legs and body, with or without what is measured of them."""
    return (
        np.zeros((steps, legs, len(SAMPLES) + (len(MEASURED) + 1 if measured else 0))),
        np.zeros((steps, len(BODY_SAMPLES) + (len(RATES) + len(BODY_MEASURED) if measured else 0))),
    )


@kernel
def write_samples(
    samples: Array,
    body_samples: Array,
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
    body: Array,
) -> None:
    """Fill ``samples[k]`` (L, columns) and the pose in ``body_samples[k]``, in the order of SAMPLES and BODY_SAMPLES.

    Forces are (L,), ``body`` is (3,), ``reference`` begins with x and y, the rest is (L, 2).
    """
    for n in range(3):
        body_samples[k, n] = body[n]
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
def has_measured(samples: Array) -> bool:
    """Whether leg samples have room for what sensors made of them."""
    return samples.shape[2] > len(SAMPLES)


@kernel
def write_measured(
    samples: Array, body_samples: Array, k: int, seen: Seen | Measurement, body_rate: Array, trusted: Array
) -> None:
    """Fill the rest of ``samples[k]`` and ``body_samples[k]`` with what was ``seen``.

    ``body_rate`` (3,) is true; ``trusted`` (L,) tells which force sensors the controller goes by.
    """
    first, after = len(SAMPLES), len(BODY_SAMPLES)
    for i in range(seen.force.shape[0]):
        for j in range(2):
            samples[k, i, first + j] = seen.foot[i, j]
            samples[k, i, first + 2 + j] = seen.velocity[i, j]
            samples[k, i, first + 4 + j] = seen.q[i, j]
            samples[k, i, first + 6 + j] = seen.dq[i, j]
        samples[k, i, first + 8] = trusted[i]
    for n in range(3):
        body_samples[k, after + n] = body_rate[n]
        body_samples[k, after + 3 + n] = seen.body[n]
        body_samples[k, after + 6 + n] = seen.body_rate[n]
