"""Feedforwards as kernels: a known torque, a regressor, or a network that learns, with a log of its weights."""

import math
from typing import Annotated, NamedTuple

import numpy as np

from cmacexp.cmac.memory import find_distinct, read, read_weighted, train
from cmacexp.cmac.rules import NEIGHBOURS, PAPER, RuleParams, rate_after, train_by_rule, train_spread
from cmacexp.data.signals import FEEDFORWARD, MEMORY_SIGNALS
from cmacexp.jit.compiler import called_kernel, copy_array, kernel, program
from cmacexp.typing import CLOCK, Array, Cells, Clock, Counts, Scratch, State

LOGGED = tuple(signal.name for signal in MEMORY_SIGNALS if signal.owner == FEEDFORWARD)
NORM, LARGEST, ROWS_USED = (LOGGED.index(name) for name in ("weight_norm", "weight_largest", "rows_used"))


class WeightLog(NamedTuple):
    """Log of L networks over the cycles begun since it was last taken."""

    rows: Cells
    """(L, M): the rows that the plan uses, each once; padded."""
    used: Counts
    """(L,): number of these rows."""
    values: Clock
    """(cycles that it holds, L, 3): as LOGGED, at the start of each of these cycles."""
    begun: Annotated[Counts, CLOCK]
    """(1,): number of these cycles."""


def find_rows(cells: Cells) -> WeightLog:
    """Find the rows that networks use whose active rows are ``cells`` (N, L, C); a log of them without room."""
    legs = [find_distinct(own) for own in np.moveaxis(cells, 1, 0)]
    rows = np.zeros((len(legs), max(map(len, legs))), dtype=np.uint32)
    for own, found in zip(rows, legs, strict=True):
        own[: len(found)] = found
    counts = np.array([len(found) for found in legs], dtype=np.int64)
    return make_room(WeightLog(rows, counts, np.zeros(0), np.zeros(0, dtype=np.int64)), 0)


def make_room(log: WeightLog, cycles: int) -> WeightLog:
    """Make a log of the same rows that has room for so many cycles.

    All of a run have room: a machine on a wire cannot wait for the log to be taken.
    """
    values = np.zeros((cycles, len(log.used), len(LOGGED)))
    return log._replace(values=values, begun=np.zeros(1, dtype=np.int64))


@kernel
def log_weights(log: WeightLog, weights: Array, entry: Array) -> None:
    """Fill ``entry`` (L, 3) with the columns LOGGED of ``weights`` (L, rows, J), N m, now."""
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
    """Log the weights (L, rows, J), N m, at the start of a cycle."""
    if log.begun[0] < log.values.shape[0]:
        log_weights(log, weights, log.values[log.begun[0]])
    log.begun[0] += 1


log_weights_now = program(log_weights)


def collect_log(log: WeightLog, weights: Array, cycles: int) -> Array:
    """Take and empty the log of the last ``cycles`` cycles, the last of which may be short.

    Returns (cycles, L, 3), as LOGGED, at the end of each, whether networks acted in it or not; 0 before they learn.
    ``weights`` (L, rows, J) are as the last of these cycles left them.
    """
    entries = np.zeros((cycles, *log.values.shape[1:]))
    begun = int(log.begun[0])
    if begun and cycles:  # a run may end before the first step of a cycle is kept
        entries[cycles - begun : cycles - 1] = log.values[1:begun]
        log_weights_now(log, weights, entries[-1])
    log.begun[0] = 0
    return entries


TABLE, CMAC, WEIGHTED, REGRESSOR = range(4)

EMPTY_CELLS: Cells = np.zeros((1, 1, 1), dtype=np.uint32)
EMPTY: Array = np.zeros((1, 1, 1))


class LearningParams(NamedTuple):
    """How the weights of a network learn from the feedback."""

    rate: Array
    """(L,): beta."""
    lead: int
    """U(k-1) trains the cells of step k-1-lead."""
    rule: RuleParams = PAPER
    is_paper_rule: bool = False
    """True for the paper's rule of two joints where all activations are 1, so that it needs none."""
    start_step: int = 0
    """First step of the run in which the network learns."""
    cells: Cells = EMPTY_CELLS
    """(N, L, K): rows that learn from the error of each sample; only of ``zero_phase``."""
    share: Array = EMPTY
    """(N, L, K): their shares, see :func:`cmacexp.cmac.rules.spread_shares`; of a regressor (N, L, P J), see
    :func:`adapt`."""
    cycle_rate: float = 0.0
    """beta / |K| of updates once a cycle, see :func:`correct`; 0 unless the guard of learning refines."""


class Smoothing(NamedTuple):
    """A symmetric filter of weights, one per sample, applied at the start of every cycle."""

    taps: Array
    """(K,): from the middle outwards; empty: none."""
    room: Scratch
    """(rows,): working array."""


class FeedforwardParams(NamedTuple):
    """Parameters of a built-in feedforward over a cycle of N samples; those that it does not use are empty.

    A network is linear in its weights: at every sample C of them are active, with activations fixed by the plan.
    """

    kind: int
    """TABLE (torque known in advance), CMAC (two joints, activations of 1), WEIGHTED (by their activations) or
    REGRESSOR, see :func:`adapt`."""
    torque: Array
    """(N, L, J): known torque, N m: all of a table's, or what a network adds to; (1, L, J) of a network alone."""
    cells: Cells
    """(N, L, C): active rows of the networks at the planned inputs."""
    activation: Array
    """(N, L, C): their activations; of WEIGHTED, and of a CMAC whose rule is not the paper's. Of a regressor its
    columns, (N, L, P J), N m per unit of each parameter."""
    weights: State
    """(L, rows, J): weights of the networks, one per leg; of a regressor its parameters, (L, P, 1)."""
    learning: LearningParams
    smoothing: Smoothing
    log: WeightLog
    feedback: Clock = EMPTY
    """(N, L, J): learning error of each sample, N m; only of a table with blocks."""
    block: int = 0
    """Samples for which a hook gives the torque of a table; 0: it is known for the whole run."""


@kernel
def smooth(weights: Array, smoothing: Smoothing) -> None:
    """Filter ``weights`` (rows, J) along their rows, the last of which is a neighbour of the first."""
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
    how = params.learning
    if how.is_paper_rule:
        train(weights, cells, learning_error, how.rate[i])
    elif how.rule.teaches == NEIGHBOURS:
        share = how.share[sample, i]
        train_spread(weights, how.cells[sample, i], share, learning_error, how.rate[i], how.rule.strength)
    else:
        rate = rate_after(how.rule, how.rate[i], (step - how.start_step) // params.cells.shape[0])
        train_by_rule(how.rule, weights, cells, params.activation[sample, i], learning_error, rate)


@kernel
def read_sample(params: FeedforwardParams, i: int, sample: int, output: Array) -> None:
    """The output (J,) of the network of leg ``i`` at ``sample``, N m (eq. 18)."""
    if params.kind == CMAC:
        read(params.weights[i], params.cells[sample, i], output)
    else:
        read_weighted(params.weights[i], params.cells[sample, i], params.activation[sample, i], output)


@kernel
def adapt(params: FeedforwardParams, i: int, sample: int, learning_error: Array, output: Array) -> None:
    """Change the P parameters a that the joints of leg ``i`` share, then fill ``output`` (J,), N m: a += S U, Y a.

    The ``learning_error`` U (J,), N m, is that of the sample before. S and Y (P, J) are rows of ``learning.share``
    and ``activation``, in one piece.
    """
    parameters, columns = params.weights[i], params.activation[sample, i]
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
    """Learn from the last step's ``learning_error``, then fill ``output`` of this step (eq. 18, 20, 21); (L, J), N m.

    ``step`` counts from 0 over the run, ``sample`` over the cycle; weights change in place.
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


@called_kernel
def correct(params: FeedforwardParams, errors: Array, output: Array, torque: Array) -> None:
    """Update a torque once a cycle: u += beta K / |K| e, K = A A^T / sum a_i^2, e the errors shifted by the lead.

    The weights change by beta / |K| A^T e / sum a_i^2, and ``torque`` (N, L, J), N m, by what that changes in their
    output. ``errors`` (N, L, J), N m, are the learning errors of the last cycle, ``output`` (J,) is a working array.
    """
    samples = errors.shape[0]
    for i in range(errors.shape[1]):
        for sign in (-1.0, 1.0):
            for k in range(samples):
                read_sample(params, i, k, output)
                for j in range(output.shape[0]):
                    torque[k, i, j] += sign * output[j]
            if sign < 0.0:
                for k in range(samples):
                    sample = (k - params.learning.lead) % samples
                    if params.kind == CMAC:
                        train(params.weights[i], params.cells[sample, i], errors[k, i], params.learning.cycle_rate)
                    else:
                        train_by_rule(
                            PAPER, params.weights[i], params.cells[sample, i],
                            params.activation[sample, i], errors[k, i], params.learning.cycle_rate,
                        )  # fmt: skip
