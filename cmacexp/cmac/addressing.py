"""Addressing of a CMAC: from inputs to quanta, and from quanta to cells of displaced layers; dense or hashed.

The receptive field gives the activation of a cell as a function of the position of the input in it (Lane, Handelman &
Gelfand 1992).
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
"""Largest number of vectors in the search for the best displacement with 32 layers."""


def diagonal(layers: int, inputs: int) -> Vector:
    """Return the displacement (1, 1, ..., 1) of shape (n,), quanta: diagonal (Albus 1975), as in the paper."""
    return np.ones(inputs, dtype=np.int64)


def odd_lattice(layers: int, inputs: int) -> Vector:
    """Return the displacement (1, 3, 5, ...) of shape (n,), quanta, modulo ``layers`` (Miller & Glanz 1996)."""
    vector = 2 * np.arange(inputs, dtype=np.int64) + 1
    return vector % layers if layers > 1 else np.ones(inputs, dtype=np.int64)


def least_distance(vectors: Vector, layers: int) -> NDArray[np.int64]:
    """Compute the squared least distance (V,), quanta^2, between cell corners for each displacement vector.

    The corners of all layers form a lattice spanned by one of ``vectors`` (V, n), in quanta.
    """
    shifts = np.arange(1, layers)[None, :, None] * vectors[:, None, :] % layers
    folded = np.minimum(shifts, layers - shifts)
    squared = (folded * folded).sum(axis=2)
    return squared.min(axis=1) if layers > 1 else np.zeros(len(vectors), dtype=np.int64)


def parks_militzer(layers: int, inputs: int) -> Vector:
    """Find the displacement (n,), quanta, whose lattice has the largest least distance (Parks & Militzer 1991).

    Mirroring an input and exchanging inputs do not change the distance, so the search covers non-decreasing vectors
    that begin with 1 and consist of numbers coprime with ``layers`` and at most half of it. Raises BadInput if there
    are too many.
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
    blocks = np.array_split(vectors, max(1, len(vectors) // 4096))
    best: Vector = vectors[np.concatenate([least_distance(block, layers) for block in blocks]).argmax()]
    return best


DISPLACEMENTS = {"diagonal": diagonal, "odd_lattice": odd_lattice, "parks_militzer": parks_militzer}


def displacement(name: str, layers: int, inputs: int) -> NDArray[np.int64]:
    """Compute the shift (C, n) of each of C layers along each of n inputs, 0 to C - 1 quanta.

    ``name`` is one of :data:`DISPLACEMENTS`. Raises BadInput if a component of the vector shares a factor with the
    number of layers.
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
"""A number, or an array of numbers that is processed elementwise."""
Quanta: TypeAlias = Any
"""An integer, or an integer array with one quantum per value."""


class InputRange(NamedTuple):
    """Ranges of the n inputs of a CMAC."""

    low: Array
    """(n,): lower limits, in the unit of each input."""
    high: Array
    """(n,): upper limits, above ``low``, in the unit of each input."""


def spanning(values: Array, factor: float) -> InputRange:
    """Make input ranges of ``factor`` times the span of each column of ``values`` (samples, n), about its middle.

    An input that does not vary gets a range of width 1, which has no effect on the output.
    """
    columns = np.ascontiguousarray(values.T)  # contiguous columns make the search for extremes ten times faster
    lowest, highest = columns.min(axis=1), columns.max(axis=1)
    span = np.where(highest > lowest, factor * (highest - lowest), 1.0)
    middle = (lowest + highest) / 2.0
    return InputRange(middle - span / 2.0, middle + span / 2.0)


@kernel
def quantise(value: Values, low: float, high: float, quanta: int) -> Quanta:
    """Return the quantum, 0 to ``quanta - 1``, of a ``value`` or of each array element, clipped to [low, high]."""
    inside = np.minimum(np.maximum(value, low), high)  # clip first: a value far outside would overflow the integer
    return np.minimum(np.int64(np.floor((inside - low) / (high - low) * quanta)), quanta - 1)


class Address(NamedTuple):
    """Parameters of the addressing of a CMAC with C layers and n inputs."""

    ranges: InputRange
    """Input ranges; inputs outside are clipped."""
    displacement: NDArray[np.int64]
    """(C, n): shift of every layer along every input, 0 to C - 1 quanta."""
    resolution_elements: int
    """Cells of a layer along each input; (resolution_elements - 1) x C quanta span a range."""
    rows: int
    """Rows of the memory."""
    hashed: bool
    """True: cells are hashed to rows; False: every cell has its own row."""
    seed: int
    """Seed of the hash, 32 bits."""


@kernel
def address(params: Address, inputs: Array, cells: Cells) -> None:
    """Fill ``cells`` (C,) with the active row of each layer for one input vector (n,), clipped to its ranges.

    For a batch, ``inputs`` are (n, samples) and ``cells`` (C, samples).
    """
    layers, dimensions = params.displacement.shape
    quanta = (params.resolution_elements - 1) * layers
    # Dense: mixed-radix number of layer and blocks. Hashed: layer and blocks mixed into 32 bits.
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
"""Program ``address_batch(params, inputs, cells)``: :func:`address` for a batch.

Its ``inputs`` are (samples, n), and it fills ``cells`` (samples, C).
"""


def count_outside(ranges: InputRange, inputs: Array) -> int:
    """Count the values of ``inputs`` (samples, n) that lie outside their range."""
    return int(np.count_nonzero((inputs < ranges.low) | (inputs > ranges.high)))


RECTANGULAR, LINEAR, CUBIC = range(3)
RECEPTIVE_FIELDS = {"rectangular": RECTANGULAR, "linear": LINEAR, "cubic": CUBIC}
"""Receptive fields over a cell: B-splines of order 1 (constant), 2 (triangle) and 4 (twice differentiable)."""


@kernel
def spline(kind: int, position: float) -> float:
    """Evaluate the B-spline over a cell at ``position`` 0 to 1: at most 1, and 0 at both ends unless RECTANGULAR."""
    if kind == RECTANGULAR:
        return 1.0
    off = abs(2.0 * position - 1.0)
    if kind == LINEAR:
        return max(0.0, 1.0 - off)
    off *= 2.0
    if off <= 1.0:
        return 1.0 - 1.5 * off * off + 0.75 * off * off * off
    rest = max(0.0, 2.0 - off)
    return 0.25 * rest * rest * rest


@kernel
def activate(params: Address, kind: int, inputs: Array, activation: Array) -> None:
    """Fill ``activation`` (C,) with the activations of the cells of one input vector (n,): products of splines.

    They have no unit and are normalised to the sum C, as in the paper, because a product of many splines is small
    almost everywhere; they are all 1 if every product is 0. As long as the sum of products is not 0 the output is
    continuous, because the activation of a cell is 0 where the input leaves it. Inputs are clipped to their ranges.
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
    """Fill ``activation`` (samples, C) for a batch of inputs (samples, n), see :func:`activate`."""
    for k in range(inputs.shape[0]):
        activate(params, kind, inputs[k], activation[k])
