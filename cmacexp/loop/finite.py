"""Whether what components give is finite, as kernels."""

import math

from cmacexp.jit.compiler import kernel
from cmacexp.plants.kernels import PlantState
from cmacexp.sensors.kernels import Observation
from cmacexp.typing import Array


@kernel
def is_finite(values: Array) -> bool:
    """Whether all of ``values`` (L, J), of any unit, are finite."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            if not math.isfinite(values[i, j]):
                return False
    return True


@kernel
def observes_finite(observation: Observation) -> bool:
    """Whether all values of an observation are finite."""
    for i in range(observation.force.shape[0]):
        if not math.isfinite(observation.force[i]):
            return False
    for n in range(3):
        if not (math.isfinite(observation.body[n]) and math.isfinite(observation.body_rate[n])):
            return False
    return (
        is_finite(observation.q)
        and is_finite(observation.dq)
        and is_finite(observation.foot)
        and is_finite(observation.velocity)
    )


@kernel
def moves_finite(machine: PlantState) -> bool:
    """Whether the velocities of body and feet are finite."""
    for n in range(3):
        if not math.isfinite(machine.body_rate[n]):
            return False
    return is_finite(machine.velocity)
