"""Who does the work, and how hard."""

import numpy as np

from cmacexp.arrays import Array, Mask
from cmacexp.metrics.block import Block
from cmacexp.metrics.measures import largest, mean
from cmacexp.metrics.metric import BRISTOW, CONTRACT, Metric


def _torque_rms(torque: Array, valid: Mask) -> Array:
    """Root mean square over both joints and the cycle, N m."""
    return np.sqrt(mean((torque**2).mean(axis=3), valid))


def torque_peak(block: Block) -> Array:
    """Largest absolute joint torque, N m."""
    return largest(np.abs(block.feedback + block.feedforward).max(axis=3), block.valid)


def feedforward_share(block: Block) -> Array:
    """Sum of abs(tau_feedforward) over the sum of abs(tau_feedforward) + abs(tau_feedback), over the cycle."""
    feedforward = mean(np.abs(block.feedforward).sum(axis=3), block.valid)
    total = feedforward + mean(np.abs(block.feedback).sum(axis=3), block.valid)
    return feedforward / np.where(total == 0.0, np.nan, total)


TORQUE: dict[str, Metric[Block]] = {
    "feedback_rms": Metric(
        "N m", "RMS feedback torque, both joints", "never", CONTRACT, lambda b: _torque_rms(b.feedback, b.valid)
    ),
    "feedback_change": Metric(
        "N m",
        "RMS change of the feedback torque from the cycle before, both joints",
        "the first cycle",
        BRISTOW,
        lambda b: _torque_rms(b.feedback_change, b.valid),
    ),
    "feedforward_rms": Metric(
        "N m", "RMS feedforward torque, both joints", "never", CONTRACT, lambda b: _torque_rms(b.feedforward, b.valid)
    ),
    "torque_peak": Metric("N m", "largest absolute joint torque", "never", CONTRACT, torque_peak),
    "feedforward_peak": Metric(
        "N m",
        "largest absolute feedforward torque",
        "never",
        CONTRACT,
        lambda b: largest(np.abs(b.feedforward).max(axis=3), b.valid),
    ),
    "feedforward_share": Metric(
        "",
        "feedforward over feedforward + feedback, absolute torques",
        "no torque in the whole cycle",
        CONTRACT,
        feedforward_share,
    ),
}
"""Columns about torque, by name."""
