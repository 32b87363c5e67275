"""The machine as it is: in what it differs from its config, and where its joints start."""

from dataclasses import dataclass, replace

import numpy as np

from cmacexp.config import ComponentConfig, number
from cmacexp.planning.plan import Setup


@dataclass(kw_only=True)
class AsBuiltConfig(ComponentConfig):
    """What every shipped plant has, and nothing else in the loop knows; by default nothing differs."""

    mass_factor: float = number("", above=0, at_most=10, default=1.0)
    """Masses and inertias of the machine over those of its config."""
    start_spread: float = number("rad", at_least=0, at_most=0.5, needs=("machine.kind != 'point_mass'",), default=0.0)
    """Largest difference of the joint angles at the start from the planned ones."""
    start_seed: int = number("", at_least=0, below=2**32, needs=("own.start_spread > 0",), default=0)
    """Seed of the joint angles at the start."""
    delay: int = number("samples", at_least=0, default=0)
    """Samples by which torques act later than ``actuator.delay`` says."""

    def build(self, setup: Setup) -> Setup:
        """The setup with the mechanism and the joint angles (L, J) of the machine as it is."""
        spread = self.start_spread if setup.mechanism.kind else 0.0
        away = np.random.default_rng(self.start_seed).uniform(-spread, spread, setup.start.shape) if spread else 0.0
        mechanism = setup.mechanism._replace(
            legs=setup.mechanism.legs.copy(), weight=setup.mechanism.weight * self.mass_factor
        )
        if mechanism.chains is None:  # chains of a robot have no masses
            for mass in (mechanism.planar_legs.mass_1, mechanism.planar_legs.mass_2):
                mass *= self.mass_factor
        return replace(setup, mechanism=mechanism, start=setup.start + away)
