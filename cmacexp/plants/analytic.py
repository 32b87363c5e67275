"""The project's own plant: point mass or legs on elastic ground, by their equations of motion."""

from typing import TYPE_CHECKING

import numpy as np

from cmacexp.arrays import Array
from cmacexp.models.mechanism import POINT_MASS
from cmacexp.plants.kernels import PlantLaw, PlantState, advance, new_state, observe
from cmacexp.plants.protocol import Measurement

if TYPE_CHECKING:
    from cmacexp.scenario import Setup


class AnalyticPlant:
    """Equations 1, 2, 16, 17 and 23 of Lin & Song 1997, integrated at the sampling period.

    Args:
        substeps: Runge-Kutta steps per sampling period.
    """

    law: PlantLaw
    state: PlantState

    def __init__(self, substeps: int = 1):
        self.substeps = substeps

    def reset(self, setup: "Setup") -> Measurement:
        """Start at the planned joint angles, at rest."""
        mechanism, config = setup.mechanism, setup.config
        legs = mechanism.legs.shape[0]
        self.law = PlantLaw(
            mechanism,
            np.full(legs, config.terrain.stiffness),
            config.sampling_period / self.substeps,
            self.substeps,
        )
        self.state = new_state(legs)
        self.state.q[:] = setup.start
        self.state.body[0] = mechanism.hip_height
        observe(self.law, self.state)
        return self.measure()

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (L, 2) over one sampling period."""
        advance(self.law, self.state, torque)
        return self.measure()

    def measure(self) -> Measurement:
        """A copy of what can be measured now."""
        state = self.state
        return Measurement(*(part.copy() for part in state[:6]))

    @property
    def has_joints(self) -> bool:
        """Whether q and dq are joint angles; a point mass has none."""
        return self.law.mechanism.kind != POINT_MASS
