"""The leg on its stand in MuJoCo: an independent check of the project's equations of motion."""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import ComponentConfig, Config, number
from cmacexp.models.mechanism import LEGS_ON_STAND
from cmacexp.planning.setup import Setup
from cmacexp.plants.environment import make_ground
from cmacexp.plants.mujoco_engine import MujocoEngine, check_kind
from cmacexp.plants.mujoco_kernels import Measured, Touch, observing_stand
from cmacexp.plants.mujoco_model import check_masses
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array


class MujocoLeg:
    """One leg on a stand, on the project's elastic ground, without friction."""

    @dataclass
    class Config(ComponentConfig):
        """How MuJoCo integrates the leg."""

        substeps: int = number("", at_least=1, at_most=10000)
        """Runge-Kutta steps per sampling period."""

        def check(self, config: Config) -> None:
            """Check that MuJoCo accepts the masses."""
            check_masses(config.machine)

    engine: MujocoEngine

    def __init__(self, config: Config):
        self.config = config

    def reset(self, setup: Setup) -> Measurement:
        """Start at the planned joint angles, at rest.

        Raises:
            BadInput: the machine is not a leg on a stand, or MuJoCo is not installed.
        """
        check_kind(setup, LEGS_ON_STAND, "mujoco_leg")
        touch = Touch(make_ground(setup.config.terrain, setup.config.sampling_period), 0.0, 0.0, 0.0)
        step = setup.config.sampling_period / self.config.substeps
        self.hip_height = setup.mechanism.hip_height
        self.engine = MujocoEngine(setup.mechanism, touch, step)
        legs, body = self.engine.legs, np.array([self.hip_height, 0.0, 0.0])
        self.measured = Measured(np.empty((legs, 2)), np.empty((legs, 2)), body, np.zeros(3), np.zeros(3))
        self.observing = observing_stand(self.engine.bodies, self.hip_height, self.measured)
        self.engine.start(setup.start)
        return self.measure()

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (L, 2), N m, over one sampling period.

        Raises:
            Diverged: MuJoCo warns of its state.
        """
        self.engine.advance(torque, self.config.substeps)
        return self.measure()

    def measure(self) -> Measurement:
        """A copy of the present state."""
        next(self.observing)
        foot, velocity, pose, rate, _ = (part.copy() for part in self.measured)
        engine = self.engine
        return Measurement(engine.q.copy(), engine.dq.copy(), foot, velocity, engine.force.copy(), pose, rate)
