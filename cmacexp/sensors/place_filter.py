"""A Kalman filter along one axis of the world, as kernels: place and speed of a body, and where its feet are.

Legs measure where feet are and, where they stand, how fast the body moves over them (Bledt et al. 2018, MIT Cheetah
3: Design and Control of a Robust, Dynamic Quadruped Robot).
"""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.typing import Array, Scratch, State

PLACE, SPEED, FEET = range(3)
"""Rows of the state; those of the feet follow from FEET on."""
START_VARIANCE = 1e-4
"""Variance of every state at the start, in its unit squared."""
PLACE_RATE, SPEED_RATE, FOOT_RATE = 0.001, 0.0098, 0.002
"""Rates at which the variances of place (m^2/s), speed (m^2/s^3) and standing feet (m^2/s) grow, those of the
software of the Mini Cheetah."""
REACH_VARIANCE, SPEED_VARIANCE = 0.001, 0.1
"""Variances of a foot's measured distance from the body, m^2, and of the measured speed over it, m^2/s^2."""
LEAST_TRUST = 0.01
"""Square root of what divides variances of a foot in the air: a hundredth of them would move the body by 2 % of the
way of feet that swing."""


class PlaceFilter(NamedTuple):
    """State of the filters along x, y and z, of L legs."""

    state: State
    """(3, 2 + L): place and speed of the body, places of the feet, m and m/s."""
    covariance: State
    """(3, 2 + L, 2 + L): of the state, m^2, m^2/s and m^2/s^2."""
    row: Scratch
    """(2 + L,): of the covariance, in an update, in its units."""
    trust: Scratch
    """(L,): 0 to 1, in that a foot stands."""
    reach: Scratch
    """(L, 3): foot less body in the world, m."""
    passing: Scratch
    """(L, 3): velocity of the foot relative to the body, in the world, m/s."""
    rolling: Scratch
    """(L, 3): velocity in the world of the centre of a sphere that rolls there, m/s; zero of feet that stick."""


def new_filter(legs: int) -> PlaceFilter:
    """Filters of ``legs`` legs before their start."""
    n = FEET + legs
    reach, passing, rolling = (np.zeros((legs, 3)) for _ in range(3))
    return PlaceFilter(np.zeros((3, n)), np.zeros((3, n, n)), np.zeros(n), np.zeros(legs), reach, passing, rolling)


@kernel
def start_filter(places: PlaceFilter) -> None:
    """Start at the origin, the lowest foot at the height 0, at rest."""
    legs = places.trust.shape[0]
    height = 0.0
    for i in range(legs):
        height = max(height, -places.reach[i, 2])
    for d in range(3):
        state, covariance = places.state[d], places.covariance[d]
        state[PLACE], state[SPEED] = (height if d == 2 else 0.0), 0.0
        for i in range(legs):
            state[FEET + i] = state[PLACE] + places.reach[i, d]
        for n in range(FEET + legs):
            for m in range(FEET + legs):
                covariance[n, m] = START_VARIANCE if n == m else 0.0


@kernel
def doubt(trust: float) -> float:
    """What multiplies variances of a foot that is trusted, 0 to 1, to stand."""
    share = max(trust, LEAST_TRUST)
    return 1.0 / (share * share)


@kernel
def predict_axis(places: PlaceFilter, d: int, period: float, acceleration: float) -> None:
    """Move along axis ``d`` for a sampling ``period``, s, with an ``acceleration``, m/s^2."""
    state, covariance = places.state[d], places.covariance[d]
    state[PLACE] += period * (state[SPEED] + 0.5 * period * acceleration)
    state[SPEED] += period * acceleration
    for n in range(state.shape[0]):
        covariance[PLACE, n] += period * covariance[SPEED, n]
    for n in range(state.shape[0]):
        covariance[n, PLACE] += period * covariance[n, SPEED]
    covariance[PLACE, PLACE] += period * PLACE_RATE
    covariance[SPEED, SPEED] += period * SPEED_RATE
    for i in range(places.trust.shape[0]):
        state[FEET + i] += period * places.rolling[i, d]
        covariance[FEET + i, FEET + i] += period * FOOT_RATE * doubt(places.trust[i])


@kernel
def update_axis(places: PlaceFilter, d: int, a: int, b: int, value: float, variance: float) -> None:
    """Take into account that state ``a`` less state ``b``, none if negative, was measured as ``value``."""
    state, covariance, row = places.state[d], places.covariance[d], places.row
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
def locate(places: PlaceFilter, period: float, acceleration: tuple[float, float, float], depth: Array) -> None:
    """One step of all filters, with the body's ``acceleration`` (3,), m/s^2, and feet ``depth`` (L,) m deep."""
    for d in range(3):
        predict_axis(places, d, period, acceleration[d])
        for i in range(places.trust.shape[0]):
            factor = doubt(places.trust[i])
            speed = places.rolling[i, d] - places.passing[i, d]
            update_axis(places, d, FEET + i, PLACE, places.reach[i, d], REACH_VARIANCE)
            update_axis(places, d, SPEED, -1, speed, SPEED_VARIANCE * factor)
            if d == 2:
                update_axis(places, d, FEET + i, -1, -depth[i], REACH_VARIANCE * factor)
