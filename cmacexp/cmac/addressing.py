"""Inputs to quanta, and quanta to cells: the addressing of a CMAC, dense or hashed."""

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cmacexp.jit.compiler import kernel, program
from cmacexp.models.mix import mix
from cmacexp.typing import Array, Cells

Values: TypeAlias = Any
"""A number, or an array of numbers, each of which is treated alike."""
Quanta: TypeAlias = Any
"""An integer, or as many as there are values."""


class InputRange(NamedTuple):
    """Range of every input of a CMAC; n is the number of inputs."""

    low: Array
    """(n,): lower end."""
    high: Array
    """(n,): upper end, above ``low``."""


def spanning(values: Array, factor: float) -> InputRange:
    """Ranges of ``factor`` times the span of each column of ``values`` (samples, n), centred on its middle.

    An input that does not vary gets a range of width 1, which has no effect on the output.
    """
    lowest, highest = values.min(axis=0), values.max(axis=0)
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
    """Rows of memory."""
    hashed: bool
    seed: int
    """Seed of the hash, 32 bits."""


@kernel
def address(params: Address, inputs: Array, cells: Cells) -> None:
    """Rows that one input activates, or each input of a batch.

    Args:
        params: addressing of the CMAC.
        inputs: (n,) or (n, samples): clipped to their ranges.
        cells: (C,) or (C, samples): filled with one row per layer.
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
    return int(((inputs < ranges.low) | (inputs > ranges.high)).sum())
