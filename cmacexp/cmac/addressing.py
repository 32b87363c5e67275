"""The addressing of a CMAC: inputs to quanta, and quanta to cells of layers that are displaced; dense or hashed.

A receptive field gives the activation of a cell by the place of the input in it (Lane, Handelman & Gelfand 1992).
"""

import math
from itertools import combinations_with_replacement
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput
from cmacexp.jit.compiler import kernel, program
from cmacexp.models.mix import mix
from cmacexp.typing import Array, Cells

Vector = NDArray[np.int64]

MOST_CANDIDATES = 400_000
"""Largest number of vectors in the search for the best lattice, with 32 layers."""


def diagonal(layers: int, inputs: int) -> Vector:
    """(1, 1, ..., 1) of shape (n,), quanta: all layers along the diagonal (Albus 1975), as in the paper."""
    return np.ones(inputs, dtype=np.int64)


def odd_lattice(layers: int, inputs: int) -> Vector:
    """(1, 3, 5, ...) of shape (n,), quanta: the first odd numbers (Miller & Glanz 1996, UNH CMAC)."""
    vector = 2 * np.arange(inputs, dtype=np.int64) + 1
    return vector % layers if layers > 1 else np.ones(inputs, dtype=np.int64)


def least_distance(vectors: Vector, layers: int) -> NDArray[np.int64]:
    """Squared least distance (V,) between two cell corners of the lattice that each of ``vectors`` (V, n) spans.

    The vectors are in quanta, the squares in quanta^2.
    """
    shifts = np.arange(1, layers)[None, :, None] * vectors[:, None, :] % layers
    folded = np.minimum(shifts, layers - shifts)
    squared = (folded * folded).sum(axis=2)
    return squared.min(axis=1) if layers > 1 else np.zeros(len(vectors), dtype=np.int64)


def parks_militzer(layers: int, inputs: int) -> Vector:
    """The vector (n,), quanta, whose lattice has the largest least distance (Parks & Militzer 1991), found by search.

    Mirroring an input and exchanging inputs do not change the distance, so the search is limited to non-decreasing
    vectors that begin with 1, of numbers coprime with the number of layers and at most half of it. Raises BadInput if
    there are too many of them.
    """
    if layers <= 2:
        return diagonal(layers, inputs)
    coprime = [c for c in range(1, layers // 2 + 1) if math.gcd(c, layers) == 1]
    count = math.comb(len(coprime) + inputs - 2, inputs - 1)
    if count * layers > MOST_CANDIDATES * 32:
        allowed = (
            f"searching {count} vectors for {inputs} inputs and {layers} layers takes too long; "
            "take fewer cmac.layers or cmac.inputs, or cmac.displacement=odd_lattice"
        )
        raise BadInput("cmac.displacement", "parks_militzer", allowed)
    rest = np.array(list(combinations_with_replacement(coprime, inputs - 1)), dtype=np.int64)
    vectors = np.concatenate([np.ones((len(rest), 1), dtype=np.int64), rest.reshape(len(rest), inputs - 1)], axis=1)
    parts = np.array_split(vectors, max(1, len(vectors) // 4096))
    chosen: Vector = vectors[np.concatenate([least_distance(part, layers) for part in parts]).argmax()]
    return chosen


DISPLACEMENTS = {"diagonal": diagonal, "odd_lattice": odd_lattice, "parks_militzer": parks_militzer}


def displacement(name: str, layers: int, inputs: int) -> NDArray[np.int64]:
    """Shift (C, n) of each of C layers along each of n inputs, 0 to C - 1 quanta, by one of :data:`DISPLACEMENTS`.

    Raises BadInput if a component of the vector shares a factor with the number of layers.
    """
    vector = DISPLACEMENTS[name](layers, inputs)
    shared = [int(c) for c in vector if math.gcd(int(c), layers) != 1]
    if shared:
        allowed = (
            f"its component {shared[0]} shares a factor with cmac.layers={layers}, so that layers coincide; "
            "take a power of two of layers, or cmac.displacement=diagonal"
        )
        raise BadInput("cmac.displacement", name, allowed)
    return np.arange(layers)[:, None] * vector[None, :] % layers


Values: TypeAlias = Any
"""A number, or an array of numbers, each of which is treated alike."""
Quanta: TypeAlias = Any
"""An integer, or as many as there are values."""


class InputRange(NamedTuple):
    """Range of every input of a CMAC; n is the number of inputs."""

    low: Array
    """(n,): lower end, in the unit of each input."""
    high: Array
    """(n,): upper end, above ``low``, likewise."""


def spanning(values: Array, factor: float) -> InputRange:
    """Ranges of ``factor`` times the span of each column of ``values`` (samples, n), in its unit, about its middle.

    An input that does not vary gets a range of width 1, which has no effect on the output.
    """
    columns = np.ascontiguousarray(values.T)  # of which the extremes are found in a tenth of the time
    lowest, highest = columns.min(axis=1), columns.max(axis=1)
    span = np.where(highest > lowest, factor * (highest - lowest), 1.0)
    middle = (lowest + highest) / 2.0
    return InputRange(middle - span / 2.0, middle + span / 2.0)


@kernel
def quantise(value: Values, low: float, high: float, quanta: int) -> Quanta:
    """Quantum 0 to ``quanta - 1`` of a value, or of each of an array; outside [low, high] it is clipped."""
    inside = np.minimum(np.maximum(value, low), high)  # before the floor: far outside it would overflow an integer
    return np.minimum(np.int64(np.floor((inside - low) / (high - low) * quanta)), quanta - 1)


class Address(NamedTuple):
    """Parameters of the addressing of a CMAC with C layers and n inputs."""

    ranges: InputRange
    displacement: NDArray[np.int64]
    """(C, n): shift of every layer along every input, 0 to C - 1 quanta."""
    resolution_elements: int
    rows: int
    hashed: bool
    seed: int
    """Seed of the hash, 32 bits."""


@kernel
def address(params: Address, inputs: Array, cells: Cells) -> None:
    """Fill ``cells`` (C,) with the row of each layer that one input (n,), clipped to its range, activates.

    Or (C, samples) with those of a batch of inputs (n, samples).
    """
    layers, dimensions = params.displacement.shape
    quanta = (params.resolution_elements - 1) * layers
    # Dense: mixed radix over layer and blocks. Hashed: the same numbers mixed into 32 bits.
    for j in range(layers):
        cells[j] = mix(mix(params.seed, j), dimensions) if params.hashed else j
    for d in range(dimensions):
        quantum = quantise(inputs[d], params.ranges.low[d], params.ranges.high[d], quanta)
        whole, rest = quantum // layers, quantum % layers
        for j in range(layers):
            block = whole + (rest + params.displacement[j, d] >= layers)
            so_far: Quanta = np.int64(cells[j])
            cells[j] = mix(so_far, block) if params.hashed else so_far * params.resolution_elements + block
    if params.hashed:
        for j in range(layers):
            last: Quanta = np.int64(cells[j])
            cells[j] = (mix(last, 0) * params.rows) >> 32


def _address_together(params: Address, inputs: Array, cells: Cells) -> None:
    address(params, inputs.T, cells.T)


def _address_each(params: Address, inputs: Array, cells: Cells) -> None:
    for k in range(inputs.shape[0]):
        address(params, inputs[k], cells[k])


address_batch = program(_address_each, plain=_address_together)
"""``address_batch(params, inputs, cells)``: rows of inputs (samples, n); fills ``cells`` (samples, C)."""


def count_outside(ranges: InputRange, inputs: Array) -> int:
    """Number of inputs (samples, n) outside their range."""
    return int(np.count_nonzero((inputs < ranges.low) | (inputs > ranges.high)))


RECTANGULAR, LINEAR, CUBIC = range(3)
RECEPTIVE_FIELDS = {"rectangular": RECTANGULAR, "linear": LINEAR, "cubic": CUBIC}
"""B-splines of order 1, 2 and 4 over a block: constant, a triangle, and smooth to the second derivative."""


@kernel
def spline(kind: int, place: float) -> float:
    """Height, at most 1, of the B-spline over a block at ``place`` from 0 to 1; 0 at both ends unless RECTANGULAR."""
    if kind == RECTANGULAR:
        return 1.0
    off = abs(2.0 * place - 1.0)
    if kind == LINEAR:
        return max(0.0, 1.0 - off)
    off *= 2.0
    if off <= 1.0:
        return 1.0 - 1.5 * off * off + 0.75 * off * off * off
    rest = max(0.0, 2.0 - off)
    return 0.25 * rest * rest * rest


@kernel
def activate(params: Address, kind: int, inputs: Array, activation: Array) -> None:
    """Activations, without a unit, of the cells of one input (n,): products of splines, normalised to the sum C.

    The sum is C as in the paper, because a product of many splines is small almost everywhere. As long as that sum is
    not 0 the output is continuous: the input leaves a cell where its activation is 0. Outside its range an input is
    clipped. Fills ``activation`` (C,), with ones if all products are 0.
    """
    layers, dimensions = params.displacement.shape
    quanta = (params.resolution_elements - 1) * layers
    total = 0.0
    for j in range(layers):
        product = 1.0
        for d in range(dimensions):
            low, high = params.ranges.low[d], params.ranges.high[d]
            shifted = (min(max(inputs[d], low), high) - low) / (high - low) * quanta + params.displacement[j, d]
            block = shifted / layers
            product *= spline(kind, block - math.floor(block))
        activation[j] = product
        total += product
    for j in range(layers):
        activation[j] = activation[j] * layers / total if total > 0.0 else 1.0


@program
def activate_batch(params: Address, kind: int, inputs: Array, activation: Array) -> None:
    """:func:`activate` for a batch of inputs (samples, n); fills ``activation`` (samples, C)."""
    for k in range(inputs.shape[0]):
        activate(params, kind, inputs[k], activation[k])
