"""Feedforward by inverse dynamics along the desired path, with a model that may have errors."""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import Config as RunConfig
from cmacexp.config import FeedforwardConfig, number
from cmacexp.config.machine import RobotMachine, check_gravity_factors, gravity_factors
from cmacexp.config.schema import AUTO
from cmacexp.errors import require
from cmacexp.feedforward.network import BuiltInFeedforward, known_torque, play_earlier
from cmacexp.models.ground import contact_force
from cmacexp.models.mechanism import planned_torque
from cmacexp.planning.machine import planned_torques
from cmacexp.planning.plan import Setup
from cmacexp.planning.reference import Y
from cmacexp.typing import Array


class InverseDynamics(BuiltInFeedforward):
    """Inverse dynamics along the desired path (Lin & Song 1997, eq. 16, 17).

    The contact force is that of the desired depression, also in transfer, because the path leaves the ground only on
    its way up.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Errors of the model."""

        mass_factor: float = number(
            "", above=0, at_most=1e3, needs=("machine.kind != 'point_mass' or gait.pattern != 'standing'",)
        )
        """Masses of the model / true masses."""
        length_factor: float = number("", above=0, at_most=1e3, needs=("machine.kind != 'point_mass'",))
        """Link lengths of the model / true lengths; joint angles are planned with the true lengths."""
        advance: float | str = number("s", at_least=0, at_most=1, words=(AUTO,), default=0.0)
        """Time by which the torque of the model is played earlier; auto: declared delay + lag of the actuator."""
        gravity_factors: list[float] = gravity_factors()
        """Factors of the four terms of the gravity vector in the model, see :data:`GRAVITY_TERMS` (assumed)."""

        def check(self, config: RunConfig) -> None:
            """Check the number of factors of the gravity vector; raise BadInput otherwise."""
            check_gravity_factors("feedforward", self.gravity_factors)

    config: Config

    def count_advance(self, setup: Setup) -> float:
        """Return ``feedforward.advance`` in samples, which need not be whole."""
        actuator = setup.config.actuator
        period = setup.config.sampling_period
        advance = self.config.advance
        return actuator.delay + actuator.lag / period if isinstance(advance, str) else advance / period

    def reset(self, setup: Setup) -> None:
        """Compute the torque of every sample of the cycle."""
        self.params = known_torque(setup, self.compute_torque(setup))

    def compute_torque(self, setup: Setup) -> Array:
        """Compute the torque (N, L, J) to play at every sample of the cycle, N m.

        It is that of the plan ``feedforward.advance`` later, and excludes J^T F_d if the controller adds that torque.
        Raises BadInput for a robot with a length factor other than 1: the link lengths of its model are fixed.
        """
        return play_earlier(self._compute_planned(setup), self.count_advance(setup))

    def _compute_planned(self, setup: Setup) -> Array:
        plan = setup.plan
        controller_adds_force = setup.config.reference == "force_feedforward"
        if isinstance(setup.config.machine, RobotMachine):
            require(
                self.config.length_factor == 1.0,
                "feedforward.length_factor",
                self.config.length_factor,
                "must be 1 with machine.kind=robot, whose links are those of its model",
            )
            force = np.zeros_like(plan.force_desired) if controller_adds_force else plan.force_desired
            motion = plan.joints, plan.sway, plan.force_desired
            return planned_torques(setup.config, setup.mechanism, *motion, force, self.config.mass_factor)
        factors = (
            [self.config.length_factor] * 2 + [self.config.mass_factor] * 2 + [1.0, *self.config.gravity_factors]
        )
        added = np.where(plan.support & controller_adds_force, plan.force_desired, 0.0)
        mechanism = setup.mechanism._replace(legs=setup.mechanism.legs * np.array(factors))
        depression = plan.desired.position[..., Y] - mechanism.hip_height
        force = np.vectorize(contact_force, otypes=[float])(setup.config.assumed_stiffness, depression) - added
        return planned_torque(mechanism, *plan.joints, force)
