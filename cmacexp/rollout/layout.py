"""What the loop writes down of every step."""

from cmacexp.arrays import Array
from cmacexp.compile import kernel

SAMPLES = (
    "x", "y", "vx", "vy", "q1", "q2", "dq1", "dq2", "force", "force_measured", "x_reference", "y_reference",
    "tau_feedback_1", "tau_feedback_2", "tau_feedforward_1", "tau_feedforward_2",
)  # fmt: skip
"""Columns of the trace that a run gives for every leg; the rest is planned."""

BODY_SAMPLES = ("height", "pitch", "roll", "cog_x", "cog_y", "yaw")
"""Columns of the body that a run gives; the last three are those of the plan unless the plant measures them."""


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
