"""The machine of simulated logs without MuJoCo, and the logs."""

from pathlib import Path

import numpy as np

from cmacexp.addons.gap.machine import Machine
from cmacexp.addons.gap.problem import Problem
from cmacexp.addons.gap.replay import Expansion
from cmacexp.addons.gap.signals import Signals
from pipelines.benchmark.simulated_log import (
    COULOMB,
    DELAY,
    INERTIA,
    MODEL,
    NAMES,
    PERIOD,
    ROTORS,
    VISCOUS,
    WEIGHT,
    simulate_log,
)

__all__ = ["COULOMB", "DELAY", "MODEL", "NAMES", "PERIOD", "ROTORS", "VISCOUS", "make_problem", "simulate_log"]


class Pendulums(Machine):
    """What a designer believes of the pendulums: all but their joints."""

    def expand(self, block, angle, velocity, base=None):
        """See :class:`Machine`."""
        rows, bias = angle[:, block], WEIGHT[block] * np.sin(angle[:, block])
        mass = np.repeat(np.diag(INERTIA[block])[None], len(angle), axis=0)
        slopes = np.cos(rows)[:, :, None] * np.diag(WEIGHT[block])
        return Expansion(np.ascontiguousarray(rows), mass, bias, slopes)

    def compute_torque(self, angle, velocity, acceleration, base=None):
        """See :class:`Machine`."""
        return INERTIA * acceleration + WEIGHT * np.sin(angle)


def make_pendulums():
    """The machine, with joints that are generic in its model."""
    losses = np.tile([0.01, 0.1, 0.0, 0.0, 0.1], (len(NAMES), 1))
    ranges, index = np.tile([-2.0, 2.0], (len(NAMES), 1)), np.arange(len(NAMES))
    blocks, hinges = tuple(index[:, None]), np.zeros(len(NAMES), dtype=bool)
    return Pendulums("pendulums", Path("pendulums.xml"), NAMES, None, losses, ranges, index, index, blocks, hinges)


def make_problem(log):
    return Problem(Signals(log), make_pendulums())
