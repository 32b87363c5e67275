"""Inverse dynamics along the desired path, with a model that may be wrong."""

from dataclasses import dataclass

import numpy as np

from cmacexp.config import FeedforwardConfig, number
from cmacexp.config.machine import RobotMachine
from cmacexp.errors import require
from cmacexp.feedforward.network import BuiltInFeedforward, known_torque
from cmacexp.models.ground import contact_force
from cmacexp.models.mechanism import planned_torque
from cmacexp.planning.machine import planned_torques
from cmacexp.planning.plan import Setup
from cmacexp.planning.reference import Y
from cmacexp.typing import Array


class InverseDynamics(BuiltInFeedforward):
    """Inverse dynamics along the desired path (Lin & Song 1997, eq. 16, 17).

    The contact force is that of the desired depression, in transfer too: the path leaves the ground on the way up.
    """

    @dataclass
    class Config(FeedforwardConfig):
        """Errors of the model."""

        mass_factor: float = number(
            "", above=0, at_most=1e3, needs=("machine.kind != 'point_mass' or gait.pattern != 'standing'",)
        )
        """Masses of the model over the true ones."""
        length_factor: float = number("", above=0, at_most=1e3, needs=("machine.kind != 'point_mass'",))
        """Lengths of the model's links over the true ones; joint angles are planned with the true ones."""

    config: Config

    def reset(self, setup: Setup) -> None:
        """Compute the torque of every sample of the cycle."""
        self.params = known_torque(setup, self.compute_torque(setup))

    def compute_torque(self, setup: Setup) -> Array:
        """Torque (N, L, J) of every sample of the cycle, N m; without J^T F_d where the controller adds it.

        Raises BadInput of a robot, whose model cannot have links of another length.
        """
        adds, plan = setup.config.reference == "force_feedforward", setup.plan
        if isinstance(setup.config.machine, RobotMachine):
            require(
                self.config.length_factor == 1.0,
                "feedforward.length_factor",
                self.config.length_factor,
                "must be 1 with machine.kind=robot, whose links are those of its model",
            )
            forces = plan.force_desired, np.zeros_like(plan.force_desired) if adds else plan.force_desired
            motion = plan.joints, plan.sway
            return planned_torques(setup.config, setup.mechanism, *motion, *forces, self.config.mass_factor)
        factors = [self.config.length_factor] * 2 + [self.config.mass_factor] * 2 + [1.0]
        added = np.where(plan.support, plan.force_desired, 0.0) if adds else np.zeros(plan.support.shape)
        mechanism = setup.mechanism._replace(legs=setup.mechanism.legs * np.array(factors))
        depression = plan.desired.position[..., Y] - mechanism.hip_height
        force = np.vectorize(contact_force, otypes=[float])(setup.config.assumed_stiffness, depression) - added
        return planned_torque(mechanism, *plan.joints, force)
