"""The same CMAC computation by other programs: vectorised NumPy, and tile coders from PyPI.

Every peer has 32 layers over the same ranges, equally many memory rows and two outputs; it predicts and trains.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from cmacexp.cmac.addressing import Address
from cmacexp.models.mix import MASK, MULTIPLIER
from cmacexp.typing import Array, Cells


class Peer(Protocol):
    """A program that predicts at a single input (n,) and updates with an error (outputs,)."""

    def step(self, x: Array, error: Array) -> Array:
        """Return the prediction (outputs,) at ``x`` (n,), then train there with ``error`` (outputs,)."""
        ...


def _mix(state: np.ndarray, value: np.ndarray | int) -> np.ndarray:
    state = ((state ^ value) * MULTIPLIER) & MASK
    return state ^ (state >> 15)


class NumpyCmac:
    """The hashed CMAC of this project in vectorised NumPy; activates the same cells."""

    def __init__(self, params: Address, weights: Array, rate: float):
        self.params = params
        self.weights = np.zeros_like(weights)
        self.rate = rate
        layers, inputs = params.displacement.shape
        self.first = _mix(_mix(np.full(layers, params.seed), np.arange(layers)), inputs)

    def cells(self, inputs: Array) -> Cells:
        """Return the active memory rows (samples, C) of inputs (samples, n)."""
        params = self.params
        layers = len(self.first)
        quanta = (params.resolution_elements - 1) * layers
        low, high = params.ranges
        scaled = np.floor((np.clip(inputs, low, high) - low) / (high - low) * quanta)
        quantum = np.minimum(scaled.astype(np.int64), quanta - 1)
        blocks = (quantum[:, None, :] + params.displacement) // layers
        state = np.broadcast_to(self.first, blocks.shape[:2])
        for d in range(inputs.shape[1]):
            state = _mix(state, blocks[:, :, d])
        return (_mix(state, 0) * params.rows) >> 32

    def batch(self, inputs: Array, errors: Array) -> Array:
        """Return predictions for a batch, then train with it; updates of cells that samples share add up."""
        cells = self.cells(inputs)
        output = self.weights[cells].sum(axis=1)
        np.add.at(self.weights, cells, (self.rate / cells.shape[1] * errors)[:, None, :])
        return output

    def step(self, x: Array, error: Array) -> Array:
        """Predict and train at a single input; see :meth:`Peer.step`."""
        return self.batch(x[None], error[None])[0]


FindRows = Callable[[Array], Cells | list[int]]
"""Function from an input (n,) to the rows that a tile coder activates."""


class Tiles:
    """Weights of a tile coder, read and trained at the rows that it activates."""

    def __init__(self, params: Address, rate: float, find_rows: FindRows):
        self.find_rows = find_rows
        self.rate = rate / len(params.displacement)
        self.weights = np.zeros((params.rows, 2))

    def step(self, x: Array, error: Array) -> Array:
        """Predict and train at a single input; see :meth:`Peer.step`."""
        rows = self.find_rows(x)
        output = self.weights[rows].sum(axis=0)
        self.weights[rows] += self.rate * error
        return output


def make_fixed_reps(params: Address) -> FindRows:
    """Make the tile coder of PyFixedReps-andnp (Rust).

    Its dense 32-bit cell numbers, which overflow with 6 inputs, are taken modulo the number of memory rows.
    """
    from PyFixedReps import TileCoder, TileCoderConfig

    ranges = list(zip(*params.ranges, strict=True))
    size = (params.resolution_elements, *params.displacement.shape)
    coder = TileCoder(TileCoderConfig(*size, input_ranges=ranges, scale_output=False))
    return lambda x: coder.get_indices(x) % params.rows


def make_linear_rl(params: Address) -> FindRows:
    """Make the tile coder of linear-rl: R. Sutton's tiles3 in Python, hashed into the same number of memory rows."""
    from linear_rl.tyles3 import tiles

    low, high = params.ranges
    scale = (params.resolution_elements - 1) / (high - low)
    return lambda x: tiles(params.rows, len(params.displacement), ((x - low) * scale).tolist())


TILE_CODERS = {"PyFixedReps-andnp": make_fixed_reps, "linear-rl (tiles3)": make_linear_rl}


def installed(params: Address, rate: float) -> dict[str, Peer]:
    """Return the installed tile coders from PyPI by name; print which are missing."""
    peers: dict[str, Peer] = {}
    for name, make in TILE_CODERS.items():
        try:
            peers[name] = Tiles(params, rate, make(params))
        except ImportError:
            print(f"{name} is not installed: left out")
    return peers
