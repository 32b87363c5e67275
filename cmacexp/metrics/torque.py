"""Torques: how large they are, and the share of the feedforward."""

from functools import reduce

import numpy as np

from cmacexp.metrics.block import Block
from cmacexp.metrics.measures import divide, largest, mean
from cmacexp.metrics.metric import CONTRACT, LARGE, MEAN, NEITHER, RMS, Metric, MetricDisplay, integral, rmse, worst
from cmacexp.typing import Array, Mask


def _joints(by: np.ufunc, torque: Array) -> Array:
    """All joints of ``torque`` (..., J) as one number; ``by.reduce`` over the last axis takes ten times as long."""
    return reduce(by, np.moveaxis(torque, -1, 0))


def _torque_rms(torque: Array, valid: Mask) -> Array:
    """Square root of the mean square over the joints and over the cycle, N m."""
    return np.sqrt(mean(_joints(np.add, torque**2) / torque.shape[-1], valid))


def energy(block: Block) -> Array:
    """Integral of the absolute power of the joints over the cycle, J."""
    power = _joints(np.add, np.abs(block.torque * block.rate))
    return mean(power, block.valid) * block.valid.sum(axis=-1) * block.rhythm.step


def feedforward_share(block: Block) -> Array:
    """Sum of abs(tau_feedforward) over the sum of abs(tau_feedforward) + abs(tau_feedback), over the cycle."""
    feedforward = mean(_joints(np.add, np.abs(block.feedforward)), block.valid)
    total = feedforward + mean(_joints(np.add, np.abs(block.feedback)), block.valid)
    return divide(feedforward, total)


TORQUE: dict[str, Metric[Block]] = {
    "feedback_rms": rmse(
        "N m",
        "RMS feedback torque, all joints",
        "never",
        lambda b: _torque_rms(b.feedback, b.valid),
        shown=MetricDisplay("feedback torque", "N m", main=False, symbol="T_fb"),
        source=CONTRACT,
    ),
    "feedback_change": rmse(
        "N m",
        "RMS change of the feedback torque from the cycle before, all joints",
        "the first cycle",
        lambda b: _torque_rms(b.feedback_change, b.valid),
    ),
    "feedforward_rms": Metric(
        "N m",
        "RMS feedforward torque, all joints",
        "never",
        lambda b: _torque_rms(b.feedforward, b.valid),
        RMS,
        NEITHER,
        MetricDisplay("feedforward torque", "N m", main=False, symbol="T_ff"),
    ),
    "torque_peak": worst(
        "N m",
        "largest absolute joint torque",
        "never",
        lambda b: largest(_joints(np.maximum, np.abs(b.torque)), b.valid),
        shown=MetricDisplay("peak torque", "N m", main=False, symbol="T_max"),
    ),
    "energy": integral("J", "absolute work of all joints over the cycle", "never", energy, source=CONTRACT),
    "feedforward_share": Metric(
        "",
        "feedforward over feedforward + feedback, absolute torques",
        "no torque in the whole cycle",
        feedforward_share,
        MEAN,
        LARGE,
        MetricDisplay("feedforward share", "%", 100.0, symbol="r_ff"),
    ),
}
