"""Four legs under a floating body in MuJoCo, which stand on the project's elastic ground by friction.

Lin & Song 1997 balance the body in every instant (section 6); here it has mass, so that it rocks, bounces, and moves
only as far as the feet push it.
"""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import ComponentConfig, Config, number
from cmacexp.config.machine import QuadrupedMachine
from cmacexp.models.mechanism import LEGS_UNDER_BODY
from cmacexp.planning.setup import Setup
from cmacexp.plants.environment import make_ground, make_payload
from cmacexp.plants.mujoco_engine import MujocoEngine, check_kind
from cmacexp.plants.mujoco_kernels import Measured, Touch, observing_body
from cmacexp.plants.mujoco_model import Torso, check_inertia, check_masses
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array


class MujocoQuadruped:
    """A floating body on four planar legs with point feet.

    A spring and a damper hold a foot at the point where it touched down, as long as their force stays within the
    limit of friction; beyond it the foot drags the point along.
    """

    @dataclass
    class Config(ComponentConfig):
        """Integration, friction of the feet, inertia of the body, and where the joints start."""

        substeps: int = number("", at_least=1, at_most=10000)
        """Runge-Kutta steps per sampling period."""
        friction: float = number("", above=0, at_most=10)
        """Largest tangential over normal force of a foot (Coulomb)."""
        friction_stiffness: float = number("N/m", above=0, at_most=1e6)
        """Stiffness of the spring that holds a sticking foot."""
        friction_damping: float = number("N s/m", at_least=0, at_most=1e4)
        """Damping beside that spring."""
        body_inertia: list[float] = number("kg m^2", above=0, at_most=1e3)
        """Inertia of the body without its legs about its x, y and z."""
        start_spread: float = number("rad", at_least=0, at_most=0.5)
        """Largest difference of the joint angles at the start from the planned ones."""
        start_seed: int = number("", at_least=0, below=2**32, needs=("own.start_spread > 0",))
        """Seed of the joint angles at the start."""

        def check(self, config: Config) -> None:
            """Check that masses can have such an inertia, and that MuJoCo accepts both."""
            check_masses(config.machine)
            check_inertia(self.body_inertia)

    engine: MujocoEngine

    def __init__(self, config: Config):
        self.config = config
        self.grip = (config.friction, config.friction_stiffness, config.friction_damping)

    def reset(self, setup: Setup) -> Measurement:
        """Start near the planned joint angles, at rest, the body at its planned height.

        Raises:
            BadInput: the machine has no body, or MuJoCo is not installed.
        """
        check_kind(setup, LEGS_UNDER_BODY, "mujoco_quadruped")
        machine = setup.config.machine
        assert isinstance(machine, QuadrupedMachine)
        touch = Touch(make_ground(setup.config.terrain, setup.config.sampling_period), *self.grip)
        step = setup.config.sampling_period / self.config.substeps
        torso = Torso(machine.body_mass, tuple(self.config.body_inertia))
        payload = make_payload(setup.config.payload, setup.config.sampling_period)
        self.engine = MujocoEngine(setup.mechanism, touch, step, torso, payload)
        self.start_observing(setup.mechanism.hips)
        draw, spread = np.random.default_rng(self.config.start_seed), self.config.start_spread
        self.engine.start(setup.start + draw.uniform(-spread, spread, setup.start.shape))
        return self.measure()

    def start_observing(self, hips: Array) -> None:
        """Begin to observe the machine in the engine; its hips are at ``hips`` (4, 2) in the body frame, m."""
        self.measured = Measured(np.empty((4, 2)), np.empty((4, 2)), np.empty(3), np.empty(3), np.empty(3))
        self.hips, self.torso = hips, self.engine.data.qvel[:6]
        self.observing = observing_body(self.engine.touch.ground, self.engine.bodies, hips, self.torso, self.measured)

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (4, 2), N m, over one sampling period.

        Raises:
            Diverged: MuJoCo warns of its state.
        """
        self.engine.advance(torque, self.config.substeps)
        return self.measure()

    def measure(self) -> Measurement:
        """A copy of the present state."""
        next(self.observing)
        foot, velocity, pose, rate, travel = (part.copy() for part in self.measured)
        engine = self.engine
        return Measurement(engine.q.copy(), engine.dq.copy(), foot, velocity, engine.force.copy(), pose, rate, travel)
