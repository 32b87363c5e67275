"""A trace split into gait cycles, with the masks of support and transfer."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.data.trace import THIRD_AXIS, Trace
from cmacexp.metrics.measures import largest, mean
from cmacexp.typing import Array, Mask


class Rhythm(NamedTuple):
    """Sampling period and phase lengths, which are the same in all cycles of a run."""

    step: float
    """Sampling period, s, from the first two samples of the run; NaN if there is only one sample."""
    support_samples: float
    """Samples of a complete support phase, from its first increment of progress; 1e9 if there is none."""
    transfer_samples: float
    """Samples of a complete transfer phase, from its first increment of progress; 1e9 if there is none."""


def read_rhythm(time: Array, progress: Array, valid: Mask, support: Mask) -> Rhythm:
    """Compute the rhythm of a run from its first cycles; all arguments are (cycles, L, N)."""
    times = time[:, 0].flat[:2]

    def count_samples(phase: Mask) -> float:
        advanced = progress[phase & (progress > 0.0)]
        return float(np.rint(1.0 / advanced.min())) if advanced.size else 1e9

    step = float(times[1] - times[0]) if len(times) == 2 else float("nan")
    return Rhythm(step, count_samples(support), count_samples(valid & ~support))


@dataclass(frozen=True)
class Block:
    """A trace split into cycles: arrays (cycles, L, N) for L legs and N steps per cycle.

    Steps that the run did not reach are NaN and not ``valid``.
    """

    rhythm: Rhythm
    valid: Mask
    support: Mask
    """Valid samples in planned support."""
    progress: Array
    time: Array
    error: Mapping[str, Array]
    """Position error of the foot by axis, x - x_desired and y - y_desired, m; for a robot also z - z_desired."""
    force: Array
    force_desired: Array
    feedback: Array
    """(cycles, L, N, J): feedback torque, N m; for a robot without J^T F_d, which is planned and not learned."""
    feedforward: Array
    rate: Array
    """(cycles, L, N, J): joint velocities, rad/s; for a point mass its velocity, m/s."""
    before: Array | None = None
    """(L, N, J): feedback torque of the preceding cycle, N m; None if the first cycle is that of the run."""
    force_torque: Array | None = None
    """(cycles, L, N, J): J^T F_d, N m; None where the trace does not store it separately."""
    joint_error: Array | None = None
    """(cycles, L, N, J): q - q_desired, rad; None where the trace has no desired joint angles."""

    @cached_property
    def transfer(self) -> Mask:
        """Valid samples in planned transfer."""
        return self.valid & ~self.support

    @cached_property
    def second_half(self) -> Mask:
        """Samples in the second half of support."""
        return self.support & (self.progress >= 0.5)

    @cached_property
    def force_error(self) -> Array:
        """Force error, force - force_desired, N."""
        return self.force - self.force_desired

    @cached_property
    def force_settled(self) -> Array:
        """Mean force over the second half of support, N; (cycles, L)."""
        return mean(self.force, self.second_half)

    @cached_property
    def desired_settled(self) -> Array:
        """Mean desired force over the second half of support, N; (cycles, L)."""
        return mean(self.force_desired, self.second_half)

    @cached_property
    def torque(self) -> Array:
        """(cycles, L, N, J): total torque of the joints, N m."""
        torque = self.feedback + self.feedforward
        return torque if self.force_torque is None else torque + self.force_torque

    @cached_property
    def feedback_change(self) -> Array:
        """(cycles, L, N, J): change of the feedback torque since the preceding cycle, N m; NaN in the first one."""
        first = np.full_like(self.feedback[:1], np.nan) if self.before is None else self.before[None]
        return np.diff(np.concatenate([first, self.feedback]), axis=0)

    @cached_property
    def since_touch_down(self) -> Array:
        """Time since the first sample of support, s; NaN in transfer and if support began before the cycle."""
        first = np.where(self.support, self.time, np.inf).min(axis=2, keepdims=True)
        elapsed = np.where(self.support, self.time - np.where(np.isfinite(first), first, 0.0), np.nan)
        began = ((elapsed == 0.0) & (self.progress == 0.0)).any(axis=2, keepdims=True)
        return np.where(began, elapsed, np.nan)

    @cached_property
    def whole_support(self) -> Array:
        """1.0 where support begins and ends within the cycle, else NaN; (cycles, L)."""
        began = np.isfinite(largest(self.since_touch_down, self.support))
        whole = self.support.sum(axis=2) == self.rhythm.support_samples
        return np.where(began & whole, 1.0, np.nan)


def _fold(trace: Trace, name: str, steps_per_cycle: int) -> NDArray[Any]:
    """Fold a signal (steps, L) into (cycles, L, N); a view if the last cycle is complete.

    The signal ``phase`` is 1.0 in support.
    """
    values = trace.support if name == "phase" else trace[name]
    if missing := -len(values) % steps_per_cycle:
        values = np.concatenate([values, np.full((missing, values.shape[1]), np.nan)])
    return values.reshape(-1, steps_per_cycle, values.shape[1]).swapaxes(1, 2)


def split_cycles(trace: Trace, steps_per_cycle: int, before: Block | None = None) -> Block:
    """Split a trace into cycles of N = ``steps_per_cycle`` steps; the last cycle may be incomplete.

    ``before`` holds the preceding cycles of the same run, whose rhythm is used; None if the trace begins with the
    first cycle of the run.
    """

    def split(*names: str) -> Array:
        """Stack signals as (signals, cycles, L, N), contiguous per signal."""
        folded = [_fold(trace, name, steps_per_cycle) for name in names]
        return np.stack(folded, out=np.empty((len(names), *folded[0].shape)))

    def split_joints(name: str) -> Array:
        return np.moveaxis(split(*(name.format(joint + 1) for joint in range(len(axes)))), 0, 3)

    axes = trace.axes
    is_spatial = THIRD_AXIS in axes
    time, progress, phase, force, force_desired = split("time", "progress", "phase", "force", "force_desired")
    valid = ~np.isnan(time)
    support = phase == 1.0
    force_torque = split_joints("tau_force_{}") if is_spatial else None
    feedback = split_joints("tau_feedback_{}")
    return Block(
        rhythm=before.rhythm if before else read_rhythm(time, progress, valid, support),
        valid=valid,
        support=support,
        progress=progress,
        time=time,
        error=dict(zip(axes, split(*axes) - split(*(f"{axis}_desired" for axis in axes)), strict=True)),
        force=force,
        force_desired=force_desired,
        feedback=feedback if force_torque is None else feedback - force_torque,
        feedforward=split_joints("tau_feedforward_{}"),
        rate=split_joints("dq{}"),
        before=before.feedback[-1] if before else None,
        force_torque=force_torque,
        joint_error=split_joints("q{}") - split_joints("q{}_desired") if is_spatial else None,
    )


def three_feet(block: Block) -> Mask:
    """Mask the middle half of each planned interval in which the same three feet support; (cycles, L, N).

    The mask is the same for all legs, and False everywhere with fewer than three legs. The length of an interval
    follows from the progress of the legs, even if it straddles two cycles or the run stops within it.
    """
    if block.support.shape[1] < 3:
        return np.zeros_like(block.valid)
    samples = np.where(block.support, block.rhythm.support_samples, block.rhythm.transfer_samples)
    progress = np.where(block.valid, block.progress, 0.0)
    done = np.rint(progress * samples).min(axis=1)
    left = np.rint((1.0 - progress) * samples).min(axis=1)
    quarter = (done + left) // 4
    is_middle = (block.support.sum(axis=1) == 3) & (done >= quarter) & (left > quarter)
    return block.valid & is_middle[:, None]
