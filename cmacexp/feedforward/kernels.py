"""Kernels of feedforwards: a known torque, an adaptive regressor, or a learning network with a log of its weights."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.cmac.memory import find_distinct, read, read_weighted, round_weights, train
from cmacexp.cmac.rules import NEIGHBOURS, PAPER, RuleParams, rate_after, train_by_rule, train_spread
from cmacexp.data.signals import FEEDFORWARD, MEMORY_SIGNALS
from cmacexp.jit.compiler import called_kernel, copy_array, kernel, program
from cmacexp.typing import CLOCK, Array, Cells, Clock, Counts, Scratch, State

LOGGED = tuple(signal.name for signal in MEMORY_SIGNALS if signal.owner == FEEDFORWARD)
"""Columns of the weight log; units as in :data:`cmacexp.data.signals.MEMORY_SIGNALS`."""
NORM, LARGEST, ROWS_USED = (LOGGED.index(name) for name in ("weight_norm", "weight_largest", "rows_used"))


class WeightLog(NamedTuple):
    """Log of the weights of L networks over the cycles begun since it was last collected."""

    rows: Cells
    """(L, M): distinct rows that the plan uses, padded."""
    used: Counts
    """(L,): number of distinct rows."""
    values: Clock
    """(capacity in cycles, L, 3): columns LOGGED at the start of each cycle."""
    begun: Annotated[Counts, CLOCK]
    """(1,): number of cycles begun since the last collection."""


def find_rows(cells: Cells) -> WeightLog:
    """Make a weight log, without capacity, of the rows used by networks with active rows ``cells`` (N, L, C)."""
    distinct = [find_distinct(leg_cells) for leg_cells in np.moveaxis(cells, 1, 0)]
    counts = np.array([len(leg_rows) for leg_rows in distinct], dtype=np.int64)
    rows = np.zeros((len(distinct), counts.max()), dtype=np.uint32)
    for i, leg_rows in enumerate(distinct):
        rows[i, : len(leg_rows)] = leg_rows
    return make_room(WeightLog(rows, counts, np.zeros(0), np.zeros(0, dtype=np.int64)), 0)


def make_room(log: WeightLog, cycles: int) -> WeightLog:
    """Make an empty log of the same rows with a capacity of ``cycles``.

    The capacity covers a whole run, because a real robot cannot wait for the log to be collected.
    """
    values = np.zeros((cycles, len(log.used), len(LOGGED)))
    return log._replace(values=values, begun=np.zeros(1, dtype=np.int64))


@kernel
def log_weights(log: WeightLog, weights: Array, entry: Array) -> None:
    """Fill ``entry`` (L, 3) with the columns LOGGED of the current ``weights`` (L, rows, J), N m."""
    for i in range(weights.shape[0]):
        power = largest = 0.0
        count = 0
        for k in range(log.used[i]):
            row = weights[i, log.rows[i, k]]
            square = peak = 0.0
            for o in range(row.shape[0]):
                square += row[o] * row[o]
                peak = max(peak, abs(row[o]))
            power += square
            largest = max(largest, peak)
            count += 1 if peak > 0.0 else 0
        entry[i, NORM] = math.sqrt(power)
        entry[i, LARGEST] = largest
        entry[i, ROWS_USED] = count


@kernel
def log_cycle(log: WeightLog, weights: Array) -> None:
    """Log the ``weights`` (L, rows, J), N m, at the start of a cycle; count the cycle if the log is full."""
    if log.begun[0] < log.values.shape[0]:
        log_weights(log, weights, log.values[log.begun[0]])
    log.begun[0] += 1


log_weights_now = program(log_weights)


def collect_log(log: WeightLog, weights: Array, cycles: int) -> Array:
    """Return the log (cycles, L, 3) of the last ``cycles`` cycles, with columns LOGGED, and empty it.

    The entries are those at the end of each cycle, the last of which may be incomplete; 0 before the networks learn.
    ``weights`` (L, rows, J), N m, are those at the end of the last cycle.
    """
    entries = np.zeros((cycles, *log.values.shape[1:]))
    begun = int(log.begun[0])
    if begun and cycles:  # a run may end before the first step of a cycle is logged
        entries[cycles - begun : cycles - 1] = log.values[1:begun]
        log_weights_now(log, weights, entries[-1])
    log.begun[0] = 0
    return entries


TABLE, CMAC, WEIGHTED, REGRESSOR = range(4)
"""Kinds of feedforward, see :class:`FeedforwardParams`."""

EMPTY_CELLS: Cells = np.zeros((1, 1, 1), dtype=np.uint32)
EMPTY: Array = np.zeros((1, 1, 1))


class LearningParams(NamedTuple):
    """Parameters with which the weights of L networks learn from the feedback."""

    rate: Array
    """(L,): learning rate beta."""
    lead: int
    """Samples from torque to learning error: U(k-1) trains the cells of step k-1-lead."""
    rule: RuleParams = PAPER
    is_paper_rule: bool = False
    """True for the paper's rule with two joints and activations of 1; activations are then not stored."""
    start_step: int = 0
    """First step of the run in which the network learns."""
    cells: Cells = EMPTY_CELLS
    """(N, L, K): rows that learn from the error of each sample; only with rule ``zero_phase``."""
    share: Array = EMPTY
    """(N, L, K): shares of these rows in the error, see :func:`cmacexp.cmac.rules.spread_shares`; for a REGRESSOR
    (N, L, P J), see :func:`adapt`."""
    cycle_rate: float = 0.0
    """beta / |K| of updates once per cycle, see :func:`correct`; 0 unless ``learning.guard=refine``."""
    weight_step: float = 0.0
    """Step between two weights that the memory can store, N m; 0: float64."""
    weight_limit: float = 0.0
    """Largest absolute weight that a memory with such steps can store, N m."""


class Smoothing(NamedTuple):
    """Symmetric filter over weights, one per sample of the cycle, applied at the start of every cycle."""

    taps: Array
    """(K,): taps from the centre outwards; empty: no filter."""
    room: Scratch
    """(rows,): working array."""


class FeedforwardParams(NamedTuple):
    """Parameters of a built-in feedforward over a cycle of N samples; unused arrays are empty.

    A network is linear in its weights. At every sample C of its weights are active, with activations fixed by the
    plan.
    """

    kind: int
    """TABLE (torque known in advance), CMAC (network with two joints and activations of 1), WEIGHTED (any other
    network) or REGRESSOR, see :func:`adapt`."""
    torque: Array
    """(N, L, J): torque known in advance, N m, to which a network adds its output; (1, L, J) for a network only."""
    cells: Cells
    """(N, L, C): active rows of the networks along the plan."""
    activation: Array
    """(N, L, C): activations of these rows; for WEIGHTED, and for a CMAC whose rule is not the paper's. For a
    REGRESSOR its columns, (N, L, P J), N m per unit of each parameter."""
    weights: State
    """(L, rows, J): weights of the networks, one per leg, N m; for a REGRESSOR its parameters, (L, P, 1)."""
    learning: LearningParams
    smoothing: Smoothing
    log: WeightLog
    feedback: Clock = EMPTY
    """(N, L, J): learning error of each sample, N m; only for a TABLE with ``block`` above 0."""
    block: int = 0
    """Number of samples for which a hook computes the torque of a TABLE at a time; 0: the torque never changes."""


@kernel
def smooth(weights: Array, smoothing: Smoothing) -> None:
    """Filter ``weights`` (rows, J), N m, along their rows, periodically."""
    taps, room = smoothing
    rows = weights.shape[0]
    for o in range(weights.shape[1]):
        copy_array(weights[:, o], room)
        for k in range(rows):
            total = taps[0] * room[k]
            for j in range(1, taps.shape[0]):
                total += taps[j] * (room[(k - j) % rows] + room[(k + j) % rows])
            weights[k, o] = total


@kernel
def learn(params: FeedforwardParams, i: int, step: int, sample: int, learning_error: Array) -> None:
    """Train the network of leg ``i`` at ``sample`` with ``learning_error`` (J,), N m (eq. 20, 21).

    ``step`` counts from 0 over the whole run.
    """
    weights = params.weights[i]
    cells = params.cells[sample, i]
    learning = params.learning
    if learning.is_paper_rule:
        train(weights, cells, learning_error, learning.rate[i])
    elif learning.rule.teaches == NEIGHBOURS:
        train_spread(
            weights,
            learning.cells[sample, i],
            learning.share[sample, i],
            learning_error,
            learning.rate[i],
            learning.rule.strength,
        )
    else:
        rate = rate_after(learning.rule, learning.rate[i], (step - learning.start_step) // params.cells.shape[0])
        train_by_rule(learning.rule, weights, cells, params.activation[sample, i], learning_error, rate)
    if learning.weight_step > 0.0:
        round_weights(weights, cells, learning.weight_step, learning.weight_limit)


@kernel
def read_sample(params: FeedforwardParams, i: int, sample: int, output: Array) -> None:
    """Fill ``output`` (J,) with the torque of the network of leg ``i`` at ``sample``, N m (eq. 18)."""
    if params.kind == CMAC:
        read(params.weights[i], params.cells[sample, i], output)
    else:
        read_weighted(params.weights[i], params.cells[sample, i], params.activation[sample, i], output)


@kernel
def adapt(params: FeedforwardParams, i: int, sample: int, learning_error: Array, output: Array) -> None:
    """Update the P parameters a of the regressor of leg ``i``, a += S U, and fill ``output`` (J,) with Y a, N m.

    The ``learning_error`` U (J,), N m, is that of the last sample. S and Y (P, J) are rows of ``learning.share`` and
    ``activation``, flattened.
    """
    parameters = params.weights[i]
    columns = params.activation[sample, i]
    steps = params.learning.share[(sample - 1 - params.learning.lead) % params.activation.shape[0], i]
    joints = output.shape[0]
    output[...] = 0.0
    for p in range(parameters.shape[0]):
        change = 0.0
        for j in range(joints):
            change += steps[p * joints + j] * learning_error[j]
        parameters[p, 0] += change
        for j in range(joints):
            output[j] += columns[p * joints + j] * parameters[p, 0]


@kernel
def feedforward_step(params: FeedforwardParams, step: int, sample: int, learning_error: Array, output: Array) -> None:
    """Learn from the ``learning_error`` of the last step, then fill the ``output`` of this step (eq. 18, 20, 21).

    Both are (L, J), N m. ``step`` counts from 0 over the run, ``sample`` over the cycle; weights change in place.
    """
    if sample == 0:
        log_cycle(params.log, params.weights)
    for i in range(output.shape[0]):
        if params.kind == TABLE:
            for j in range(output.shape[1]):
                output[i, j] = params.torque[sample, i, j]
                if params.block > 0:
                    params.feedback[sample - 1, i, j] = learning_error[i, j]
        elif params.kind == REGRESSOR:
            adapt(params, i, sample, learning_error[i], output[i])
        else:
            learn(params, i, step, (sample - 1 - params.learning.lead) % params.cells.shape[0], learning_error[i])
            if sample == 0 and params.smoothing.taps.shape[0] > 0:
                smooth(params.weights[i], params.smoothing)
            read_sample(params, i, sample, output[i])
            if params.torque.shape[0] > 1:
                for j in range(output.shape[1]):
                    output[i, j] += params.torque[sample, i, j]


@kernel
def add_output(params: FeedforwardParams, i: int, sign: float, output: Array, torque: Array) -> None:
    """Add ``sign`` times the output of the network of leg ``i`` at every sample to ``torque`` (N, L, J), N m.

    ``output`` (J,) is a working array.
    """
    for k in range(torque.shape[0]):
        read_sample(params, i, k, output)
        for j in range(output.shape[0]):
            torque[k, i, j] += sign * output[j]


@called_kernel
def correct(params: FeedforwardParams, errors: Array, output: Array, torque: Array) -> None:
    """Update a torque once per cycle: u += beta K / |K| e, K = A A^T / sum a_i^2, e the errors shifted by the lead.

    The weights change by beta / |K| A^T e / sum a_i^2, and ``torque`` (N, L, J), N m, by the change of the network
    output. ``errors`` (N, L, J), N m, are the learning errors of the last cycle, ``output`` (J,) is a working array.
    """
    samples = errors.shape[0]
    learning = params.learning
    rate = learning.cycle_rate
    for i in range(errors.shape[1]):
        add_output(params, i, -1.0, output, torque)
        weights = params.weights[i]
        for k in range(samples):
            sample = (k - learning.lead) % samples
            cells = params.cells[sample, i]
            if params.kind == CMAC:
                train(weights, cells, errors[k, i], rate)
            else:
                train_by_rule(PAPER, weights, cells, params.activation[sample, i], errors[k, i], rate)
            if learning.weight_step > 0.0:
                round_weights(weights, cells, learning.weight_step, learning.weight_limit)
        add_output(params, i, 1.0, output, torque)
