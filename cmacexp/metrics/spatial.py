"""Errors that only legs which move in space have: across the machine, in all three axes, and of the joints."""

import numpy as np

from cmacexp.metrics.block import Block
from cmacexp.metrics.measures import mean
from cmacexp.metrics.metric import Metric, Shown, rms_error
from cmacexp.metrics.tracking import NO_TRANSFER, support_rmse, transfer_rmse
from cmacexp.typing import Array


def foot_rmse(block: Block) -> Array:
    """Root mean square distance of the foot from where it should be in transfer, m."""
    x, y, z = (block.error[axis] for axis in "xyz")
    return np.sqrt(mean(x**2 + y**2 + z**2, block.transfer))


def joint_rmse(block: Block) -> Array:
    """Root mean square error of all joints over the cycle, rad."""
    assert block.joint_error is not None
    return np.sqrt(mean((block.joint_error**2).mean(axis=-1), block.valid))


SPATIAL: dict[str, Metric[Block]] = {
    "transfer_rmse_z": transfer_rmse("z"),
    "transfer_rmse": rms_error(
        "m",
        "RMS distance of the foot from where it should be in transfer",
        NO_TRANSFER,
        foot_rmse,
        shown=Shown("transfer", "mm", 1e3, head="foot\nerror"),
    ),
    "support_rmse_z": support_rmse("z"),
    "joint_rmse": rms_error(
        "rad",
        "RMS of q - q_desired, all joints",
        "never",
        joint_rmse,
        shown=Shown("joints", "mrad", 1e3, head="joint\nerror"),
    ),
}
"""Columns of a robot alone, by name."""
