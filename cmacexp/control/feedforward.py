"""The built-in feedforwards as parts that a config can name."""

import numpy as np

from cmacexp.arrays import Array
from cmacexp.cmac.network import Cmac
from cmacexp.cmac.quantiser import spanning
from cmacexp.cmac.use import MemoryUse, memory_use
from cmacexp.control.feedforward_law import CMAC, NONE, TABLE, FeedforwardLaw, feedforward_step
from cmacexp.control.protocol import Reference
from cmacexp.models.ground import contact_force
from cmacexp.models.mechanism import planned_torque
from cmacexp.planning.setup import Setup

COLUMNS = {"angle": (0, 1), "velocity": (2, 3), "acceleration": (4, 5)}
"""Columns of ``Plan.joints`` that a CMAC input names."""


class BuiltInFeedforward:
    """A feedforward that the fused loop knows; ``law`` says all that it does."""

    acts = True
    law: FeedforwardLaw
    memory: list[MemoryUse]
    """Of the memory of each leg; empty for a feedforward without memory."""

    def reset(self, setup: Setup) -> None:
        """Work out everything that the plan fixes."""
        raise TypeError(f"{type(self).__name__} is a base class; choose one of its subclasses")

    def __init__(self) -> None:
        self.memory = []

    def predict(self, reference: Reference, taught: Array) -> Array:
        """Learn from the last step's feedback (L, 2), N m, then give this step's torque (L, 2), N m."""
        output = np.zeros_like(taught)
        feedforward_step(self.law, reference.sample, taught, output)
        return output


def _inputs(setup: Setup, i: int) -> Array:
    """Planned CMAC inputs (N, n) of leg ``i``."""
    return setup.plan.joints[:, i, [column for name in setup.config.cmac.inputs for column in COLUMNS[name]]]


def _law(kind: int, setup: Setup, torque: Array | None = None, cmacs: list[Cmac] | None = None) -> FeedforwardLaw:
    """A law of the given kind; parts that it does not use are empty arrays, so that one compiled loop fits all."""
    legs, config = setup.mechanism.legs.shape[0], setup.config
    cells, weights = np.zeros((1, legs, 1), dtype=np.uint32), np.zeros((legs, 1, 2))
    if cmacs:
        cells = np.stack([cmac.cells(_inputs(setup, i)) for i, cmac in enumerate(cmacs)], axis=1)
        weights = np.zeros((legs, *cmacs[0].weights.shape))
        for cmac, own in zip(cmacs, weights, strict=True):
            cmac.weights = own
    return FeedforwardLaw(
        kind,
        torque if torque is not None else np.zeros((1, legs, 2)),
        np.ascontiguousarray(cells),
        weights,
        config.learning.rate,
        config.lead,
    )


class NoFeedforward(BuiltInFeedforward):
    """Feedback alone."""

    acts = False

    def reset(self, setup: Setup) -> None:
        """Nothing to work out."""
        self.law = _law(NONE, setup)


class InverseDynamics(BuiltInFeedforward):
    """Exact inverse dynamics along the desired path (Lin & Song 1997, eq. 16, 17).

    The contact force is that of the desired depression, in transfer too: the path leaves the ground on the way up.
    """

    def reset(self, setup: Setup) -> None:
        """Torque of every sample of the cycle."""
        plan, mechanism = setup.plan, setup.mechanism
        torque = np.zeros((*plan.joints.shape[:2], 2))
        for k in range(torque.shape[0]):
            for i in range(torque.shape[1]):
                q, dq, ddq = plan.joints[k, i].reshape(3, 2)
                depression = plan.desired[k, i, 1] - mechanism.hip_height
                force = contact_force(setup.config.assumed_stiffness, depression)
                torque[k, i] = planned_torque(mechanism, i, q, dq, ddq, force)
        self.law = _law(TABLE, setup, torque=torque)


class CmacFeedforward(BuiltInFeedforward):
    """One CMAC per leg, addressed by planned joint values, trained by the feedback (Lin & Song 1997, section 4)."""

    def reset(self, setup: Setup) -> None:
        """Empty memories; the cells of every sample of the cycle."""
        config = setup.config
        self.cmacs = [
            Cmac(config.cmac, spanning(_inputs(setup, i), config.cmac.range_factor), 2, config.seed)
            for i in range(setup.mechanism.legs.shape[0])
        ]
        self.law = _law(CMAC, setup, cmacs=self.cmacs)
        self.memory = [memory_use(cmac, _inputs(setup, i)) for i, cmac in enumerate(self.cmacs)]
