"""Addressing of a CMAC: every input activates one row of memory per layer."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.cmac.quantiser import InputRange, Quanta, quantise
from cmacexp.jit.compiler import kernel, program
from cmacexp.models.mix import mix
from cmacexp.typing import Array, Cells


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
