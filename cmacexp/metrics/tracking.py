"""Position errors of the foot, of a robot also across the machine and of the joints."""

import numpy as np

from cmacexp.metrics.block import Block
from cmacexp.metrics.measures import mean, rms
from cmacexp.metrics.metric import Metric, MetricDisplay, rmse
from cmacexp.typing import Array

NO_TRANSFER, NO_SUPPORT = "no sample of transfer", "no sample of support"


def transfer_rmse(axis: str) -> Metric[Block]:
    """The column ``transfer_rmse_*`` of an axis."""
    meaning = f"RMS of {axis} - {axis}_desired in transfer"
    shown = MetricDisplay(f"{axis} error", "mm", 1e3, symbol=f"e_{axis}", instead="transfer_rmse")
    return rmse("m", meaning, NO_TRANSFER, lambda b: rms(b.error[axis], b.transfer), shown=shown)


def support_rmse(axis: str) -> Metric[Block]:
    """The column ``support_rmse_*`` of an axis."""
    meaning = f"RMS of {axis} - {axis}_desired in support"
    shown = MetricDisplay(f"{axis} error in support", "mm", 1e3, main=False, symbol=f"e_{axis}s")
    return rmse("m", meaning, NO_SUPPORT, lambda b: rms(b.error[axis], b.support), shown=shown)


TRACKING: dict[str, Metric[Block]] = {
    "transfer_rmse_x": transfer_rmse("x"),
    "transfer_rmse_y": transfer_rmse("y"),
    "support_rmse_x": support_rmse("x"),
}


def joint_rmse(block: Block) -> Array:
    """Root mean square error of all joints over the cycle, rad."""
    assert block.joint_error is not None
    return np.sqrt(mean((block.joint_error**2).mean(axis=-1), block.valid))


SPATIAL: dict[str, Metric[Block]] = {
    "transfer_rmse_z": transfer_rmse("z"),
    "transfer_rmse": rmse(
        "m",
        "RMS distance of the foot from where it should be in transfer",
        NO_TRANSFER,
        lambda b: np.sqrt(mean(b.error["x"] ** 2 + b.error["y"] ** 2 + b.error["z"] ** 2, b.transfer)),
        shown=MetricDisplay("foot error", "mm", 1e3, symbol="e_foot"),
    ),
    "support_rmse_z": support_rmse("z"),
    "joint_rmse": rmse(
        "rad",
        "RMS of q - q_desired, all joints",
        "never",
        joint_rmse,
        shown=MetricDisplay("joint error", "mrad", 1e3, symbol="e_q"),
    ),
}
