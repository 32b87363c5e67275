"""Kernels of three Kalman filters, one per world axis: position and velocity of the body, positions of the feet.

Leg kinematics measure the feet relative to the body and, for feet in stance, the velocity of the body (Bledt et al.
2018, MIT Cheetah 3: Design and Control of a Robust, Dynamic Quadruped Robot).
"""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array, Scratch, State

POSITION, SPEED, FEET = range(3)
"""Indices of the state vector; the positions of the L feet start at FEET."""
START_VARIANCE = 1e-4
"""Initial variance of every state, in its unit squared."""
POSITION_RATE = 0.001
"""Process noise of the body position, m^2/s; this and the next two are those of the Mini Cheetah software."""
SPEED_RATE = 0.0098
"""Process noise of the body velocity, m^2/s^3."""
FOOT_RATE = 0.002
"""Process noise of the position of a foot in stance, m^2/s."""
REACH_VARIANCE = 0.001
"""Variance of the measured position of a foot relative to the body, m^2."""
SPEED_VARIANCE = 0.1
"""Variance of the body velocity measured by a foot in stance, m^2/s^2."""
LEAST_TRUST = 0.01
"""Lower bound of the trust in a foot, without a unit: at 0.1 a foot in swing would still drag the body by 2 % of its
path."""


class PlaceFilter(NamedTuple):
    """State and inputs of the filters along x, y and z, for L legs."""

    state: State
    """(3, 2 + L): position, m, and velocity, m/s, of the body, positions of the feet, m."""
    covariance: State
    """(3, 2 + L, 2 + L): covariance of the state, m^2, m^2/s and m^2/s^2."""
    row: Scratch
    """(2 + L,): working array of an update, H P, in the units of the covariance."""
    trust: Scratch
    """(L,): trust that a foot is in stance, 0 to 1."""
    reach: Scratch
    """(L, 3): position of the foot relative to the body, in the world frame, m."""
    passing: Scratch
    """(L, 3): velocity of the foot relative to the body, in the world frame, m/s."""
    rolling: Scratch
    """(L, 3): velocity of the centre of a spherical foot that rolls, in the world frame, m/s; 0 if feet stick."""


def new_filter(legs: int) -> PlaceFilter:
    """Make the filters for ``legs`` legs, not started yet."""
    n = FEET + legs
    reach, passing, rolling = (np.zeros((legs, 3)) for _ in range(3))
    return PlaceFilter(np.zeros((3, n)), np.zeros((3, n, n)), np.zeros(n), np.zeros(legs), reach, passing, rolling)


@kernel
def start_filter(places: PlaceFilter) -> None:
    """Set the initial state: body at rest at x = y = 0, lowest foot at height 0."""
    legs = places.trust.shape[0]
    height = 0.0
    for i in range(legs):
        height = max(height, -places.reach[i, 2])
    for d in range(3):
        state = places.state[d]
        state[POSITION] = height if d == 2 else 0.0
        state[SPEED] = 0.0
        for i in range(legs):
            state[FEET + i] = state[POSITION] + places.reach[i, d]
        for n in range(FEET + legs):
            for m in range(FEET + legs):
                places.covariance[d, n, m] = START_VARIANCE if n == m else 0.0


@kernel
def variance_factor(trust: float) -> float:
    """Return the factor on the variances of a foot with ``trust`` 0 to 1 in its stance: 1 / trust^2, at most 10^4."""
    share = max(trust, LEAST_TRUST)
    return 1.0 / (share * share)


@kernel
def predict_axis(places: PlaceFilter, d: int, period: float, acceleration: float) -> None:
    """Predict the state along axis ``d`` one sampling ``period``, s, ahead, from the body ``acceleration``, m/s^2."""
    state = places.state[d]
    covariance = places.covariance[d]
    state[POSITION] += period * (state[SPEED] + 0.5 * period * acceleration)
    state[SPEED] += period * acceleration
    for n in range(state.shape[0]):
        covariance[POSITION, n] += period * covariance[SPEED, n]
    for n in range(state.shape[0]):
        covariance[n, POSITION] += period * covariance[n, SPEED]
    covariance[POSITION, POSITION] += period * POSITION_RATE
    covariance[SPEED, SPEED] += period * SPEED_RATE
    for i in range(places.trust.shape[0]):
        state[FEET + i] += period * places.rolling[i, d]
        covariance[FEET + i, FEET + i] += period * FOOT_RATE * variance_factor(places.trust[i])


@kernel
def update_axis(places: PlaceFilter, d: int, a: int, b: int, value: float, variance: float) -> None:
    """Update the filter along axis ``d`` with a measured ``value`` of state ``a`` minus state ``b``.

    A negative ``b`` stands for a measurement of state ``a``. ``value`` is in m or m/s, ``variance`` in its unit
    squared.
    """
    state = places.state[d]
    covariance = places.covariance[d]
    row = places.row
    expected = state[a] - state[b] if b >= 0 else state[a]
    for n in range(state.shape[0]):
        row[n] = covariance[a, n] - covariance[b, n] if b >= 0 else covariance[a, n]
    total = variance + row[a] - (row[b] if b >= 0 else 0.0)
    for n in range(state.shape[0]):
        gain = row[n] / total
        state[n] += gain * (value - expected)
        for m in range(state.shape[0]):
            covariance[n, m] -= gain * row[m]


@kernel
def step_filters(places: PlaceFilter, period: float, acceleration: tuple[float, float, float], depth: Array) -> None:
    """Advance all filters by one sampling ``period``, s: predict, then update with the kinematics of the legs.

    ``acceleration`` (3,), m/s^2, is the body acceleration in the world frame, without gravity; ``depth`` (L,), m, the
    depth of the feet in the ground.
    """
    for d in range(3):
        predict_axis(places, d, period, acceleration[d])
        for i in range(places.trust.shape[0]):
            factor = variance_factor(places.trust[i])
            update_axis(places, d, FEET + i, POSITION, places.reach[i, d], REACH_VARIANCE)
            update_axis(places, d, SPEED, -1, places.rolling[i, d] - places.passing[i, d], SPEED_VARIANCE * factor)
            if d == 2:
                update_axis(places, d, FEET + i, -1, -depth[i], REACH_VARIANCE * factor)
