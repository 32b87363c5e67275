"""Whether a force sensor can be believed: what it tells beside what the ground gives at the depth of the foot.

The doubt of every sample adds up, and belief takes it away again: a cumulative sum (Page 1954, Continuous inspection
schemes, Biometrika 41), so that neither a spike nor noise drops a sound sensor.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.models.body import depth
from cmacexp.models.ground import contact_force
from cmacexp.models.mechanism import LEGS_UNDER_BODY, Mechanism
from cmacexp.typing import Array, Clock, State

MOST_DOUBT = 1.0
"""What one sample can add to the doubt, however wrong it is."""


class Plausibility(NamedTuple):
    """What is believed of a force sensor."""

    enabled: bool
    stiffness: float
    """K_n of the ground as the controller believes it, N/m."""
    tolerance: float
    """Difference from the expected force that is not doubted, N."""
    relative_tolerance: float
    """Likewise over the expected force."""
    patience: float
    """Doubt at which a sensor is dropped: samples that are wrong by twice what is allowed."""


class Trust(NamedTuple):
    """What is known of the force sensors so far; L is the number of legs."""

    doubt: State
    """(L,): sum of the doubts, at least 0."""
    trusted: Clock
    """(L,): 1, and 0 since the sensor was dropped, for good."""
    steps: Clock
    """(L,): steps for which it was trusted."""


def new_trust(legs: int) -> Trust:
    """All sensors are trusted."""
    return Trust(np.zeros(legs), np.ones(legs), np.zeros(legs))


@kernel
def expected_force(params: Plausibility, mechanism: Mechanism, i: int, foot: Array, body: Array) -> float:
    """Contact force that flat ground gives foot ``i`` at its measured depth, N (eq. 1).

    ``foot`` (L, 2) is in the frames of the hips, ``body`` (3,) is height, pitch and roll.
    """
    if mechanism.kind == LEGS_UNDER_BODY:
        hips = mechanism.hips
        return contact_force(params.stiffness, depth(body, hips[i, 0] + foot[i, 0], hips[i, 1], foot[i, 1]))
    return contact_force(params.stiffness, foot[i, 1] - mechanism.hip_height)


@kernel
def judge(params: Plausibility, trust: Trust, i: int, measured: float, expected: float) -> bool:
    """Look at one sample of leg ``i``, N; whether its sensor is still trusted."""
    if trust.trusted[i] == 0.0:
        return False
    allowed = params.tolerance + params.relative_tolerance * expected
    doubt = min(abs(measured - expected) / allowed - 1.0, MOST_DOUBT)
    trust.doubt[i] = max(0.0, trust.doubt[i] + doubt)
    if trust.doubt[i] > params.patience:
        trust.trusted[i] = 0.0
        return False
    trust.steps[i] += 1.0
    return True
