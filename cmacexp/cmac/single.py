"""CMAC for one input at a time from Python: resuming a compiled generator avoids the 10 us of calling a program."""

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
"""Yielded by :func:`serving` if an input or error is not finite, instead of the number of clipped inputs."""


class Request(NamedTuple):
    """Arrays through which Python and the compiled generator exchange one sample."""

    inputs: Array
    """(n,): inputs, in the units of their ranges."""
    error: Array
    """(outputs,): learning error, in the units of the outputs."""
    rate: Array
    """(1,): learning rate beta; 0: predict without training."""
    output: Array
    """(outputs,): outputs filled by a prediction, in their units."""
    cells: Cells
    """(C,): working array of active rows."""
    activation: Array
    """(C,): working array of activations; ones with rectangular receptive fields."""


@kernel
def serve(params: Address, receptive_field: int, rule: RuleParams, weights: Array, request: Request) -> int:
    """Predict with ``weights`` (rows, outputs) at one input vector, or train them if the rate is not 0.

    Returns the number of clipped inputs, or NOT_FINITE if an input or error is not finite.
    """
    clipped = 0
    trains = request.rate[0] != 0.0
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
    """Yield the result of :func:`serve` each time it is resumed, on the same ``weights`` (rows, outputs)."""
    while True:
        yield serve(params, receptive_field, rule, weights, request)


class Single:
    """CMAC that takes one input vector at a time; its results have the bits of a batch of one."""

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
        self.arrays = params, weights  # compiled code does not keep them alive
        self.resume = serving(params, receptive_field, PAPER, weights, self.request).__next__
