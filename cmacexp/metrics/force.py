"""Contact force; a support is the response to a step from no force to the desired one."""

import numpy as np

from cmacexp.metrics import measures
from cmacexp.metrics.block import Block, three_feet
from cmacexp.metrics.measures import divide, iae, largest, mean, rms
from cmacexp.metrics.metric import (
    CONTRACT,
    MEAN,
    NEAR_ZERO,
    NEITHER,
    OGATA,
    Metric,
    MetricDisplay,
    integral,
    rmse,
    worst,
)
from cmacexp.typing import Array


def force_settled(block: Block) -> Array:
    """Mean force over the second half of support, N."""
    return mean(block.force, block.second_half)


def desired_settled(block: Block) -> Array:
    """Mean desired force over the second half of support, N."""
    return mean(block.force_desired, block.second_half)


def force_steady_state_error(block: Block) -> Array:
    """(settled - desired) / desired, signed."""
    desired = desired_settled(block)
    return divide(force_settled(block) - desired, desired)


def force_overshoot(block: Block) -> Array:
    """Largest force over desired - 1 over support; NaN unless the desired force is constant in the second half."""
    desired = desired_settled(block)
    constant = largest(np.abs(block.force_desired - desired[:, :, None]), block.second_half) <= 1e-9 * np.abs(desired)
    pressed = np.where(constant & (desired > 0.0), desired, np.nan)
    return largest(block.force / pressed[..., None], block.support) - 1.0


def force_settling_time(block: Block) -> Array:
    """Settling time of the step response of the force, s; NaN unless a support begins and ends within its cycle."""
    response = block.since_touch_down, block.force, force_settled(block), block.support
    return block.whole_support * measures.settling_time(*response, block.rhythm.step)


_NO_SUPPORT, _NO_SECOND_HALF = "no sample of support", "no sample of the second half of support"
_NO_PERIOD = f"{_NO_SUPPORT}, or one sample in all"
_NOT_WHOLE = "support does not begin and end in the cycle"

FORCE: dict[str, Metric[Block]] = {
    "force_rmse": rmse(
        "N",
        "RMS force error in support",
        _NO_SUPPORT,
        lambda b: rms(b.force_error, b.support),
        shown=MetricDisplay("force error", "N", symbol="e_F"),
    ),
    "force_rmse_cycle": rmse("N", "RMS force error, all samples", "never", lambda b: rms(b.force_error, b.valid)),
    "force_rmse_three_feet": rmse(
        "N",
        "RMS force error over the middle half of each planned three-foot interval",
        "never three feet down (one leg)",
        lambda b: rms(b.force_error, three_feet(b)),
        shown=MetricDisplay("error on three feet", "N", symbol="e_F3"),
        source=CONTRACT,
    ),
    "force_settled": Metric(
        "N",
        "mean force over the second half of support",
        _NO_SECOND_HALF,
        force_settled,
        MEAN,
        NEITHER,
        MetricDisplay("settled force", "N", over_legs=False, symbol="F_s"),
    ),
    "force_steady_state_error": Metric(
        "",
        "(force_settled - desired)/desired, signed",
        f"{_NO_SECOND_HALF}, or desired force 0",
        force_steady_state_error,
        MEAN,
        NEAR_ZERO,
        MetricDisplay("steady error", "%", 100.0, over_legs=False, symbol="e_ss"),
    ),
    "force_overshoot": worst(
        "",
        "max force/desired - 1 over support",
        "desired force not constant over the second half of support, or 0",
        force_overshoot,
        shown=MetricDisplay("overshoot", "%", 100.0, over_legs=False, symbol="M_p"),
        source=f"{OGATA}, of the desired force",
    ),
    "force_ripple": rmse(
        "N",
        "standard deviation of force over the second half of support",
        _NO_SECOND_HALF,
        lambda b: measures.ripple(b.force, b.second_half),
        shown=MetricDisplay("force ripple", "N", main=False, symbol="s_F"),
        source=CONTRACT,
    ),
    "force_settling_time": worst(
        "s",
        "from touch-down to within 2 % of force_settled",
        f"never settles, settles at 0, or {_NOT_WHOLE}",
        force_settling_time,
        shown=MetricDisplay("settling time", "s", over_legs=False, symbol="t_s"),
        source=OGATA,
    ),
    "force_iae": integral(
        "N s",
        "integral of the absolute force error over support",
        _NO_PERIOD,
        lambda b: iae(b.force_error, b.support, b.rhythm.step),
    ),
    "force_itae": integral(
        "N s^2",
        "integral of time since touch-down times absolute force error over support",
        _NOT_WHOLE,
        lambda b: b.whole_support * measures.itae(b.since_touch_down, b.force_error, b.support, b.rhythm.step),
        shown=MetricDisplay("ITAE", "N s²", over_legs=False),
    ),
}
