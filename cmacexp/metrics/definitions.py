"""What is measured per learning cycle and leg; pure functions of one cycle after the other.

Every function gives (cycles, L); what is undefined is NaN, never 0.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cmacexp.arrays import Array, Mask


class Block(NamedTuple):
    """A trace cut into cycles: arrays (cycles, N, L); rows that a run did not reach are NaN and not ``valid``."""

    valid: Mask
    support: Mask
    """Valid and planned to support."""
    progress: Array
    time: Array
    error_x: Array
    """x - x_desired, m."""
    error_y: Array
    force: Array
    force_desired: Array
    feedback: Array
    """(cycles, N, L, 2): N m."""
    feedforward: Array

    @property
    def transfer(self) -> Mask:
        """Valid and planned transfer."""
        return self.valid & ~self.support

    @property
    def second_half(self) -> Mask:
        """Second half of support."""
        return self.support & (self.progress >= 0.5)


def _phase_samples(block: Block, phase: Mask) -> float:
    """Samples of a whole phase, told from its first advance in progress; very many if there was none."""
    advanced = block.progress[phase & (block.progress > 0.0)]
    return float(np.rint(1.0 / advanced.min())) if advanced.size else 1e9


def three_feet(block: Block) -> Mask:
    """Middle half of each planned interval in which the same three feet support, for all legs.

    How long an interval is follows from the progress of the legs, also where it straddles cycles or the run stops.
    """
    samples = np.where(block.support, _phase_samples(block, block.support), _phase_samples(block, block.transfer))
    progress = np.where(block.valid, block.progress, 0.0)
    done = np.rint(progress * samples).min(axis=2)
    left = np.rint((1.0 - progress) * samples).min(axis=2)
    quarter = (done + left) // 4
    middle = (block.support.sum(axis=2) == 3) & (done >= quarter) & (left > quarter)
    return block.valid & middle[:, :, None]


def _or_nan(value: Array, mask: Mask) -> Array:
    """``value`` (cycles, L) where ``mask`` (cycles, N, L) has at least one sample, else NaN."""
    return np.where(mask.any(axis=1), value, np.nan)


def mean(value: Array, mask: Mask) -> Array:
    """Mean over the samples of ``mask``."""
    count = mask.sum(axis=1)
    return _or_nan(np.where(mask, value, 0.0).sum(axis=1) / np.maximum(count, 1), mask)


def rms(value: Array, mask: Mask) -> Array:
    """Root mean square over the samples of ``mask``."""
    return np.sqrt(mean(value**2, mask))


def largest(value: Array, mask: Mask) -> Array:
    """Largest value over the samples of ``mask``."""
    return _or_nan(np.where(mask, value, -np.inf).max(axis=1), mask)


def force_settled(block: Block) -> Array:
    """Mean force over the second half of support, N."""
    return mean(block.force, block.second_half)


def desired_settled(block: Block) -> Array:
    """Mean desired force over the second half of support, N."""
    return mean(block.force_desired, block.second_half)


def force_steady_state_error(block: Block) -> Array:
    """(settled - desired) / desired, signed."""
    desired = desired_settled(block)
    return (force_settled(block) - desired) / np.where(desired == 0.0, np.nan, desired)


def force_overshoot(block: Block) -> Array:
    """Largest force over desired - 1 over support; NaN unless the desired force is constant in the second half."""
    desired = desired_settled(block)
    constant = largest(np.abs(block.force_desired - desired[:, None, :]), block.second_half) <= 1e-9 * np.abs(desired)
    pressed = np.where(constant & (desired > 0.0), desired, np.nan)
    return largest(block.force, block.support) / pressed - 1.0


def force_ripple(block: Block) -> Array:
    """Standard deviation of the force over the second half of support, N."""
    return rms(block.force - force_settled(block)[:, None, :], block.second_half)


def step_time(block: Block) -> float:
    """Sampling period, s; NaN if there is one sample only."""
    steps = np.diff(block.time, axis=1)
    known = steps[np.isfinite(steps)]
    return float(known.max()) if known.size else float("nan")


def since_touch_down(block: Block) -> Array:
    """Time since the first sample of support, s; NaN in transfer, and where support did not begin in this cycle."""
    first = np.where(block.support, block.time, np.inf).min(axis=1, keepdims=True, initial=np.inf)
    elapsed = np.where(
        block.support & np.isfinite(first), block.time - np.where(np.isfinite(first), first, 0.0), np.nan
    )
    began = ((elapsed == 0.0) & (block.progress == 0.0)).any(axis=1, keepdims=True)
    return np.where(began, elapsed, np.nan)


def whole_support(block: Block) -> Array:
    """Support that begins and ends within the cycle: 1.0, else NaN."""
    began = np.isfinite(since_touch_down(block)).any(axis=1)
    whole = block.support.sum(axis=1) == _phase_samples(block, block.support)
    return np.where(began & whole, 1.0, np.nan)


def force_settling_time(block: Block) -> Array:
    """Time from touch-down until the force stays within 2 % of its settled value, s; NaN if it never does.

    NaN as well where the support of a cycle does not begin and end within it, or settles at no force.
    """
    settled = force_settled(block)[:, None, :]
    elapsed = since_touch_down(block)
    outside = block.support & ~(np.abs(block.force - settled) <= 0.02 * np.abs(settled))
    step = step_time(block)
    last_outside = np.where(outside, np.nan_to_num(elapsed), -step).max(axis=1, initial=-step)
    ends = last_outside < largest(np.nan_to_num(elapsed), block.support)
    return np.where(ends & (settled[:, 0] > 0.0), (last_outside + step) * whole_support(block), np.nan)


def force_iae(block: Block) -> Array:
    """Integral of the absolute force error over support, N s."""
    error = np.abs(block.force - block.force_desired)
    return _or_nan(np.where(block.support, error, 0.0).sum(axis=1) * step_time(block), block.support)


def force_itae(block: Block) -> Array:
    """Integral of time since touch-down times absolute force error, N s^2; NaN unless support is whole in a cycle."""
    weighted = np.nan_to_num(since_touch_down(block)) * np.abs(block.force - block.force_desired)
    return np.where(block.support, weighted, 0.0).sum(axis=1) * step_time(block) * whole_support(block)


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


class Metric(NamedTuple):
    """A column of ``metrics.parquet``."""

    unit: str
    meaning: str
    of: Callable[[Block], Array]


METRICS = {
    "transfer_rmse_x": Metric("m", "RMS of x - x_desired in transfer", lambda b: rms(b.error_x, b.transfer)),
    "transfer_rmse_y": Metric("m", "RMS of y - y_desired in transfer", lambda b: rms(b.error_y, b.transfer)),
    "support_rmse_x": Metric("m", "RMS of x - x_desired in support", lambda b: rms(b.error_x, b.support)),
    "force_rmse": Metric("N", "RMS force error in support", lambda b: rms(b.force - b.force_desired, b.support)),
    "force_rmse_cycle": Metric(
        "N", "RMS force error, all samples", lambda b: rms(b.force - b.force_desired, b.valid)
    ),
    "force_rmse_three_feet": Metric(
        "N",
        "RMS force error over the middle half of each planned three-foot interval",
        lambda b: rms(b.force - b.force_desired, three_feet(b)),
    ),
    "force_settled": Metric("N", "mean force over the second half of support", force_settled),
    "force_steady_state_error": Metric("", "(force_settled - desired)/desired, signed", force_steady_state_error),
    "force_overshoot": Metric("", "max force/desired - 1 over support", force_overshoot),
    "force_ripple": Metric("N", "standard deviation of force over the second half of support", force_ripple),
    "force_settling_time": Metric("s", "from touch-down to within 2 % of force_settled", force_settling_time),
    "force_iae": Metric("N s", "integral of the absolute force error over support", force_iae),
    "force_itae": Metric("N s^2", "integral of time times absolute force error over support", force_itae),
    "feedback_rms": Metric("N m", "RMS feedback torque, both joints", lambda b: _torque_rms(b.feedback, b.valid)),
    "feedforward_rms": Metric(
        "N m", "RMS feedforward torque, both joints", lambda b: _torque_rms(b.feedforward, b.valid)
    ),
    "torque_peak": Metric("N m", "largest absolute joint torque", torque_peak),
    "feedforward_share": Metric("", "feedforward over feedforward + feedback, absolute torques", feedforward_share),
}
