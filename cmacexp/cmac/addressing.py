"""Addressing of a CMAC: every input activates one row of memory per layer."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.cmac.quantiser import InputRange, quantise
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
def address(params: Address, inputs: Array, cells: Cells) -> int:
    """Rows that one input (n,) activates.

    Args:
        params: addressing of the CMAC.
        inputs: (n,): the input.
        cells: (C,): filled with one row per layer.

    Returns:
        Number of inputs outside their range, which are clipped to it.
    """
    layers, dimensions = params.displacement.shape
    quanta = (params.resolution_elements - 1) * layers
    clipped = 0
    # Dense: mixed radix over layer and blocks. Hashed: the same numbers mixed into 32 bits.
    for j in range(layers):
        cells[j] = mix(mix(params.seed, j), dimensions) if params.hashed else j
    for d in range(dimensions):
        quantum, outside = quantise(inputs[d], params.ranges.low[d], params.ranges.high[d], quanta)
        if outside:
            clipped += 1
        whole, rest = quantum // layers, quantum % layers
        for j in range(layers):
            block = whole + 1 if rest + params.displacement[j, d] >= layers else whole
            so_far = int(np.int64(cells[j]))
            cells[j] = mix(so_far, block) if params.hashed else so_far * params.resolution_elements + block
    if params.hashed:
        for j in range(layers):
            cells[j] = (mix(int(np.int64(cells[j])), 0) * params.rows) >> 32
    return clipped


@program
def address_batch(params: Address, inputs: Array, cells: Cells) -> int:
    """Rows that a batch of inputs (samples, n) activates; fills ``cells`` (samples, C); see :func:`address`."""
    clipped = 0
    for k in range(inputs.shape[0]):
        clipped += address(params, inputs[k], cells[k])
    return clipped
