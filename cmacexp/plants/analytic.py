"""The project's own plant: a point mass or legs on elastic ground, by their equations of motion."""

import math
from dataclasses import dataclass

from cmacexp.config import Config, number
from cmacexp.config.machine import RobotMachine, ask_for_robot, check_gravity_factors, gravity_factors
from cmacexp.models.leg import GRAVITY_TERMS
from cmacexp.planning.plan import Setup
from cmacexp.plants.as_built import AsBuiltConfig, make_ground, make_payload
from cmacexp.plants.kernels import PlantParams, PlantState, advance, new_state, observe, update_stiffness
from cmacexp.protocols import Measurement, copy_state
from cmacexp.typing import Array


class AnalyticPlant:
    """Equations 1, 2, 16, 17 and 23 of Lin & Song 1997, integrated at the sampling period."""

    @dataclass
    class Config(AsBuiltConfig):
        """Integration of the equations of motion."""

        substeps: int = number("", at_least=1, at_most=10000)
        """Runge-Kutta steps per sampling period; 1 as in the paper."""
        gravity_factors: list[float] = gravity_factors()
        """Factors of the four terms of the gravity vector in the true legs, see :data:`GRAVITY_TERMS` (assumed)."""

        def check(self, config: Config) -> None:
            """Check that the legs are planar; raise BadInput otherwise."""
            if isinstance(config.machine, RobotMachine):
                raise ask_for_robot(config.machine.model)
            check_gravity_factors("plant", self.gravity_factors)

        def build(self, setup: Setup) -> Setup:
            """Return the setup with the actual mechanism, whose legs have these factors of their weight."""
            setup = super().build(setup)
            setup.mechanism.legs[:, -GRAVITY_TERMS:] = self.gravity_factors
            return setup

    params: PlantParams
    state: PlantState

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup) -> Measurement:
        """Start at the planned joint angles, at rest."""
        setup = self.config.build(setup)
        config = setup.config
        payload = make_payload(config.payload, config.sampling_period)
        ground = make_ground(config.terrain, config.sampling_period)
        substeps = self.config.substeps
        step = config.sampling_period / substeps
        self.params = PlantParams(setup.mechanism, ground, payload, config.body_speed, step, substeps)
        self.state = new_state(setup.mechanism.shape[0])
        self.state.q[:] = setup.start
        self.state.body[0] = setup.mechanism.hip_height
        self.state.stiffness[:] = config.terrain.stiffness
        observe(self.params, self.state, math.inf)
        update_stiffness(self.params, self.state)
        observe(self.params, self.state, math.inf)
        return self.measure()

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (L, 2), N m, over one sampling period."""
        advance(self.params, self.state, torque)
        return self.measure()

    def measure(self) -> Measurement:
        """Return a copy of the current state."""
        return copy_state(self.state)
