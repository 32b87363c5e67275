"""The base class of the feedforwards that the compiled loop knows, and the params that they set."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from cmacexp.cmac.network import MemoryUse
from cmacexp.cmac.rules import NEIGHBOURS, PAPER, make_rule, spread_shares
from cmacexp.config import ComponentConfig, FeedforwardConfig
from cmacexp.config.cmac import PHASE
from cmacexp.config.schema import REFINE
from cmacexp.errors import require
from cmacexp.feedforward.kernels import (
    CMAC,
    EMPTY,
    EMPTY_CELLS,
    LOGGED,
    REGRESSOR,
    TABLE,
    WEIGHTED,
    FeedforwardParams,
    LearningParams,
    Smoothing,
    WeightLog,
    collect_log,
    feedforward_step,
    find_rows,
    make_room,
)
from cmacexp.planning.plan import Reference, Setup
from cmacexp.typing import Array, Cells, KernelParts, Weights

NO_SMOOTHING = Smoothing(np.zeros(0), np.zeros(1))

exponential = np.vectorize(math.exp, otypes=[float])
"""e^x of each element, by the C library: numpy's own gives other bits where the processor has AVX-512."""


class BuiltInFeedforward(ABC):
    """A feedforward that the compiled loop knows; ``params`` define all that it does.

    A subclass sets them in :meth:`reset`, by :func:`known_torque`, :func:`network` or :func:`regressor`.
    """

    Config: type[ComponentConfig] = FeedforwardConfig
    acts = True
    params: FeedforwardParams
    model_torque: Array | None = None
    """(N, L, J): torque of a model that a network adds to, N m; None: there is none."""
    memory: Sequence[MemoryUse] = ()
    """How the memory of each leg is used; empty without memory."""

    def __init__(self, config: Any):
        self.config = config

    def learnt(self) -> Weights:
        """A copy of what it has learnt; nothing unless a subclass says so."""
        return {}

    @abstractmethod
    def reset(self, setup: Setup) -> None:
        """Compute everything that the plan determines."""

    def collect_memory(self, cycles: int) -> dict[str, Array] | None:
        """Columns (cycles, L) of ``memory.parquet``, by name, for the last ``cycles``; None without weights."""
        if self.params.kind not in (CMAC, WEIGHTED):
            return None
        log = collect_log(self.params.log, self.params.weights, cycles)
        uses = self.memory or [MemoryUse(self.params.weights.shape[1], 0, None, None, 0)]
        colliding = np.array([math.nan if use.cells_colliding is None else use.cells_colliding for use in uses])
        return {
            **{name: log[:, :, column] for column, name in enumerate(LOGGED)},
            "rows": np.broadcast_to(np.array([float(use.rows) for use in uses]), log.shape[:2]),
            "cells_colliding": np.broadcast_to(colliding, log.shape[:2]),
        }

    def kernel_parts(self) -> KernelParts:
        """The params."""
        return {"feedforward": self.params}

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the last step's feedback (L, J), N m, then give this step's torque (L, J), N m."""
        output = np.zeros_like(learning_error)
        feedforward_step(self.params, reference.step, reference.sample, learning_error, output)
        return output


class NoFeedforward(BuiltInFeedforward):
    """Zero torque: feedback alone."""

    Config = ComponentConfig
    acts = False

    def reset(self, setup: Setup) -> None:
        """Set the torque to zero."""
        self.params = known_torque(setup, np.zeros((*setup.plan.support.shape, setup.mechanism.shape[1])))


def planned_inputs(setup: Setup, i: int, names: Sequence[str]) -> Array:
    """Inputs (N, columns) of the networks of leg ``i``.

    Planned angles of the J joints, rad, velocities, rad/s, accelerations, rad/s^2; of the phase cosine and sine.
    """
    samples = len(setup.plan.support)
    by_name = dict(zip(("angle", "velocity", "acceleration"), setup.plan.joints, strict=True))
    inputs = [by_name[name][:, i] for name in names if name != PHASE]
    if PHASE in names:
        turn = [2.0 * math.pi * k / samples for k in range(samples)]
        inputs.append(np.array([[math.cos(angle), math.sin(angle)] for angle in turn]))
    return np.concatenate(inputs, axis=1)


def kernel_norm(cells: Cells, activation: Array) -> float:
    """|K|, without a unit, of K = A A^T / sum a_i^2 over a cycle: its largest sum over a row, of all legs.

    ``cells`` (N, L, C) are the active rows of each sample, ``activation`` (N, L, C) the entries of A.
    """
    power = (activation**2).sum(axis=2, keepdims=True)
    share = np.divide(activation, power, out=np.zeros(cells.shape), where=power > 0.0)
    sums = [np.bincount(cells[:, i].ravel(), share[:, i].ravel()) for i in range(cells.shape[1])]
    return max(float((activation[:, i] * total[cells[:, i]]).sum(axis=1).max()) for i, total in enumerate(sums))


def known_torque(setup: Setup, torque: Array) -> FeedforwardParams:
    """Params of a feedforward whose ``torque`` (N, L, J), N m, is known in advance."""
    legs, joints = setup.mechanism.shape
    cells = np.zeros((1, legs, 1), np.uint32)
    return FeedforwardParams(
        kind=TABLE,
        torque=torque,
        # One compiled loop serves all feedforwards: arrays that one does not use are minimal.
        cells=cells,
        activation=np.zeros((1, legs, 1)),
        weights=np.zeros((legs, 1, joints)),
        learning=LearningParams(np.zeros(legs), 0),
        smoothing=NO_SMOOTHING,
        log=find_rows(cells),
    )


def regressor(setup: Setup, columns: Array, steps: Array, parameters: Array) -> FeedforwardParams:
    """Params of a torque Y a, with parameters a that the joints of a leg share and that learn: a += S U.

    ``columns`` are Y (N, L, J, P), N m per unit of each parameter, ``steps`` S (N, L, P, J) those by which the
    feedback U that a sample caused changes them, ``parameters`` (L, P) a at first. Raises BadInput if the guard is to
    improve a network once a cycle.
    """
    require(setup.config.learning.guard != REFINE, "learning.guard", REFINE, "needs a network; use freeze")
    torque, flat = np.zeros((1, *setup.mechanism.shape)), (*columns.shape[:2], -1)
    rows = np.broadcast_to(np.arange(parameters.shape[1], dtype=np.uint32), (1, *parameters.shape))
    return known_torque(setup, torque)._replace(
        kind=REGRESSOR,
        activation=np.ascontiguousarray(columns.swapaxes(2, 3)).reshape(flat),
        weights=parameters[..., None].copy(),
        learning=LearningParams(
            np.full(len(parameters), setup.rate), setup.lead, share=np.ascontiguousarray(steps).reshape(flat)
        ),
        log=find_rows(rows),
    )


def resample(cycle: Array, samples: int, axis: int = 0) -> Array:
    """Values over a ``cycle`` (..., N, ...), along ``axis``, at as many ``samples``, in the same unit.

    They are linear in the phase between the values given, and periodic.
    """
    known = cycle.shape[axis]
    if known == samples:
        return cycle
    place = np.arange(samples) * (known / samples)
    before = place.astype(int)
    share = np.expand_dims(place - before, [other for other in range(cycle.ndim) if other != axis])
    after: Array = np.take(cycle, (before + 1) % known, axis)
    return after * share + np.take(cycle, before, axis) * (1.0 - share)


def _start_weights(setup: Setup, shape: tuple[int, ...], log: WeightLog) -> Array:
    """Weights of zero, or those of an earlier run."""
    if setup.learnt is None:
        weights = np.zeros(shape)
        for own, rows in zip(weights, log.rows, strict=True):
            own[rows] = 0.0  # the loop would read before it writes: two page faults a page, a third of a short run
        return weights
    weights = np.array(setup.learnt["weights"], dtype=float)
    require(
        weights.shape == shape,
        "learning.start_from",
        setup.config.learning.start_from,
        f"has weights of shape {weights.shape}, this run needs {shape}; give the config that was learnt",
    )
    return weights


def network(
    setup: Setup,
    cells: Cells,
    rows: int,
    activation: Array | None = None,
    taps: Array | None = None,
    log: WeightLog | None = None,
) -> FeedforwardParams:
    """Params of one network per leg, linear in its weights, which are zero at first or those of an earlier run.

    ``cells`` (N, L, C) are the rows of the weights that are active at each sample of the cycle, ``rows`` the number
    of weights of one leg for each of its joints, ``activation`` (N, L, C) those of the cells, 0 or more; None: all 1,
    as in a CMAC. ``taps`` (K,) are of a symmetric filter along the rows, once a cycle, from the middle outwards.
    ``log`` has the rows that ``cells`` use, if they are known.

    Raises BadInput if the learning rule or the earlier weights do not fit the network.
    """
    legs, joints = setup.mechanism.shape
    cells = np.ascontiguousarray(cells, dtype=np.uint32)
    # The paper's law is written for the two joints of a planar leg.
    binary = joints == 2 and (activation is None or bool((activation == 1.0).all()))
    counts = np.broadcast_to(1.0, cells.shape) if activation is None else activation  # which takes no memory
    config = setup.config.learning
    rule = make_rule(config, counts)
    learning = LearningParams(
        np.full(legs, setup.rate),
        setup.lead,
        rule,
        rule == PAPER and binary,
        setup.plan.start_step,
        *(spread_shares(cells, counts, config.window) if rule.teaches == NEIGHBOURS else (EMPTY_CELLS, EMPTY)),
        cycle_rate=setup.rate / kernel_norm(cells, counts) if config.guard == REFINE else 0.0,
    )
    log = make_room(log or find_rows(cells), setup.config.cycles)
    smoothing = NO_SMOOTHING if taps is None else Smoothing(np.ascontiguousarray(taps, dtype=float), np.zeros(rows))
    return FeedforwardParams(
        kind=CMAC if binary else WEIGHTED,
        torque=np.zeros((1, legs, joints)),
        cells=cells,
        activation=np.zeros((1, legs, 1)) if learning.is_paper_rule else np.ascontiguousarray(counts, dtype=float),
        weights=_start_weights(setup, (legs, rows, joints), log),
        learning=learning,
        smoothing=smoothing,
        log=log,
    )
