"""Test vectors of an exported network: what the kernels of the project compute, in double or in single precision.

Kernels are plain Python, so that with arrays of float32 they compute in single precision, operation by operation as C
does.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cmacexp.cmac.addressing import InputRange, activate, address
from cmacexp.export.network import Network
from cmacexp.feedforward.kernels import learn, read_sample
from cmacexp.typing import Array

MIN_STEPS, LEARNING_STEPS = 40, 24
"""Steps of the vectors, and those of them at least that learn."""
MOST_PRODUCTS = 2_000_000
"""Active weights read while single precision is measured, which takes a second or two."""


@dataclass(frozen=True)
class Vectors:
    """Inputs and results of K steps."""

    inputs: Array
    """(K, L, n)."""
    errors: Array
    """(K, L, J): learning error given in each step, N m."""
    torque: Array
    """(K, L, J): N m."""
    loaded: int
    """Checksum of the weights before the first step."""
    learnt: int
    """After the last."""


def checksum(weights: Array) -> int:
    """Sum over the weights of their bits times 2 k + 1, k their number from 0, modulo 2^64."""
    bits = np.ascontiguousarray(weights).view(np.uint64 if weights.itemsize == 8 else np.uint32).ravel()
    factors = 2 * np.arange(bits.size, dtype=np.uint64) + np.uint64(1)
    return int((bits.astype(np.uint64) * factors).sum(dtype=np.uint64))


def _find_cells(network: Network, inputs: Array, real: Any) -> tuple[Any, Array]:
    """Rows and activations (K, L, C) of ``inputs`` (K, L, n) in precision ``real``, or of the plan."""
    if not network.addresses:
        activation = network.params.activation if network.is_weighted else np.ones(network.params.cells.shape)
        return network.params.cells, activation.astype(real)
    shape = (*inputs.shape[:2], network.params.cells.shape[2])
    cells, activation = np.empty(shape, dtype=np.int64), np.ones(shape, dtype=real)
    for i, params in enumerate(network.addresses):
        ranges = InputRange(params.ranges.low.astype(real), params.ranges.high.astype(real))
        # Of 16 bits, because the sum of a float32 and an integer of more is a float64.
        params = params._replace(ranges=ranges, displacement=params.displacement.astype(np.int16))
        found = np.empty((shape[2], len(inputs)), dtype=np.uint64)
        address(params, inputs[:, i].T, found)  # type: ignore[arg-type]  # of 64 bits: positions
        cells[:, i] = found.T
        if network.places:  # the row beyond the last of a cell that has none
            places = network.places[i]
            place = np.searchsorted(places, found.T)
            has_row = places[np.minimum(place, len(places) - 1)] == found.T
            cells[:, i] = np.where(has_row, place, network.params.weights.shape[1])
        if network.is_weighted:
            for k in range(len(inputs)):
                activate(params, network.field, inputs[k, i], activation[k, i])
    return cells, activation


def run_steps(network: Network, inputs: Array, errors: Array, real: Any) -> tuple[Array, Array]:
    """Torque (K, L, J) and weights (L, rows, J) after K steps, from the learnt weights and the first sample on, N m.

    Takes inputs (K, L, n) and learning errors (K, L, J); ``real`` is ``np.float64`` or ``np.float32``.
    """
    legs, rows, joints = network.params.weights.shape
    weights = np.zeros((legs, rows + 1, joints), dtype=real)
    weights[:, :rows] = network.params.weights
    cells, activation = _find_cells(network, inputs.astype(real), real)
    how, given = network.params.learning, errors.astype(real)
    how = how._replace(rate=real(how.rate), rule=how.rule._replace(strength=real(how.rule.strength)))
    params = network.params._replace(cells=cells, activation=activation, weights=weights, learning=how)
    samples, steps = len(network.params.cells), len(cells)
    model_torque = None if network.model_torque is None else network.model_torque.astype(real)
    torque = np.empty(given.shape, dtype=real)
    for k in range(len(given)):
        cycles, back = k // samples, k - 1 - how.lead
        for i in range(legs):
            if back >= 0 or not network.addresses:
                learn(params, i, how.start_step + cycles * steps, back % steps, given[k, i])
                weights[i, rows] = 0.0  # of cells without a row
            read_sample(params, i, k % steps, torque[k, i])
            if model_torque is not None:
                torque[k, i] += model_torque[k % samples, i]
    return torque, weights[:, :rows]


def make_vectors(network: Network, real: Any) -> Vectors:
    """Vectors of a network: torques in double precision, checksums in precision ``real``.

    Inputs are planned ones, then some in their ranges and beyond.
    """
    rng, joints = np.random.default_rng(1997), network.params.weights.shape[2]
    steps = max(MIN_STEPS, network.params.learning.lead + LEARNING_STEPS)
    inputs = network.inputs[np.arange(steps) % len(network.inputs)].copy()
    if network.addresses and not network.places:  # else cells without a row would learn in Python alone
        elsewhere = steps // 3
        for i, params in enumerate(network.addresses):
            low, high = params.ranges
            inputs[-elsewhere:, i] = low + (high - low) * rng.uniform(-0.1, 1.1, (elsewhere, len(low)))
    errors = rng.uniform(-1.0, 1.0, (steps, inputs.shape[1], joints))
    torque, weights = run_steps(network, inputs, errors, np.float64)
    if real != np.float64:
        inputs, errors = inputs.astype(real), errors.astype(real)
        _, weights = run_steps(network, inputs, errors, real)
    return Vectors(inputs, errors, torque, checksum(network.params.weights.astype(real)), checksum(weights))


def measure_single(network: Network, vectors: Vectors) -> tuple[float, float, int]:
    """Largest difference of torques in single from double precision, largest torque, N m, and the steps of both.

    The steps are a cycle of the plan, as far as that is quick, and those of the vectors.
    """
    samples, legs, layers = network.params.cells.shape
    joints = vectors.errors.shape[2]
    steps = max(1, min(samples, MOST_PRODUCTS // (legs * layers * joints)))
    errors = np.random.default_rng(1997).uniform(-1.0, 1.0, (steps, legs, joints))
    double, single = (
        run_steps(network, network.inputs[:steps], errors, real)[0] for real in (np.float64, np.float32)
    )
    of_vectors = run_steps(network, vectors.inputs, vectors.errors, np.float32)[0]
    off = max(float(np.abs(double - single).max()), float(np.abs(vectors.torque - of_vectors).max()))
    return off, float(np.abs(double).max()), steps + len(vectors.errors)
