"""How far the foot is from where it should be."""

from cmacexp.metrics.block import Block
from cmacexp.metrics.measures import iae, ise, rms
from cmacexp.metrics.metric import BRISTOW, GRAHAM_LATHROP, Metric, Shown, integral, rms_error

_NO_TRANSFER, _NO_SUPPORT = "no sample of transfer", "no sample of support"
_NO_PERIOD = f"{_NO_TRANSFER}, or one sample in all"

TRACKING: dict[str, Metric[Block]] = {
    "transfer_rmse_x": rms_error(
        "m",
        "RMS of x - x_desired in transfer",
        _NO_TRANSFER,
        BRISTOW,
        lambda b: rms(b.error_x, b.transfer),
        shown=Shown("transfer x", "mm", 1e3),
    ),
    "transfer_rmse_y": rms_error(
        "m",
        "RMS of y - y_desired in transfer",
        _NO_TRANSFER,
        BRISTOW,
        lambda b: rms(b.error_y, b.transfer),
        shown=Shown("transfer y", "mm", 1e3),
    ),
    "support_rmse_x": rms_error(
        "m",
        "RMS of x - x_desired in support",
        _NO_SUPPORT,
        BRISTOW,
        lambda b: rms(b.error_x, b.support),
        shown=Shown("support x", "mm", 1e3, main=False),
    ),
    "transfer_iae_x": integral(
        "m s",
        "integral of abs(x - x_desired) over transfer",
        _NO_PERIOD,
        GRAHAM_LATHROP,
        lambda b: iae(b.error_x, b.transfer, b.rhythm.step),
    ),
    "transfer_iae_y": integral(
        "m s",
        "integral of abs(y - y_desired) over transfer",
        _NO_PERIOD,
        GRAHAM_LATHROP,
        lambda b: iae(b.error_y, b.transfer, b.rhythm.step),
    ),
    "transfer_ise_x": integral(
        "m^2 s",
        "integral of (x - x_desired)^2 over transfer",
        _NO_PERIOD,
        GRAHAM_LATHROP,
        lambda b: ise(b.error_x, b.transfer, b.rhythm.step),
    ),
    "transfer_ise_y": integral(
        "m^2 s",
        "integral of (y - y_desired)^2 over transfer",
        _NO_PERIOD,
        GRAHAM_LATHROP,
        lambda b: ise(b.error_y, b.transfer, b.rhythm.step),
    ),
}
"""Columns about position, by name."""
