"""Fault detection of force sensors: each reading against the force expected at the measured depth of the foot.

Normalised deviations are summed from 0 upwards (a cumulative sum: Page 1954, Continuous inspection schemes,
Biometrika 41), so that neither spikes nor noise exclude a healthy sensor.
"""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.models.body import Pose, depth
from cmacexp.models.ground import contact_force
from cmacexp.models.mechanism import Mechanism, has_body
from cmacexp.typing import Array, Clock, State

LARGEST_INCREMENT = 1.0


class FaultDetection(NamedTuple):
    """Parameters of fault detection: the fields of :class:`cmacexp.config.schema.PlausibilityConfig`."""

    enabled: bool
    tolerance: float
    """Allowed difference from the expected force, N."""
    relative_tolerance: float
    """Likewise over the expected force."""
    patience: int
    """Statistic above which a sensor is excluded: samples with twice the allowed difference."""


class FaultStatus(NamedTuple):
    """Status of the force sensors; L is the number of legs."""

    statistic: State
    """(L,): cumulative sum, at least 0."""
    trusted: Clock
    """(L,): 1, or 0 since the sensor was excluded."""
    steps: Clock
    """(L,): steps for which it was trusted."""


def new_fault_status(legs: int) -> FaultStatus:
    """All sensors are trusted."""
    return FaultStatus(np.zeros(legs), np.ones(legs), np.zeros(legs))


@kernel
def expected_force(stiffness: float, mechanism: Mechanism, i: int, foot: Array, pose: Pose) -> float:
    """Contact force that flat ground of K_n ``stiffness`` N/m gives foot ``i`` at its measured depth, N (eq. 1).

    ``foot`` (L, J) is in the frames of the hips, ``pose`` is that of the body.
    """
    if has_body(mechanism):
        hips = mechanism.hips
        return contact_force(stiffness, depth(pose, hips[i, 0] + foot[i, 0], hips[i, 1], foot[i, 1]))
    return contact_force(stiffness, foot[i, 1] - mechanism.hip_height)


@kernel
def update_status(params: FaultDetection, status: FaultStatus, i: int, measured: float, expected: float) -> bool:
    """Update the status by one sample of leg ``i``, N; True while its sensor is trusted."""
    if status.trusted[i] == 0.0:
        return False
    allowed = params.tolerance + params.relative_tolerance * expected
    increment = min(abs(measured - expected) / allowed - 1.0, LARGEST_INCREMENT)
    status.statistic[i] = max(0.0, status.statistic[i] + increment)
    if status.statistic[i] > params.patience:
        status.trusted[i] = 0.0
        return False
    status.steps[i] += 1.0
    return True
