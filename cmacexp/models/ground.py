"""Elastic ground, with damping or without."""

import math
from typing import NamedTuple, TypeVar

import numpy as np

from cmacexp.jit.compiler import kernel, program
from cmacexp.models.mix import MASK, mix
from cmacexp.typing import Array, Mask

Places = TypeVar("Places", float, Array)

NEVER = 2**62
"""A step beyond the end of every run."""
ALL_LEGS = 0b1111


def first_sample(time: float, sampling_period: float) -> int:
    """The first sample at or after ``time``, s."""
    return math.ceil(time / sampling_period - 1e-9)


class Ground(NamedTuple):
    """Ground of uniform stiffness or with square patches of different stiffness, flat or with a slope."""

    stiffness: float
    """K_n, N/m."""
    patch_size: float
    """Side of a patch, m."""
    patch_spread: float
    """K_n of a patch is multiplied by a factor between 1 - spread and 1 + spread."""
    patch_seed: int
    damping: float
    """N s/m."""
    step_at: int
    """Sampling periods after which the stiffness steps."""
    step_factor: float
    step_legs: int
    """Legs under which it steps, as a bit mask; leg 1 is the lowest bit."""
    slope: float
    """m/m; the ground is flat up to ``slope_start``, x in the world, m."""
    slope_start: float


@kernel
def height_at(slope: float, start: float, x: Places) -> Places:
    """Height above the flat part, m, of ground that begins to ``slope`` (m/m) at ``start``, m.

    ``x`` in the world, m, is one place or an array of any shape, which is that of the result.
    """
    return slope * np.maximum(x - start, 0.0)


@kernel
def grade_at(ground: Ground, x: float) -> float:
    """Slope at ``x`` in the world, m/m."""
    return ground.slope if x > ground.slope_start else 0.0


@kernel
def stiffness_at(ground: Ground, x: float, y: float) -> float:
    """K_n at (x, y) in the world before any step, N/m."""
    if ground.patch_spread == 0.0:
        return ground.stiffness
    column = math.floor(x / ground.patch_size) & MASK
    row = math.floor(y / ground.patch_size) & MASK
    drawn = mix(mix(mix(ground.patch_seed, column), row), 0) / MASK
    return ground.stiffness * (1.0 + ground.patch_spread * (2.0 * drawn - 1.0))


@kernel
def stiffness_under(ground: Ground, leg: int, step: float, x: float, y: float) -> float:
    """K_n under a leg, counted from 0, that stands at (x, y) in the world after ``step`` sampling periods, N/m."""
    stiffness = stiffness_at(ground, x, y)
    return stiffness * ground.step_factor if step >= ground.step_at and (ground.step_legs >> leg) & 1 else stiffness


@kernel
def contact_force(stiffness: float, depression: float) -> float:
    """F = K_n D_a for a depth D_a >= 0 m, N, with K_n in N/m (Lin & Song 1997, eq. 1)."""
    return stiffness * depression if depression > 0.0 else 0.0


@kernel
def damped_force(stiffness: float, damping: float, depression: float, rate: float) -> float:
    """Contact force of elastic ground with damping, N: K_n D + c dD/dt where D > 0, and never a pull.

    K_n in N/m, c in N s/m, D in m, positive into the ground, and its rate in m/s.
    """
    return max(0.0, stiffness * depression + damping * rate) if depression > 0.0 else 0.0


@kernel
def damped_spring(stiffness: float, damping: float, before: float, time: float) -> tuple[float, float]:
    """Stiffness, N/m, and depth at which it begins to press, m, of the spring that is equivalent to damped ground.

    The foot is at the depth ``before``, m, at least 0; its motion is not known yet. The rate is the change of the
    depth over ``time``, s (backward Euler), which is stable even where that is short against c/K_n.
    """
    extra = damping / time
    return stiffness + extra, extra * before / (stiffness + extra)


def depression_for(stiffness: float, force: Array) -> Array:
    """D_a = F / K_n, m: the depression at which the ground carries ``force``, N, of any shape (eq. 1)."""
    return force / stiffness


@program
def _follow_force(decay: float, goes_on: Mask, follows: Array, depression: Array) -> None:
    """Where a foot ``goes_on`` (N, L), its ``depression`` (N, L), m, decays, and ``follows``, m, is added."""
    for _ in range(2):  # once more, from where the ring ends
        for k in range(depression.shape[0]):
            for i in range(depression.shape[1]):
                if goes_on[k, i]:
                    depression[k, i] = decay * depression[k - 1, i] + follows[k, i]


def damped_depression(stiffness: float, damping: float, force: Array, support: Mask, time: float) -> Array:
    """Depressions D with K_n D + c dD/dt = F, m, at which ground with damping carries changing forces F (N, L), N.

    The cycle is a ring, in which F is straight between samples, ``time`` s apart. A foot that touches down, where
    ``support`` (N, L) begins, begins at F / K_n.
    """
    depression = depression_for(stiffness, force)
    lag = damping / stiffness / time
    if lag == 0.0:
        return depression
    decay, late = math.exp(-1.0 / lag), -lag * math.expm1(-1.0 / lag)
    follows = (1.0 - late) * depression + (late - decay) * np.roll(depression, 1, axis=0)
    goes_on = support & np.roll(support, 1, axis=0)
    _follow_force(decay, goes_on, follows, depression)
    return depression
