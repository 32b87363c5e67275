"""Receptive fields: activation of a cell, by the place of the input in it (Lane, Handelman & Gelfand 1992)."""

import math

from cmacexp.cmac.addressing import Address
from cmacexp.jit.compiler import kernel, program
from cmacexp.typing import Array

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
