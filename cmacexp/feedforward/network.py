"""Base class of the built-in feedforwards, which the compiled loop runs, and functions that make their parameters."""

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
from cmacexp.typing import Array, Cells, Weights

NO_SMOOTHING = Smoothing(np.zeros(0), np.zeros(1))
"""Filter without taps: weights are not filtered."""

exponential = np.vectorize(math.exp, otypes=[float])
"""e^x of each element by the C library: the bits of np.exp depend on whether the processor has AVX-512."""


class BuiltInFeedforward(ABC):
    """Base class of feedforwards that the compiled loop runs; ``params`` define their behaviour completely.

    A subclass sets ``params`` in :meth:`reset`, by :func:`known_torque`, :func:`network` or :func:`regressor`.
    """

    Config: type[ComponentConfig] = FeedforwardConfig
    acts = True
    params: FeedforwardParams
    model_torque: Array | None = None
    """(N, L, J): torque of a model to which a network adds, N m; None: no model."""
    memory: Sequence[MemoryUse] = ()
    """Memory use of each leg; empty without memory."""

    def __init__(self, config: Any):
        self.config = config

    def learnt(self) -> Weights:
        """Return a copy of the learnt arrays by name, for ``Setup.learnt`` of a later run; empty by default."""
        return {}

    @abstractmethod
    def reset(self, setup: Setup) -> None:
        """Set ``params`` for the plan of a run, starting from arrays learnt in an earlier run if there are any."""

    def collect_memory(self, cycles: int) -> dict[str, Array] | None:
        """Return columns (cycles, L) of ``memory.parquet`` for the last ``cycles``; None without a network."""
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

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the feedback of the last step (L, J), N m; return the torque of this step (L, J), N m."""
        output = np.zeros_like(learning_error)
        feedforward_step(self.params, reference.step, reference.sample, learning_error, output)
        return output


class NoFeedforward(BuiltInFeedforward):
    """Zero feedforward torque: control by feedback only."""

    Config = ComponentConfig
    acts = False

    def reset(self, setup: Setup) -> None:
        """Set the torque to zero."""
        self.params = known_torque(setup, np.zeros((*setup.plan.support.shape, setup.mechanism.shape[1])))


def planned_inputs(setup: Setup, i: int, names: Sequence[str]) -> Array:
    """Compute the planned inputs (N, n) of the network of leg ``i`` at every sample of the cycle.

    ``names`` selects from ``angle``, rad, ``velocity``, rad/s, ``acceleration``, rad/s^2, of the J joints, and
    ``phase``, which adds cosine and sine of the cycle phase as the last two columns.
    """
    samples = len(setup.plan.support)
    by_name = dict(zip(("angle", "velocity", "acceleration"), setup.plan.joints, strict=True))
    inputs = [by_name[name][:, i] for name in names if name != PHASE]
    if PHASE in names:
        phases = [2.0 * math.pi * k / samples for k in range(samples)]
        inputs.append(np.array([[math.cos(phase), math.sin(phase)] for phase in phases]))
    return np.concatenate(inputs, axis=1)


def kernel_norm(cells: Cells, activation: Array) -> float:
    """Compute the infinity norm |K| of K = A A^T / sum a_i^2 over a cycle, the largest of all legs; without a unit.

    ``cells`` (N, L, C) are the active rows of each sample, ``activation`` (N, L, C) the entries of A.
    """
    power = (activation**2).sum(axis=2, keepdims=True)
    share = np.divide(activation, power, out=np.zeros(cells.shape), where=power > 0.0)
    sums = [np.bincount(cells[:, i].ravel(), share[:, i].ravel()) for i in range(cells.shape[1])]
    return max(float((activation[:, i] * total[cells[:, i]]).sum(axis=1).max()) for i, total in enumerate(sums))


def known_torque(setup: Setup, torque: Array) -> FeedforwardParams:
    """Make the parameters of a feedforward whose ``torque`` (N, L, J), N m, is known in advance."""
    legs, joints = setup.mechanism.shape
    cells = np.zeros((1, legs, 1), np.uint32)
    return FeedforwardParams(
        kind=TABLE,
        torque=torque,
        # One compiled loop serves all feedforwards, so unused arrays have minimal size.
        cells=cells,
        activation=np.zeros((1, legs, 1)),
        weights=np.zeros((legs, 1, joints)),
        learning=LearningParams(np.zeros(legs), 0),
        smoothing=NO_SMOOTHING,
        log=find_rows(cells),
    )


def regressor(setup: Setup, columns: Array, steps: Array, parameters: Array) -> FeedforwardParams:
    """Make the parameters of an adaptive regressor: torque Y a, with a += S U.

    The joints of a leg share the parameters a. ``columns`` (N, L, J, P) is Y, N m per unit of each parameter;
    ``steps`` (N, L, P, J) is S, the gain from the feedback U caused by a sample to the parameter change;
    ``parameters`` (L, P) is the initial a. Raises BadInput with ``learning.guard=refine``, which needs a network.
    """
    require(setup.config.learning.guard != REFINE, "learning.guard", REFINE, "needs a network; use freeze")
    flat = (*columns.shape[:2], -1)
    rows = np.broadcast_to(np.arange(parameters.shape[1], dtype=np.uint32), (1, *parameters.shape))
    return known_torque(setup, np.zeros((1, *setup.mechanism.shape)))._replace(
        kind=REGRESSOR,
        activation=np.ascontiguousarray(columns.swapaxes(2, 3)).reshape(flat),
        weights=parameters[..., None].copy(),
        learning=LearningParams(
            np.full(len(parameters), setup.rate), setup.lead, share=np.ascontiguousarray(steps).reshape(flat)
        ),
        log=find_rows(rows),
    )


def _interpolate(cycle: Array, position: Array, axis: int) -> Array:
    """Interpolate a periodic ``cycle`` (..., N, ...) linearly at ``position`` (K,), in samples, along ``axis``."""
    length = cycle.shape[axis]
    before = np.floor(position).astype(int)
    share = np.expand_dims(position - before, [other for other in range(cycle.ndim) if other != axis])
    after: Array = np.take(cycle, (before + 1) % length, axis)
    return after * share + np.take(cycle, before % length, axis) * (1.0 - share)


def resample(cycle: Array, samples: int, axis: int = 0) -> Array:
    """Resample the values over a ``cycle`` (..., N, ...) along ``axis`` to ``samples`` samples, in the same unit.

    Interpolation is linear in the phase and periodic.
    """
    length = cycle.shape[axis]
    return cycle if length == samples else _interpolate(cycle, np.arange(samples) * (length / samples), axis)


def play_earlier(cycle: Array, samples: float) -> Array:
    """Shift the values over a periodic ``cycle`` (N, ...) to earlier samples, by ``samples``, also a fraction."""
    return cycle if samples == 0.0 else _interpolate(cycle, np.arange(len(cycle), dtype=float) + samples, axis=0)


def _start_weights(setup: Setup, shape: tuple[int, ...], log: WeightLog) -> Array:
    """Return zero weights, or those of an earlier run; raises BadInput if its ``shape`` (L, rows, J) differs."""
    if setup.learnt is None:
        weights = np.zeros(shape)
        # A first write here avoids page faults at first reads in the loop, which took a third of a short run.
        for leg_weights, rows in zip(weights, log.rows, strict=True):
            leg_weights[rows] = 0.0
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
    """Make the parameters of one network per leg, with weights that start at zero or from an earlier run.

    A network is linear in its weights. ``cells`` (N, L, C) are their active rows at each sample of the cycle, and
    ``rows`` is the number of weights per leg and joint. ``activation`` (N, L, C) holds the activations of the cells,
    0 or more; None: all 1, as in a CMAC. ``taps`` (K,), from the centre outwards, filter the weights along the rows
    once per cycle. ``log`` is the result of :func:`find_rows` for these cells, if it is available.

    Raises BadInput if the learning rule or the weights of an earlier run do not fit the network.
    """
    legs, joints = setup.mechanism.shape
    cells = np.ascontiguousarray(cells, dtype=np.uint32)
    # The kernels of the paper's rule are written for the two joints of a planar leg.
    binary = joints == 2 and (activation is None or bool((activation == 1.0).all()))
    counts = np.broadcast_to(1.0, cells.shape) if activation is None else activation  # takes no memory
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
