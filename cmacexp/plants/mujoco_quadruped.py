"""Four legs under a body that really moves: it floats in MuJoCo, and stands on our elastic ground by friction.

Lin & Song 1997 balance the body in every instant (section 6); here it has mass, so that it rocks, bounces, and goes
only as far as the feet push it.
"""

import numpy as np

from cmacexp.config.machine import QuadrupedMachine
from cmacexp.models.mechanism import LEGS_UNDER_BODY
from cmacexp.planning.setup import Setup
from cmacexp.plants.environment import make_ground, make_payload
from cmacexp.plants.mujoco_engine import MujocoEngine, check_kind
from cmacexp.plants.mujoco_kernels import Measured, Touch, observing_body
from cmacexp.plants.mujoco_model import Torso, check_inertia
from cmacexp.plants.protocol import Measurement
from cmacexp.typing import Array


class MujocoQuadruped:
    """A floating body on four planar legs with point feet.

    A foot sticks where it came down, held by a spring and a damper, until that takes more than friction can give;
    then where it sticks is drawn along.

    Args:
        substeps: integration steps per sampling period.
        friction: tangential over normal force at most (Coulomb).
        friction_stiffness: of that spring, N/m.
        friction_damping: of that damper, N s/m.
        body_inertia: of the body about its own x, y and z, kg m^2.
        start_spread: joint angles start at most so far from the planned ones, rad.
        start_seed: draws where.
    """

    engine: MujocoEngine

    def __init__(
        self,
        substeps: int,
        friction: float,
        friction_stiffness: float,
        friction_damping: float,
        body_inertia: list[float],
        start_spread: float,
        start_seed: int,
    ):
        self.substeps = substeps
        self.grip = (friction, friction_stiffness, friction_damping)
        self.body_inertia = tuple(body_inertia)
        self.start_spread, self.start_seed = start_spread, start_seed

    def reset(self, setup: Setup) -> Measurement:
        """Start near the planned joint angles, at rest, the body at its planned height.

        Raises:
            BadInput: the machine has no body, no masses have such an inertia, or MuJoCo is not installed.
        """
        check_kind(setup, LEGS_UNDER_BODY, "mujoco_quadruped")
        check_inertia(self.body_inertia)
        machine = setup.config.machine
        assert isinstance(machine, QuadrupedMachine)
        touch = Touch(make_ground(setup.config.terrain, setup.config.sampling_period), *self.grip)
        step = setup.config.sampling_period / self.substeps
        torso = Torso(machine.body_mass, self.body_inertia)
        payload = make_payload(setup.config.payload, setup.config.sampling_period)
        self.engine = MujocoEngine(setup.mechanism, touch, step, torso, payload)
        self.look(setup.mechanism.hips)
        draw = np.random.default_rng(self.start_seed)
        self.engine.start(setup.start + draw.uniform(-self.start_spread, self.start_spread, setup.start.shape))
        return self.measure()

    def look(self, hips: Array) -> None:
        """Look at the machine in the engine, whose hips are at ``hips`` (4, 2) in the body frame, m."""
        self.seen = Measured(np.empty((4, 2)), np.empty((4, 2)), np.empty(3), np.empty(3), np.empty(3))
        self.hips, self.torso = hips, self.engine.data.qvel[:6]
        self.observing = observing_body(self.engine.touch.ground, self.engine.bodies, hips, self.torso, self.seen)

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (4, 2), N m, over one sampling period."""
        self.engine.advance(torque, self.substeps)
        return self.measure()

    def measure(self) -> Measurement:
        """What can be measured now."""
        next(self.observing)
        foot, velocity, pose, rate, travel = (part.copy() for part in self.seen)
        engine = self.engine
        return Measurement(engine.q.copy(), engine.dq.copy(), foot, velocity, engine.force.copy(), pose, rate, travel)
