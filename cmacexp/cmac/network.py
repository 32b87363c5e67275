"""The CMAC as an object: addressing and weights, for one leg or any other function."""

from typing import NamedTuple

import numpy as np

from cmacexp.cmac.addressing import Address, InputRange, address_batch, count_outside, displacement
from cmacexp.cmac.memory import Visited, find_entered, read_batch
from cmacexp.cmac.receptive_field import RECEPTIVE_FIELDS, RECTANGULAR, activate_batch
from cmacexp.cmac.rules import PAPER, train_batch
from cmacexp.config.cmac import MOST_POSITIONS, WORD_BYTES, CmacConfig, check_size
from cmacexp.models.mix import MASK
from cmacexp.typing import Array, Cells


class Cmac:
    """A cerebellar model articulation controller (Lin & Song 1997, section 4).

    Args:
        config: size and shape; ``inputs`` and ``range_factor`` are not used here.
        ranges: range of each of the n inputs.
        outputs: outputs on one address.
        seed: seed of the hash, 32 bits.

    Raises:
        BadInput: the memory is too small.
        ValueError: a range is empty.

    Attributes:
        weights: (rows, outputs), float64, zero at first.
        clipped: number of inputs so far that were outside their range, and clipped to it.
        visited: the cells that have a row, with ``addressing=visited``; else None.
    """

    def __init__(self, config: CmacConfig, ranges: InputRange, outputs: int = 2, seed: int = 0):
        inputs = len(ranges.low)
        check_size(config, inputs, outputs)
        if not (np.asarray(ranges.low) < np.asarray(ranges.high)).all():
            raise ValueError(f"ranges from {ranges.low} to {ranges.high}: the lower end must lie below the upper one")
        dense_rows = config.layers * config.resolution_elements**inputs
        fitting = config.memory_bytes // (WORD_BYTES * outputs)
        rows = dense_rows if config.addressing == "dense" else fitting
        self.address = Address(
            InputRange(np.ascontiguousarray(ranges.low, dtype=float), np.ascontiguousarray(ranges.high, dtype=float)),
            # Column-major, since all layers of one input are read together.
            np.asfortranarray(displacement(config.displacement, config.layers, inputs)),
            config.resolution_elements,
            rows,
            config.addressing == "hashed",
            seed & MASK,
        )
        self.visited = Visited(rows, WORD_BYTES * outputs) if config.addressing == "visited" else None
        self.receptive_field = RECEPTIVE_FIELDS[config.receptive_field]
        self.weights = np.zeros((rows, outputs))
        self.clipped = 0

    @property
    def layers(self) -> int:
        """C, the number of rows that every input activates."""
        return int(self.address.displacement.shape[0])

    def cells(self, inputs: Array) -> Cells:
        """Active rows (samples, C) of a batch of inputs (samples, n); counts those that are clipped.

        Raises:
            ValueError: an input is not finite, or the shape is not (samples, n).
            BadInput: more cells are visited than there are rows.
        """
        batch = self._checked(inputs)
        shape = (len(batch), self.layers)
        self.clipped += count_outside(self.address.ranges, batch)
        if self.visited is not None:
            positions = np.empty(shape, dtype=np.uint64)
            address_batch(self.address, batch, positions)
            return self.visited.assign_rows(positions)
        cells = np.empty(shape, dtype=np.uint32)
        address_batch(self.address, batch, cells)
        return cells

    def activation(self, inputs: Array) -> Array:
        """Activation (samples, C) of the cells of a batch of inputs (samples, n).

        Raises:
            ValueError: as :meth:`cells`.
        """
        batch = self._checked(inputs)
        activation = np.ones((len(batch), self.layers))
        if self.receptive_field != RECTANGULAR:
            activate_batch(self.address, self.receptive_field, batch, activation)
        return activation

    def _checked(self, inputs: Array) -> Array:
        batch = np.ascontiguousarray(inputs, dtype=float)
        if batch.ndim != 2 or batch.shape[1] != len(self.address.ranges.low) or not np.isfinite(batch).all():
            expected = len(self.address.ranges.low)
            raise ValueError(f"inputs of shape {batch.shape}: expected finite numbers of shape (samples, {expected})")
        return batch

    def predict(self, inputs: Array) -> Array:
        """Outputs (samples, outputs) for a batch of inputs (samples, n)."""
        output = np.empty((len(inputs), self.weights.shape[1]))
        read_batch(self.weights, self.cells(inputs), self.activation(inputs), output)
        return output

    def update(self, inputs: Array, error: Array, rate: float) -> None:
        """Train with ``error`` (samples, outputs), one sample after the other (eq. 20).

        Raises:
            ValueError: an error is not finite, or a shape does not fit.
        """
        errors = np.ascontiguousarray(error, dtype=float)
        expected = (len(inputs), self.weights.shape[1])
        if errors.shape != expected or not np.isfinite(errors).all():
            raise ValueError(f"error of shape {errors.shape}: expected finite numbers of shape {expected}")
        train_batch(PAPER, self.weights, self.cells(inputs), self.activation(inputs), errors, rate)


class MemoryUse(NamedTuple):
    """Use of memory by the inputs of a path."""

    rows: int
    """Rows of memory."""
    rows_used: int
    """Rows that the path reads and trains."""
    cells_visited: int | None
    """Cells of the CMAC before hashing, over all layers; None if their positions do not fit into 64 bits."""
    cells_colliding: int | None
    """Visited cells that share their row with another one."""
    clipped: int
    """Inputs of the path outside their range."""


def memory_use(cmac: Cmac, inputs: Array, cells: Cells) -> MemoryUse:
    """Use of the memory of ``cmac`` by a path of inputs (samples, n), whose rows are ``cells`` (samples, C)."""
    params = cmac.address
    clipped = count_outside(params.ranges, inputs)
    if cmac.layers * params.resolution_elements ** inputs.shape[1] > MOST_POSITIONS:
        used = np.unique(cells[find_entered(cells)])
        return MemoryUse(params.rows, len(used), None, None, clipped)
    positions = np.empty((len(inputs), cmac.layers), dtype=np.uint64)
    address_batch(params._replace(hashed=False), inputs, positions)
    entered = find_entered(positions)
    visited, first = np.unique(positions[entered], return_index=True)
    used, sharing = np.unique(cells[entered][first], return_counts=True)
    return MemoryUse(params.rows, len(used), len(visited), int(sharing[sharing > 1].sum()), clipped)
