"""Actual machine, ground and payload, which only the plant knows.

The machine differs from its config, and its joints start at other angles than planned.
"""

from dataclasses import dataclass, replace

import numpy as np

from cmacexp.config import ComponentConfig, number
from cmacexp.config.schema import PayloadConfig, TerrainConfig
from cmacexp.models.body import Load
from cmacexp.models.ground import ALL_LEGS, NEVER, Ground, first_sample
from cmacexp.planning.plan import Setup
from cmacexp.plants.kernels import Payload


@dataclass(kw_only=True)
class AsBuiltConfig(ComponentConfig):
    """Differences of the actual machine from its config, common to all plants; by default there are none.

    No other component of the loop knows them.
    """

    mass_factor: float = number("", above=0, at_most=10, default=1.0)
    """True masses and inertias over the nominal ones; only the plant uses the true ones."""
    start_spread: float = number("rad", at_least=0, at_most=0.5, needs=("machine.kind != 'point_mass'",), default=0.0)
    """Largest random difference of the initial joint angles from the planned ones."""
    start_seed: int = number("", at_least=0, below=2**32, needs=("own.start_spread > 0",), default=0)
    """Seed of the random initial joint angles."""
    delay: int = number("samples", at_least=0, default=0)
    """Delay of the torques beyond ``actuator.delay``, which is the declared one."""

    def build(self, setup: Setup) -> Setup:
        """Return the setup with the actual mechanism and the actual initial joint angles (L, J), rad."""
        spread = self.start_spread if setup.mechanism.kind else 0.0
        away = np.random.default_rng(self.start_seed).uniform(-spread, spread, setup.start.shape) if spread else 0.0
        mechanism = setup.mechanism._replace(
            legs=setup.mechanism.legs.copy(), weight=setup.mechanism.weight * self.mass_factor
        )
        if mechanism.chains is None:  # chains of a robot have no masses
            for mass in (mechanism.planar_legs.mass_1, mechanism.planar_legs.mass_2):
                mass *= self.mass_factor
        return replace(setup, mechanism=mechanism, start=setup.start + away)


def make_ground(terrain: TerrainConfig, sampling_period: float) -> Ground:
    """Make the ground that a config describes."""
    return Ground(
        stiffness=terrain.stiffness,
        patch_size=terrain.patch_size,
        patch_spread=terrain.patch_spread,
        patch_seed=terrain.patch_seed,
        damping=terrain.damping,
        step_at=NEVER if terrain.step_time is None else first_sample(terrain.step_time, sampling_period),
        step_factor=terrain.step_factor,
        step_legs=ALL_LEGS if terrain.step_legs is None else sum(1 << (leg - 1) for leg in terrain.step_legs),
        slope=terrain.slope,
        slope_start=terrain.slope_start,
    )


def make_payload(payload: PayloadConfig, sampling_period: float) -> Payload:
    """Make the payload that a config describes."""
    start = first_sample(payload.time, sampling_period) if payload.weight else NEVER
    return Payload(Load(payload.weight, payload.x, payload.y), start)
