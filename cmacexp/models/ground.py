"""Elastic ground, with or without damping."""

import math
from typing import NamedTuple, TypeVar

import numpy as np

from cmacexp.jit.compiler import kernel, program
from cmacexp.models.mix import MASK, mix
from cmacexp.typing import Array, Mask

Coordinate = TypeVar("Coordinate", float, Array)

NEVER = 2**62
"""A step beyond the end of any run."""
ALL_LEGS = 0b1111


def first_sample(time: float, sampling_period: float) -> int:
    """Return the index of the first sample at or after ``time``, s."""
    return math.ceil(time / sampling_period - 1e-9)


class Ground(NamedTuple):
    """Ground of uniform stiffness or with square patches of different stiffness, flat or with a slope."""

    stiffness: float
    """K_n, N/m."""
    patch_size: float
    """Side of a patch, m."""
    patch_spread: float
    """Each patch multiplies K_n by a factor between 1 - spread and 1 + spread."""
    patch_seed: int
    damping: float
    """Damping c, N s/m."""
    step_at: int
    """Time of the step in stiffness, sampling periods."""
    step_factor: float
    step_legs: int
    """Bit mask of the legs under which the stiffness steps; leg 1 is the lowest bit."""
    slope: float
    """Slope, m/m, behind ``slope_start``, x in the world, m; the ground is flat up to there."""
    slope_start: float


@kernel
def height_at(slope: float, start: float, x: Coordinate) -> Coordinate:
    """Return the height, m, of ground that rises with ``slope`` (m/m) from ``start``, m, on, above its flat part.

    ``x`` in the world, m, is one coordinate or an array of any shape, which is that of the result.
    """
    return slope * np.maximum(x - start, 0.0)


@kernel
def grade_at(ground: Ground, x: float) -> float:
    """Return the slope of the ground at ``x`` in the world, m: m/m."""
    return ground.slope if x > ground.slope_start else 0.0


@kernel
def stiffness_at(ground: Ground, x: float, y: float) -> float:
    """Return K_n at (x, y) in the world, m, before any step of the stiffness, N/m."""
    if ground.patch_spread == 0.0:
        return ground.stiffness
    column = math.floor(x / ground.patch_size) & MASK
    row = math.floor(y / ground.patch_size) & MASK
    drawn = mix(mix(mix(ground.patch_seed, column), row), 0) / MASK
    return ground.stiffness * (1.0 + ground.patch_spread * (2.0 * drawn - 1.0))


@kernel
def stiffness_under(ground: Ground, leg: int, step: float, x: float, y: float) -> float:
    """Return K_n under ``leg``, counted from 0, at (x, y) in the world, m, after ``step`` sampling periods, N/m."""
    stiffness = stiffness_at(ground, x, y)
    return stiffness * ground.step_factor if step >= ground.step_at and (ground.step_legs >> leg) & 1 else stiffness


@kernel
def contact_force(stiffness: float, depression: float) -> float:
    """Return F = K_n D_a, N, for a depression D_a >= 0 m and K_n in N/m, else 0 (Lin & Song 1997, eq. 1)."""
    return stiffness * depression if depression > 0.0 else 0.0


@kernel
def damped_force(stiffness: float, damping: float, depression: float, rate: float) -> float:
    """Return the contact force of elastic ground with damping, N: K_n D + c dD/dt where D > 0, and never a pull.

    K_n in N/m, c in N s/m, D in m, positive into the ground, and its rate in m/s.
    """
    return max(0.0, stiffness * depression + damping * rate) if depression > 0.0 else 0.0


@kernel
def damped_spring(stiffness: float, damping: float, before: float, time: float) -> tuple[float, float]:
    """Return stiffness, N/m, and offset, m, of the spring that is equivalent to damped ground over a time step.

    The offset is the depth at which the spring begins to press. The foot is at the depth ``before``, m, at least 0;
    its motion is not known yet. The rate is the change of the depth over ``time``, s (backward Euler), which is
    stable even where that is short against c/K_n.
    """
    extra = damping / time
    return stiffness + extra, extra * before / (stiffness + extra)


def depression_for(stiffness: float, force: Array) -> Array:
    """Return the depression D_a = F / K_n, m, at which the ground carries ``force``, N, of any shape (eq. 1)."""
    return force / stiffness


@program
def _follow_force(decay: float, goes_on: Mask, increment: Array, depression: Array) -> None:
    """Set ``depression`` (N, L), m, to ``decay`` times that of the sample before plus ``increment``, in place.

    This is done where ``goes_on`` (N, L), a foot that was down in the sample before; ``increment`` is (N, L), m.
    """
    for _ in range(2):  # the second pass starts from the depression at the end of the cycle
        for k in range(depression.shape[0]):
            for i in range(depression.shape[1]):
                if goes_on[k, i]:
                    depression[k, i] = decay * depression[k - 1, i] + increment[k, i]


def damped_depression(stiffness: float, damping: float, force: Array, support: Mask, time: float) -> Array:
    """Compute the depressions D (N, L), m, at which ground with damping carries changing forces F (N, L), N.

    D fulfils K_n D + c dD/dt = F. The cycle repeats, with F linear between samples, ``time`` s apart. A foot that
    touches down, where ``support`` (N, L) begins, begins at F / K_n.
    """
    depression = depression_for(stiffness, force)
    lag = damping / stiffness / time
    if lag == 0.0:
        return depression
    decay = math.exp(-1.0 / lag)
    previous_weight = -lag * math.expm1(-1.0 / lag)
    increment = (1.0 - previous_weight) * depression + (previous_weight - decay) * np.roll(depression, 1, axis=0)
    goes_on = support & np.roll(support, 1, axis=0)
    _follow_force(decay, goes_on, increment, depression)
    return depression
