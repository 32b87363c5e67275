"""The built-in feedforwards as parts that a config can name."""

from collections.abc import Sequence

import numpy as np

from cmacexp.arrays import Array, Cells
from cmacexp.cmac.network import Cmac
from cmacexp.cmac.quantiser import InputRange, spanning
from cmacexp.cmac.rules import NORMALISED, PAPER, RULES, WEIGHT_SMOOTHING, ZERO_PHASE, strength_of
from cmacexp.cmac.spread import spread_shares
from cmacexp.cmac.use import MemoryUse, memory_use
from cmacexp.control.feedforward_law import (
    CMAC,
    NONE,
    TABLE,
    WEIGHTED,
    FeedforwardLaw,
    LearningLaw,
    Smoothing,
    feedforward_step,
)
from cmacexp.control.protocol import Reference
from cmacexp.control.weight_log import new_log, take
from cmacexp.errors import BadInput
from cmacexp.models.ground import contact_force
from cmacexp.models.mechanism import Mechanism, planned_torque
from cmacexp.planning.setup import Setup, Weights

COLUMNS = {"angle": (0, 1), "velocity": (2, 3), "acceleration": (4, 5)}
"""Columns of ``Plan.joints`` that an input names."""
NO_SMOOTHING = Smoothing(np.zeros(0), np.zeros(1))


class BuiltInFeedforward:
    """A feedforward that the fused loop knows; ``law`` says all that it does.

    A subclass gives its law in :meth:`reset`, with :func:`known_torque` or :func:`network`.
    """

    acts = True
    law: FeedforwardLaw
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
        return take(self.law.log, self.law.weights, cycles) if self.law.kind in (CMAC, WEIGHTED) else None

    def predict(self, reference: Reference, taught: Array) -> Array:
        """Learn from the last step's feedback (L, 2), N m, then give this step's torque (L, 2), N m."""
        output = np.zeros_like(taught)
        feedforward_step(self.law, reference.step, reference.sample, taught, output)
        return output


def planned_inputs(setup: Setup, i: int, names: Sequence[str]) -> Array:
    """Planned joint values (N, 2 x names) of leg ``i``: angles in rad, their velocities, accelerations."""
    return setup.plan.joints[:, i, [column for name in names for column in COLUMNS[name]]]


def _learning(setup: Setup, cells: Cells, activation: Array) -> LearningLaw:
    """How a network of these cells and activations (N, L, C) learns."""
    config = setup.config.learning
    rule, strength = RULES[config.rule][0], strength_of(config)
    if rule == WEIGHT_SMOOTHING and activation.shape[2] == 1:
        raise BadInput(
            "learning.rule",
            config.rule,
            "draws active weights to their mean, but here one alone is active at a time; "
            "take at least 2 (cmac.layers), or another rule",
        )
    if rule in (NORMALISED, ZERO_PHASE):
        strength *= float(np.mean((activation**2).sum(axis=2)))
    law = LearningLaw(config.rate, setup.config.lead, rule, strength, setup.plan.start_step)
    if rule != ZERO_PHASE:
        return law
    taught, share = spread_shares(cells, activation, config.window)
    return law._replace(cells=taught, share=share)


def known_torque(setup: Setup, torque: Array | None) -> FeedforwardLaw:
    """A law that gives ``torque`` (N, L, 2), N m, known in advance; None gives none."""
    legs = setup.mechanism.legs.shape[0]
    # One compiled loop fits all laws: what one does not use is empty.
    cells, activation, weights = (
        np.zeros((1, legs, 1), dtype=np.uint32),
        np.zeros((1, legs, 1)),
        np.zeros((legs, 1, 2)),
    )
    kind, table = (NONE, np.zeros((1, legs, 2))) if torque is None else (TABLE, torque)
    learning, log = LearningLaw(0.0, 0), new_log(cells)
    return FeedforwardLaw(kind, np.ascontiguousarray(table), cells, activation, weights, learning, NO_SMOOTHING, log)


def network(
    setup: Setup, cells: Cells, rows: int, activation: Array | None = None, taps: Array | None = None
) -> FeedforwardLaw:
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
    return FeedforwardLaw(
        CMAC if activation is None else WEIGHTED,
        np.zeros((1, legs, 2)),
        cells,
        np.zeros((1, legs, 1)) if activation is None and learning.rule == PAPER else counts,
        np.zeros((legs, rows, 2)),
        learning,
        NO_SMOOTHING if taps is None else Smoothing(np.ascontiguousarray(taps, dtype=float), np.zeros(rows)),
        new_log(cells),
    )


class NoFeedforward(BuiltInFeedforward):
    """Feedback alone."""

    acts = False

    def reset(self, setup: Setup) -> None:
        """Nothing to work out."""
        self.law = known_torque(setup, None)


class InverseDynamics(BuiltInFeedforward):
    """Inverse dynamics along the desired path (Lin & Song 1997, eq. 16, 17).

    The contact force is that of the desired depression, in transfer too: the path leaves the ground on the way up.

    Args:
        mass_factor: masses of the model over the true ones.
        length_factor: lengths of the model's links over the true ones.
    """

    def __init__(self, mass_factor: float = 1.0, length_factor: float = 1.0):
        super().__init__()
        self.mass_factor = mass_factor
        self.length_factor = length_factor

    def _believed(self, mechanism: Mechanism) -> Mechanism:
        lengths, masses = [self.length_factor] * 2, [self.mass_factor] * 2
        return mechanism._replace(legs=mechanism.legs * np.array([*lengths, *masses, 1.0]))

    def reset(self, setup: Setup) -> None:
        """Torque of every sample of the cycle."""
        plan, mechanism = setup.plan, self._believed(setup.mechanism)
        torque = np.zeros((*plan.joints.shape[:2], 2))
        for k in range(torque.shape[0]):
            for i in range(torque.shape[1]):
                q, dq, ddq = plan.joints[k, i].reshape(3, 2)
                depression = plan.desired[k, i, 1] - mechanism.hip_height
                force = contact_force(setup.config.assumed_stiffness, depression)
                torque[k, i] = planned_torque(mechanism, i, q, dq, ddq, force)
        self.law = known_torque(setup, torque)


class CmacFeedforward(BuiltInFeedforward):
    """One CMAC per leg, addressed by planned joint values, trained by the feedback (Lin & Song 1997, section 4)."""

    def reset(self, setup: Setup) -> None:
        """Empty memories, or those of an earlier run with their ranges and hash; the cells of every sample."""
        config, learnt = setup.config, setup.learnt
        inputs = [planned_inputs(setup, i, config.cmac.inputs) for i in range(setup.mechanism.legs.shape[0])]
        if learnt is None:
            ranges, self.seed = [spanning(own, config.cmac.range_factor) for own in inputs], config.seed
        else:
            ranges, self.seed = [InputRange(*ends) for ends in learnt["ranges"]], int(learnt["seed"])
        self.cmacs = [Cmac(config.cmac, own, 2, self.seed) for own in ranges]
        for i, cmac in enumerate(self.cmacs):
            if learnt is not None and cmac.visited is not None:
                cmac.visited.positions = learnt[f"visited_{i + 1}"]
        cells = np.stack([cmac.cells(own) for cmac, own in zip(self.cmacs, inputs, strict=True)], axis=1)
        fields = [cmac.activation(own) for cmac, own in zip(self.cmacs, inputs, strict=True)]
        activation = None if fields[0] is None else np.stack([own for own in fields if own is not None], axis=1)
        self.law = network(setup, cells, self.cmacs[0].address.rows, activation)
        for cmac, own in zip(self.cmacs, self.law.weights, strict=True):
            cmac.weights = own
        if learnt is not None:
            self.law.weights[:] = learnt["weights"]
        self.memory = [memory_use(cmac, own) for cmac, own in zip(self.cmacs, inputs, strict=True)]

    def learnt(self) -> Weights:
        """``weights`` (L, rows, 2), N m; ``ranges`` (L, 2, n) of the inputs, low and high; ``seed`` of the hash.

        With visited addressing also ``visited_1`` and so on, the cells of each leg in the order of their rows.
        """
        ranges = np.stack([np.stack(cmac.address.ranges) for cmac in self.cmacs])
        visited = {
            f"visited_{i + 1}": cmac.visited.positions
            for i, cmac in enumerate(self.cmacs)
            if cmac.visited is not None
        }
        seed = np.array(self.seed, dtype=float)
        return {"weights": self.law.weights.copy(), "ranges": ranges, "seed": seed, **visited}
