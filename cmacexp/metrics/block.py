"""A trace cut into cycles, with the masks of its phases."""

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
    """Durations that all cycles of a run share, from its first cycles."""

    step: float
    """Sampling period, s, from the first two samples of the run; NaN if there is one only."""
    support_samples: float
    """Samples of a whole support, from its first advance in progress; very many if there was none."""
    transfer_samples: float
    """Samples of a whole transfer, from its first advance in progress; very many if there was none."""


def read_rhythm(time: Array, progress: Array, valid: Mask, support: Mask) -> Rhythm:
    """The rhythm of a run from its first cycles; arrays (cycles, L, N)."""
    times = time[:, 0].flat[:2]

    def samples(phase: Mask) -> float:
        advanced = progress[phase & (progress > 0.0)]
        return float(np.rint(1.0 / advanced.min())) if advanced.size else 1e9

    step = float(times[1] - times[0]) if len(times) == 2 else float("nan")
    return Rhythm(step, samples(support), samples(valid & ~support))


@dataclass(frozen=True)
class Block:
    """A trace cut into cycles: arrays (cycles, L, N); rows that a run did not reach are NaN and not ``valid``."""

    rhythm: Rhythm
    valid: Mask
    support: Mask
    """Valid and planned to support."""
    progress: Array
    time: Array
    error: Mapping[str, Array]
    """x - x_desired and y - y_desired, m, by axis; of a robot z - z_desired as well."""
    force: Array
    force_desired: Array
    feedback: Array
    """(cycles, L, N, J): N m; of a robot without J^T F_d, which the plan knows and nothing has to learn."""
    feedforward: Array
    rate: Array
    """(cycles, L, N, J): of the joints, rad/s; of a point mass its velocity, m/s."""
    before: Array | None = None
    """(L, N, J): feedback of the cycle before the first of these; None if there was none."""
    force_torque: Array | None = None
    """(cycles, L, N, J): J^T F_d, N m, where the trace has it apart."""
    joint_error: Array | None = None
    """(cycles, L, N, J): q - q_desired, rad; None where the trace has no planned angles."""

    @cached_property
    def transfer(self) -> Mask:
        """Valid and planned transfer."""
        return self.valid & ~self.support

    @cached_property
    def second_half(self) -> Mask:
        """Second half of support."""
        return self.support & (self.progress >= 0.5)

    @cached_property
    def force_error(self) -> Array:
        """force - force_desired, N."""
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
        """(cycles, L, N, J): what the joints are driven with, N m."""
        teaching = self.feedback + self.feedforward
        return teaching if self.force_torque is None else teaching + self.force_torque

    @cached_property
    def feedback_change(self) -> Array:
        """(cycles, L, N, J): change of the feedback from the cycle before, N m; NaN where there was none."""
        first = np.full_like(self.feedback[:1], np.nan) if self.before is None else self.before[None]
        return np.diff(np.concatenate([first, self.feedback]), axis=0)

    @cached_property
    def since_touch_down(self) -> Array:
        """Time since the first sample of support, s; NaN in transfer, and if support began before the cycle."""
        first = np.where(self.support, self.time, np.inf).min(axis=2, keepdims=True)
        elapsed = np.where(self.support, self.time - np.where(np.isfinite(first), first, 0.0), np.nan)
        began = ((elapsed == 0.0) & (self.progress == 0.0)).any(axis=2, keepdims=True)
        return np.where(began, elapsed, np.nan)

    @cached_property
    def whole_support(self) -> Array:
        """Support that begins and ends within the cycle: 1.0, else NaN; (cycles, L)."""
        began = np.isfinite(largest(self.since_touch_down, self.support))
        whole = self.support.sum(axis=2) == self.rhythm.support_samples
        return np.where(began & whole, 1.0, np.nan)


def split_cycles(trace: Trace, steps_per_cycle: int, before: Block | None = None) -> Block:
    """Cut the trace of a run, or of a part of it, into cycles of N steps; the last may be short.

    The part ``before`` has the rhythm of the run; None: this is the first part.
    """

    def fold(name: str) -> NDArray[Any]:
        """(steps, L) as (cycles, L, N), a view if the last cycle is whole; of the phase 1.0 is support."""
        values = trace.support if name == "phase" else trace[name]
        if missing := -len(values) % steps_per_cycle:
            values = np.concatenate([values, np.full((missing, values.shape[1]), np.nan)])
        return values.reshape(-1, steps_per_cycle, values.shape[1]).swapaxes(1, 2)

    def split(*names: str) -> Array:
        """Signals by name, (signals, cycles, L, N), each in one piece."""
        folded = [fold(name) for name in names]
        return np.stack(folded, out=np.empty((len(names), *folded[0].shape)))

    def joints(name: str) -> Array:
        return np.moveaxis(split(*(name.format(joint + 1) for joint in range(len(axes)))), 0, 3)

    axes = trace.axes
    in_space = THIRD_AXIS in axes
    time, progress, phase, force, force_desired = split("time", "progress", "phase", "force", "force_desired")
    valid, support = ~np.isnan(time), phase == 1.0
    force_torque = joints("tau_force_{}") if in_space else None
    feedback = joints("tau_feedback_{}")
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
        feedforward=joints("tau_feedforward_{}"),
        rate=joints("dq{}"),
        before=before.feedback[-1] if before else None,
        force_torque=force_torque,
        joint_error=joints("q{}") - joints("q{}_desired") if in_space else None,
    )


def three_feet(block: Block) -> Mask:
    """Middle half of each planned interval in which the same three feet support, for all legs.

    The length of an interval follows from the progress of the legs, even if it straddles cycles or the run stops.
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
