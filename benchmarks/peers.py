"""The same CMAC work by other programs: vectorised NumPy, and tile coders from PyPI that install with this project.

Every peer has 32 layers over the same ranges, a memory of as many rows, two outputs, and does predict and update.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from cmacexp.cmac.addressing import Address
from cmacexp.models.mix import MASK, MULTIPLIER
from cmacexp.typing import Array, Cells


class Peer(Protocol):
    """A program that predicts and updates a single input (n,), by an error (outputs,)."""

    def step(self, x: Array, error: Array) -> Array:
        """Predict at ``x``, then train there."""
        ...


def _mix(state: np.ndarray, value: np.ndarray | int) -> np.ndarray:
    state = ((state ^ value) * MULTIPLIER) & MASK
    return state ^ (state >> 15)


class NumpyCmac:
    """The hashed CMAC of this project written with whole arrays; finds the same cells."""

    def __init__(self, params: Address, weights: Array, rate: float):
        self.params, self.weights, self.rate = params, np.zeros_like(weights), rate
        layers, inputs = params.displacement.shape
        self.first = _mix(_mix(np.full(layers, params.seed), np.arange(layers)), inputs)

    def cells(self, inputs: Array) -> Cells:
        """Active rows (samples, C) of inputs (samples, n)."""
        params, layers = self.params, len(self.first)
        quanta = (params.resolution_elements - 1) * layers
        low, high = params.ranges.low, params.ranges.high
        scaled = np.floor((np.clip(inputs, low, high) - low) / (high - low) * quanta)
        quantum = np.minimum(scaled.astype(np.int64), quanta - 1)
        blocks = (quantum[:, None, :] + params.displacement) // layers
        state = np.broadcast_to(self.first, blocks.shape[:2])
        for d in range(inputs.shape[1]):
            state = _mix(state, blocks[:, :, d])
        return (_mix(state, 0) * params.rows) >> 32

    def batch(self, inputs: Array, errors: Array) -> Array:
        """Predict a batch, then train with it; where samples share cells, each adds its part."""
        cells = self.cells(inputs)
        output = self.weights[cells].sum(axis=1)
        np.add.at(self.weights, cells, (self.rate / cells.shape[1] * errors)[:, None, :])
        return output

    def step(self, x: Array, error: Array) -> Array:
        """As :meth:`Peer.step`."""
        return self.batch(x[None], error[None])[0]


FindRows = Callable[[Array], Cells | list[int]]
"""Gives the rows that a tile coder activates at an input (n,)."""


class Tiles:
    """Weights, and their use at the rows that a tile coder gives."""

    def __init__(self, params: Address, rate: float, find_rows: FindRows):
        self.find_rows, self.rate = find_rows, rate / len(params.displacement)
        self.weights = np.zeros((params.rows, 2))

    def step(self, x: Array, error: Array) -> Array:
        """As :meth:`Peer.step`."""
        rows = self.find_rows(x)
        output = self.weights[rows].sum(axis=0)
        self.weights[rows] += self.rate * error
        return output


def make_fixed_reps(params: Address) -> FindRows:
    """PyFixedReps-andnp: dense cell numbers from Rust, 32 bits (they overflow with 6 inputs), folded into memory."""
    from PyFixedReps import TileCoder, TileCoderConfig

    ranges = list(zip(*params.ranges, strict=True))
    size = (params.resolution_elements, *params.displacement.shape)
    coder = TileCoder(TileCoderConfig(*size, input_ranges=ranges, scale_output=False))
    return lambda x: coder.get_indices(x) % params.rows


def make_linear_rl(params: Address) -> FindRows:
    """linear-rl: R. Sutton's tiles3 in Python, hashed into the same memory."""
    from linear_rl.tyles3 import tiles

    low, high = params.ranges
    scale, layers = (params.resolution_elements - 1) / (high - low), len(params.displacement)
    return lambda x: tiles(params.rows, layers, ((x - low) * scale).tolist())


TILE_CODERS = {"PyFixedReps-andnp": make_fixed_reps, "linear-rl (tiles3)": make_linear_rl}


def installed(params: Address, rate: float) -> dict[str, Peer]:
    """The peers from PyPI that this machine has, by name."""
    peers: dict[str, Peer] = {}
    for name, make in TILE_CODERS.items():
        try:
            peers[name] = Tiles(params, rate, make(params))
        except ImportError:
            print(f"{name} is not installed: left out")
    return peers
