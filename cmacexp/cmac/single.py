"""One input at a time, from Python: a compiled generator that is resumed, since calling a program takes 10 us."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cmacexp.cmac.addressing import RECTANGULAR, Address, activate, address
from cmacexp.cmac.memory import read_weighted
from cmacexp.cmac.rules import PAPER, RuleParams, train_by_rule
from cmacexp.jit.compiler import kernel, program
from cmacexp.typing import Array, Cells

NOT_FINITE = -1
"""What :func:`serving` yields for an input or error that is not finite; else the number of clipped inputs."""


class Request(NamedTuple):
    """Arrays through which Python and the generator exchange one sample."""

    inputs: Array
    """(n,): in the units of their ranges."""
    error: Array
    """(outputs,): what teaches, in their units."""
    rate: Array
    """(1,): beta; 0 asks for the output and trains nothing."""
    output: Array
    """(outputs,): filled, in their units."""
    cells: Cells
    """(C,): scratch."""
    activation: Array
    """(C,): scratch; ones with rectangular receptive fields."""


@kernel
def serve(params: Address, receptive_field: int, rule: RuleParams, weights: Array, request: Request) -> int:
    """Predict or train ``weights`` (rows, outputs) at one input (n,); returns as :data:`NOT_FINITE` says."""
    clipped, trains = 0, request.rate[0] != 0.0
    for d in range(request.inputs.shape[0]):
        value = request.inputs[d]
        if not math.isfinite(value):
            return NOT_FINITE
        clipped += value < params.ranges.low[d] or value > params.ranges.high[d]
    for o in range(request.error.shape[0]):
        if trains and not math.isfinite(request.error[o]):
            return NOT_FINITE
    address(params, request.inputs, request.cells)
    if receptive_field != RECTANGULAR:
        activate(params, receptive_field, request.inputs, request.activation)
    if trains:
        train_by_rule(rule, weights, request.cells, request.activation, request.error, request.rate[0])
    else:
        read_weighted(weights, request.cells, request.activation, request.output)
    return clipped


@program
def serving(
    params: Address, receptive_field: int, rule: RuleParams, weights: Array, request: Request
) -> Iterator[int]:
    """:func:`serve` whenever it is resumed, on the same ``weights`` (rows, outputs)."""
    while True:
        yield serve(params, receptive_field, rule, weights, request)


class Single:
    """A CMAC that takes one input at a time, with the bits of a batch of one."""

    def __init__(self, params: Address, receptive_field: int, weights: Array):
        layers = len(params.displacement)
        self.request = Request(
            inputs=np.zeros(len(params.ranges.low)),
            error=np.zeros(weights.shape[1]),
            rate=np.zeros(1),
            output=np.zeros(weights.shape[1]),
            cells=np.zeros(layers, dtype=np.uint32),
            activation=np.ones(layers),
        )
        self.arrays = params, weights  # which compiled code does not keep alive
        self.resume = serving(params, receptive_field, PAPER, weights, self.request).__next__
