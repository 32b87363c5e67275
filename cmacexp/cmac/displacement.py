"""Displacement of the layers of a CMAC relative to each other.

Layer j is displaced by j times a vector, modulo the number of layers, along each input. Where every component is
coprime with the number of layers, one quantum along one input changes the cell of exactly one layer.
"""

import math
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput

Vector = NDArray[np.int64]

MOST_CANDIDATES = 400_000
"""Largest number of vectors in the search for the best lattice, with 32 layers."""


def diagonal(layers: int, inputs: int) -> Vector:
    """(1, 1, ..., 1): all layers along the diagonal (Albus 1975), as in the paper."""
    return np.ones(inputs, dtype=np.int64)


def odd_lattice(layers: int, inputs: int) -> Vector:
    """(1, 3, 5, ...): the first odd numbers (Miller & Glanz 1996, UNH CMAC)."""
    vector = 2 * np.arange(inputs, dtype=np.int64) + 1
    return vector % layers if layers > 1 else np.ones(inputs, dtype=np.int64)


def least_distance(vectors: Vector, layers: int) -> NDArray[np.int64]:
    """Squared least distance between two cell corners of the lattice that each row of ``vectors`` spans."""
    shifts = np.arange(1, layers)[None, :, None] * vectors[:, None, :] % layers
    folded = np.minimum(shifts, layers - shifts)
    squared = (folded * folded).sum(axis=2)
    return squared.min(axis=1) if layers > 1 else np.zeros(len(vectors), dtype=np.int64)


def parks_militzer(layers: int, inputs: int) -> Vector:
    """The vector whose lattice has the largest least distance (Parks & Militzer 1991), found by search.

    Mirroring an input and exchanging inputs do not change the distance, so the search is limited to non-decreasing
    vectors that begin with 1, of numbers coprime with the number of layers and at most half of it.

    Raises:
        BadInput: there are too many of them.
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
    best, chosen = -1, vectors[0]
    for part in np.array_split(vectors, max(1, len(vectors) // 4096)):
        distances = least_distance(part, layers)
        if distances.max() > best:
            best, chosen = int(distances.max()), part[int(distances.argmax())]
    return chosen


DISPLACEMENTS = {"diagonal": diagonal, "odd_lattice": odd_lattice, "parks_militzer": parks_militzer}


def displacement(name: str, layers: int, inputs: int) -> NDArray[np.int64]:
    """Shift of every layer along every input, in quanta.

    Args:
        name: ``diagonal``, ``odd_lattice`` or ``parks_militzer``.
        layers: C.
        inputs: n.

    Returns:
        (C, n), each from 0 to C - 1.

    Raises:
        BadInput: a component of the vector shares a factor with the number of layers.
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
