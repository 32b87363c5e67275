"""The built-in feedforwards as parts that a config can name."""

from collections.abc import Sequence

import numpy as np

from cmacexp.cmac.rules import NEIGHBOURS, PAPER, make_rule
from cmacexp.cmac.spread import spread_shares
from cmacexp.cmac.use import MemoryUse
from cmacexp.feedforward.kernels import (
    CMAC,
    NONE,
    TABLE,
    WEIGHTED,
    FeedforwardParams,
    LearningParams,
    Smoothing,
    feedforward_step,
)
from cmacexp.feedforward.weight_log import new_log, take
from cmacexp.planning.columns import JOINT_COLUMNS
from cmacexp.planning.setup import Reference, Setup
from cmacexp.typing import Array, Cells

NO_SMOOTHING = Smoothing(np.zeros(0), np.zeros(1))


class BuiltInFeedforward:
    """A feedforward that the fused loop knows; ``law`` says all that it does.

    A subclass gives its law in :meth:`reset`, with :func:`known_torque` or :func:`network`.
    """

    acts = True
    params: FeedforwardParams
    memory: list[MemoryUse]
    """Of the memory of each leg; empty for a feedforward without memory."""

    def reset(self, setup: Setup) -> None:
        """Work out everything that the plan fixes."""
        raise TypeError(f"{type(self).__name__} is a base class; choose one of its subclasses")

    def __init__(self) -> None:
        self.memory = []

    def take_log(self, cycles: int) -> Array | None:
        """What the weights were at the end of each of the last ``cycles`` cycles, see :func:`weight_log.take`.

        None of a feedforward without weights.
        """
        return take(self.params.log, self.params.weights, cycles) if self.params.kind in (CMAC, WEIGHTED) else None

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the last step's feedback (L, 2), N m, then give this step's torque (L, 2), N m."""
        output = np.zeros_like(learning_error)
        feedforward_step(self.params, reference.step, reference.sample, learning_error, output)
        return output


def planned_inputs(setup: Setup, i: int, names: Sequence[str]) -> Array:
    """Planned joint values (N, 2 x names) of leg ``i``: angles in rad, their velocities, accelerations."""
    return setup.plan.joints[:, i, [column for name in names for column in JOINT_COLUMNS[name]]]


def _learning(setup: Setup, cells: Cells, activation: Array) -> LearningParams:
    """How a network of these cells and activations (N, L, C) learns."""
    config = setup.config.learning
    rule = make_rule(config, activation)
    plain = rule == PAPER and bool((activation == 1.0).all())
    params = LearningParams(config.rate, setup.lead, rule, plain, setup.plan.start_step)
    if rule.teaches != NEIGHBOURS:
        return params
    spread_cells, share = spread_shares(cells, activation, config.window)
    return params._replace(cells=spread_cells, share=share)


def known_torque(setup: Setup, torque: Array | None) -> FeedforwardParams:
    """A law that gives ``torque`` (N, L, 2), N m, known in advance; None gives none."""
    legs = setup.mechanism.legs.shape[0]
    # One compiled loop fits all laws: what one does not use is empty.
    cells, activation, weights = (
        np.zeros((1, legs, 1), dtype=np.uint32),
        np.zeros((1, legs, 1)),
        np.zeros((legs, 1, 2)),
    )
    kind, table = (NONE, np.zeros((1, legs, 2))) if torque is None else (TABLE, torque)
    learning, log = LearningParams(0.0, 0), new_log(cells)
    return FeedforwardParams(
        kind, np.ascontiguousarray(table), cells, activation, weights, learning, NO_SMOOTHING, log
    )


def network(
    setup: Setup, cells: Cells, rows: int, activation: Array | None = None, taps: Array | None = None
) -> FeedforwardParams:
    """A law of one network per leg, linear in its weights, which are zero at first.

    Args:
        setup: of the run.
        cells: (N, L, C): rows of the weights that are active at each sample of the cycle.
        rows: weights of one leg for each of its two outputs.
        activation: (N, L, C): how much each of them counts, 0 or more; None: all fully, as in a CMAC.
        taps: (K,): of a symmetric filter along the rows, from the middle outwards; None: the weights stay as learnt.

    Raises:
        BadInput: the learning rule does not fit the network.
    """
    legs = setup.mechanism.legs.shape[0]
    cells = np.ascontiguousarray(cells, dtype=np.uint32)
    counts = np.ones(cells.shape) if activation is None else np.ascontiguousarray(activation, dtype=float)
    learning = _learning(setup, cells, counts)
    return FeedforwardParams(
        CMAC if (counts == 1.0).all() else WEIGHTED,
        np.zeros((1, legs, 2)),
        cells,
        np.zeros((1, legs, 1)) if learning.plain else counts,
        np.zeros((legs, rows, 2)),
        learning,
        NO_SMOOTHING if taps is None else Smoothing(np.ascontiguousarray(taps, dtype=float), np.zeros(rows)),
        new_log(cells),
    )
