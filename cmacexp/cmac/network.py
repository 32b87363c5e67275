"""CMAC as an object: addressing and weights, for one leg or any other function."""

import copy
import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike

from cmacexp.cmac.addressing import (
    RECEPTIVE_FIELDS,
    RECTANGULAR,
    Address,
    InputRange,
    activate_batch,
    address_batch,
    count_outside,
)
from cmacexp.cmac.addressing import displacement as find_displacement
from cmacexp.cmac.memory import Visited, find_distinct, find_entered, read_batch
from cmacexp.cmac.rules import PAPER, train_batch
from cmacexp.cmac.single import NOT_FINITE, Single
from cmacexp.config.cmac import MOST_POSITIONS, PHASE, WORD_BYTES, CmacConfig, check_size
from cmacexp.config.fields import read_fields
from cmacexp.data.records import MemoryUse as MemoryUse
from cmacexp.errors import BadInput, require
from cmacexp.models.mix import MASK
from cmacexp.typing import Array, Cells, Counts

DEFAULT_OPTIONS: dict[str, Any] = {
    "memory_bytes": 2**24,
    "addressing": None,
    "displacement": "parks_militzer",
    "receptive_field": "rectangular",
}
"""Default values of the options of a :class:`Cmac`."""


class Cmac:
    """A cerebellar model articulation controller (Lin & Song 1997, section 4) that approximates any function.

    Inputs are a batch (samples, n) or one vector (n,); outputs are (samples, outputs) or (outputs,). An object must
    not be used by several threads at the same time.

    Args:
        low: (n,): lower limit of each input; inputs outside their range are clipped and counted.
        high: (n,): upper limit of each input.
        outputs: number of outputs.
        layers: C, the number of weights that each input activates; generalisation extends over one cell.
        cells: cells of each layer along each input; (cells - 1) x layers quanta span a range.
        seed: seed of the hash, 32 bits.
        **options: any of these:

            memory_bytes: largest memory for weights, B; default 2^24.
            addressing: ``dense``: one row per cell; ``hashed``: cells share rows at random; ``visited``: one row per
                cell visited so far; None (default): dense if that fits into the memory, else hashed.
            displacement: shift of the layers against each other: ``parks_militzer`` (default; by search),
                ``diagonal``, as in the paper, or ``odd_lattice``, which needs a power of two of layers.
            receptive_field: activation of a cell over its width: ``rectangular`` (default; as in the paper),
                ``linear`` or ``cubic``.

    Raises:
        BadInput: a value is out of its range, or the memory is too small.
        ValueError: a range is empty or not one-dimensional.
        TypeError: an option has another name.

    Attributes:
        clipped: number of input values so far that were outside their range.
        visited: table of the cells that have a row, with ``addressing="visited"``; else None.
    """

    def __init__(
        self,
        low: ArrayLike,
        high: ArrayLike,
        outputs: int = 1,
        layers: int = 32,
        cells: int = 33,
        *,
        seed: int = 0,
        **options: Any,
    ):
        ranges = InputRange(np.array(low, dtype=float), np.array(high, dtype=float))
        inputs = ranges.low.size
        dense_rows = layers * cells**inputs
        _require_ranges(ranges)
        require(outputs >= 1, "outputs", outputs, "must be at least 1")
        config = CmacConfig(
            layers=layers,
            resolution_elements=cells,
            inputs=[PHASE],
            range_factor=1.0,
            **(DEFAULT_OPTIONS | options),
        )
        if config.addressing is None:
            fits = dense_rows * outputs * WORD_BYTES <= config.memory_bytes
            config.addressing = "dense" if fits else "hashed"
        check_size(read_fields(CmacConfig, vars(config), "cmac"), inputs, outputs)
        rows = dense_rows if config.addressing == "dense" else config.memory_bytes // (WORD_BYTES * outputs)
        # Column-major, since all layers of one input are read together.
        shifts = np.asfortranarray(find_displacement(config.displacement, layers, inputs))
        self.address = Address(ranges, shifts, cells, rows, config.addressing == "hashed", seed & MASK)
        self.visited = Visited(rows, WORD_BYTES * outputs) if config.addressing == "visited" else None
        self.receptive_field = RECEPTIVE_FIELDS[config.receptive_field]
        self.clipped = 0
        self._outputs = outputs
        self._weights: Array | None = None  # made on first use, because a feedforward assigns its own array
        self._single: Single | None = None

    @classmethod
    def from_config(cls, config: CmacConfig, ranges: InputRange, outputs: int = 2, seed: int = 0) -> "Cmac":
        """Make the CMAC of a config for inputs with ``ranges``; its ``inputs`` and ``range_factor`` are ignored."""
        return cls(
            *ranges,
            outputs,
            config.layers,
            config.resolution_elements,
            memory_bytes=config.memory_bytes,
            addressing=config.addressing,
            displacement=config.displacement,
            receptive_field=config.receptive_field,
            seed=seed,
        )

    def copy_empty(self) -> "Cmac":
        """Return a copy with the same addressing, visited cells and clipped count, but with zero weights."""
        other = copy.copy(self)
        other.visited = None if self.visited is None else replace(self.visited)
        other._weights = other._single = None
        return other

    @property
    def weights(self) -> Array:
        """Weights (rows, outputs), float64, in the units of the outputs; initially zero, and assignable."""
        if self._weights is None:
            self._weights = np.zeros((self.address.rows, self._outputs))
        return self._weights

    @weights.setter
    def weights(self, weights: Array) -> None:
        shape = self.address.rows, self._outputs  # kernels do not check bounds
        if not isinstance(weights, np.ndarray) or weights.shape != shape or weights.dtype != np.float64:
            raise ValueError(f"weights must be an array of shape {shape}, float64")
        self._weights = weights
        self._single = None

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_single": None}  # a generator cannot be copied

    @property
    def layers(self) -> int:
        """Number C of rows that every input activates."""
        return int(self.address.displacement.shape[0])

    def cells(self, inputs: Array) -> Cells:
        """Return the active rows (samples, C) for a batch of ``inputs`` (samples, n), and count clipped values.

        Raises ValueError for inputs of another shape or that are not finite, BadInput if visited cells fill the
        memory.
        """
        batch = self._checked(inputs)
        self.clipped += count_outside(self.address.ranges, batch)
        cells: Any = np.empty((len(batch), self.layers), dtype=np.uint32 if self.visited is None else np.uint64)
        address_batch(self.address, batch, cells)
        return cells if self.visited is None else self.visited.assign_rows(cells)

    def activation(self, inputs: Array) -> Array:
        """Compute the activations (samples, C) of the active cells for a batch of ``inputs`` (samples, n).

        Raises ValueError for inputs of another shape or that are not finite.
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

    def _serve(self, inputs: Array, rate: float, error: Array | None = None) -> Single:
        """Predict at one input vector (n,) if the ``rate`` is 0, else train there with ``error`` (outputs,)."""
        single = self._single = self._single or Single(self.address, self.receptive_field, self.weights)
        request = single.request
        if inputs.shape != request.inputs.shape or (error is not None and error.shape != request.error.shape):
            actual = f"{inputs.shape}" if error is None else f"{inputs.shape} and {error.shape}"
            shapes = f"an input has the shape {request.inputs.shape}, its error {request.error.shape}"
            raise ValueError(f"{actual}: {shapes}")
        request.inputs[:] = inputs
        request.rate[0] = rate
        if error is not None:
            request.error[:] = error
        if clipped := single.resume():
            if clipped == NOT_FINITE:
                raise ValueError(f"input {inputs} or error {error}: expected finite numbers")
            self.clipped += clipped
        return single

    def predict(self, inputs: ArrayLike) -> Array:
        """Compute outputs (samples, outputs) for inputs (samples, n), or (outputs,) for one input vector (n,).

        Raises the errors of :meth:`cells`.
        """
        x = np.asarray(inputs, dtype=float)
        if x.ndim == 1:
            return self.predict(x[None])[0] if self.visited else self._serve(x, 0.0).request.output.copy()
        output = np.empty((len(x), self.weights.shape[1]))
        read_batch(self.weights, self.cells(x), self.activation(x), output)
        return output

    def update(self, inputs: ArrayLike, error: ArrayLike, rate: float) -> None:
        """Train with ``error`` (samples, outputs), one sample after the other (eq. 20).

        A sample moves the output at its input by ``rate`` times ``error``. One input vector (n,) takes an error
        (outputs,). Raises ValueError for arrays of another shape or that are not finite.
        """
        x = np.asarray(inputs, dtype=float)
        errors = np.ascontiguousarray(error, dtype=float)
        if not math.isfinite(rate):
            raise ValueError(f"rate {rate}: expected a finite number")
        if x.ndim == 1:
            if self.visited is None:
                self._serve(x, rate, errors)
                return
            x, errors = x[None], errors[None]
        expected = (len(x), self.weights.shape[1])
        if errors.shape != expected or not np.isfinite(errors).all():
            raise ValueError(f"error of shape {errors.shape}: expected finite numbers of shape {expected}")
        train_batch(PAPER, self.weights, self.cells(x), self.activation(x), errors, rate)

    def save(self, path: str | Path) -> None:
        """Save addressing and weights to a ``.npz`` file."""
        from cmacexp.data.files import write_atomically  # takes longer to import than the rest

        a = self.address
        visited = {} if self.visited is None else {"visited": self.visited.positions}
        settings = [a.resolution_elements, a.rows, int(a.hashed), a.seed, self.clipped, self.receptive_field]
        with write_atomically(Path(path)) as temporary, temporary.open("wb") as file:
            np.savez_compressed(
                file,
                allow_pickle=False,
                weights=self.weights,
                low=a.ranges.low,
                high=a.ranges.high,
                displacement=a.displacement,
                law=np.array(settings),
                **visited,
            )

    @classmethod
    def load(cls, path: str | Path) -> "Cmac":
        """Load a CMAC from a file of :meth:`save`, bit for bit; raises BadInput for any other file."""
        try:
            with np.load(path, allow_pickle=False) as saved:
                return cls._read(saved)
        except (OSError, EOFError, LookupError, TypeError, ValueError, BadZipFile) as error:
            raise BadInput("path", path, f"is no file of Cmac.save, or not whole ({error})") from error

    @classmethod
    def _read(cls, saved: Any) -> "Cmac":
        """Make a CMAC from the arrays of a file.

        Raises OSError, EOFError, LookupError, TypeError, ValueError or BadZipFile for any other file.
        """
        cmac = cls.__new__(cls)
        elements, rows, hashed, seed, cmac.clipped, cmac.receptive_field = (int(value) for value in saved["law"])
        ranges = InputRange(saved["low"], saved["high"])
        shifts = saved["displacement"]
        _require_ranges(ranges)
        cmac.address = Address(ranges, shifts, elements, rows, bool(hashed), seed)
        cmac._outputs = len(saved["weights"].T)
        cmac.weights = saved["weights"]
        layers, inputs = shifts.shape
        positions = saved.get("visited")
        cmac.visited = None if positions is None else Visited(rows, WORD_BYTES * cmac._outputs, positions)
        needed = 1 if hashed else layers * elements**inputs if positions is None else len(positions)
        is_whole = elements > 1 and inputs == len(ranges.low) and ((shifts >= 0) & (shifts < layers)).all()
        if not (rows >= needed and is_whole and cmac.receptive_field in RECEPTIVE_FIELDS.values()):
            raise ValueError("its parts do not fit each other")
        return cmac


def _require_ranges(ranges: InputRange) -> None:
    """Check that lower and upper limits are finite arrays (n,) with low < high; raises ValueError."""
    low, high = ranges
    if (
        low.ndim != 1
        or low.shape != high.shape
        or not (low.size and np.isfinite([low, high]).all() and (low < high).all())
    ):
        raise ValueError(f"ranges from {low} to {high}: must be two arrays (n,), the first below the second")


def find_visited(cmac: Cmac, inputs: Array) -> Counts | None:
    """Find where a path of ``inputs`` (samples, n) first enters each cell: flat indices into (samples, C).

    Cells are those before hashing, so the result does not depend on the seed. Returns None if the numbers of the
    cells do not fit into 64 bits.
    """
    if cmac.layers * cmac.address.resolution_elements ** inputs.shape[1] > MOST_POSITIONS:
        return None
    positions = np.empty((len(inputs), cmac.layers), dtype=np.uint64)
    address_batch(cmac.address._replace(hashed=False), inputs, positions)
    entered = np.flatnonzero(find_entered(positions))
    first: Counts = entered[np.unique(positions.ravel()[entered], return_index=True)[1]]
    return first


def memory_use(cmac: Cmac, inputs: Array, cells: Cells, visited: Counts | None) -> MemoryUse:
    """Compute the memory use of ``cmac`` by a path of ``inputs`` (samples, n) with rows ``cells`` (samples, C).

    ``visited`` is the result of :func:`find_visited` for the path.
    """
    rows = cmac.address.rows
    clipped = count_outside(cmac.address.ranges, inputs)
    if visited is None:
        return MemoryUse(rows, len(find_distinct(cells)), None, None, clipped)
    used, sharing = np.unique(cells.ravel()[visited], return_counts=True)
    return MemoryUse(rows, len(used), len(visited), int(sharing[sharing > 1].sum()), clipped)
