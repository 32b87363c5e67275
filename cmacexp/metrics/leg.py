"""Metrics of a leg per cycle: foot position error, contact force and torques; pure functions of a block of cycles."""

from functools import reduce

import numpy as np

from cmacexp.metrics.block import Block, three_feet
from cmacexp.metrics.measures import divide, integrate, largest, mean, ripple, rms, settling_time
from cmacexp.metrics.metric import (
    CONTRACT,
    LARGE,
    MEAN,
    NEAR_ZERO,
    NEITHER,
    OGATA,
    RMS,
    Metric,
    MetricDisplay,
    integral,
    rmse,
    worst,
)
from cmacexp.typing import Array, Mask

NO_TRANSFER = "no sample of transfer"
NO_SUPPORT = "no sample of support"


def transfer_rmse(axis: str) -> Metric[Block]:
    """Define the metric ``transfer_rmse_*`` of an axis."""
    meaning = f"RMS of {axis} - {axis}_desired in transfer"
    display = MetricDisplay(f"{axis} error", "mm", 1e3, symbol=f"e_{axis}", instead="transfer_rmse")
    return rmse("m", meaning, NO_TRANSFER, lambda b: rms(b.error[axis], b.transfer), shown=display)


def support_rmse(axis: str) -> Metric[Block]:
    """Define the metric ``support_rmse_*`` of an axis."""
    meaning = f"RMS of {axis} - {axis}_desired in support"
    display = MetricDisplay(f"{axis} error in support", "mm", 1e3, main=False, symbol=f"e_{axis}s")
    return rmse("m", meaning, NO_SUPPORT, lambda b: rms(b.error[axis], b.support), shown=display)


TRACKING: dict[str, Metric[Block]] = {
    "transfer_rmse_x": transfer_rmse("x"),
    "transfer_rmse_y": transfer_rmse("y"),
    "support_rmse_x": support_rmse("x"),
}


def joint_rmse(block: Block) -> Array:
    """Compute the RMS error of all joint angles over the cycle, rad; (cycles, L)."""
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


# Contact force: each support is a step response from 0 to the desired force


def force_steady_state_error(block: Block) -> Array:
    """Compute the signed steady-state error of the force, (settled - desired) / desired; (cycles, L)."""
    return divide(block.force_settled - block.desired_settled, block.desired_settled)


def force_overshoot(block: Block) -> Array:
    """Compute the overshoot of the force in support, largest force / desired force - 1; (cycles, L).

    NaN unless the desired force is constant over the second half of support.
    """
    desired = block.desired_settled
    constant = largest(np.abs(block.force_desired - desired[:, :, None]), block.second_half) <= 1e-9 * np.abs(desired)
    pressed = np.where(constant & (desired > 0.0), desired, np.nan)
    return largest(block.force / pressed[..., None], block.support) - 1.0


def force_settling_time(block: Block) -> Array:
    """Compute the settling time of the step response of the force, s; (cycles, L).

    NaN unless support begins and ends within the cycle.
    """
    response = block.since_touch_down, block.force, block.force_settled, block.support
    return block.whole_support * settling_time(*response, block.rhythm.step)


_NO_SECOND_HALF = "no sample of the second half of support"
_NO_PERIOD = f"{NO_SUPPORT}, or one sample in all"
_NOT_WHOLE = "support does not begin and end in the cycle"

FORCE: dict[str, Metric[Block]] = {
    "force_rmse": rmse(
        "N",
        "RMS force error in support",
        NO_SUPPORT,
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
        lambda b: b.force_settled,
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
        lambda b: ripple(b.force, b.second_half),
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
        lambda b: integrate(np.abs(b.force_error), b.support, b.rhythm.step),
    ),
    "force_itae": integral(
        "N s^2",
        "integral of time since touch-down times absolute force error over support",
        _NOT_WHOLE,
        lambda b: b.whole_support * integrate(b.since_touch_down * np.abs(b.force_error), b.support, b.rhythm.step),
        shown=MetricDisplay("ITAE", "N s²", over_legs=False),
    ),
}


# Torques: their size, and the share of the feedforward


def _reduce_joints(by: np.ufunc, torque: Array) -> Array:
    """Reduce ``torque`` (..., J) over the joints with the ufunc ``by``."""
    # by.reduce over the last axis takes ten times as long.
    return reduce(by, np.moveaxis(torque, -1, 0))


def _torque_rms(torque: Array, valid: Mask) -> Array:
    """Compute the RMS torque over all joints and the samples of the cycle, N m; (cycles, L)."""
    return np.sqrt(mean(_reduce_joints(np.add, torque**2) / torque.shape[-1], valid))


def energy(block: Block) -> Array:
    """Integrate the absolute power of all joints over the cycle, J; (cycles, L)."""
    power = _reduce_joints(np.add, np.abs(block.torque * block.rate))
    return mean(power, block.valid) * block.valid.sum(axis=-1) * block.rhythm.step


def feedforward_share(block: Block) -> Array:
    """Compute the share of the feedforward in the absolute torques of a cycle, from 0 to 1; (cycles, L).

    It is the sum of abs(tau_feedforward) divided by the sum of abs(tau_feedforward) + abs(tau_feedback).
    """
    feedforward = mean(_reduce_joints(np.add, np.abs(block.feedforward)), block.valid)
    total = feedforward + mean(_reduce_joints(np.add, np.abs(block.feedback)), block.valid)
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
        lambda b: largest(_reduce_joints(np.maximum, np.abs(b.torque)), b.valid),
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
