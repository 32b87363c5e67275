"""Types that the whole project shares: arrays, and how a run ended."""

from collections.abc import Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure
    from pandas import DataFrame as DataFrame
    from xarray import Dataset as Dataset
else:
    Axes = Figure = DataFrame = Dataset = Any
    """For annotations alone: their libraries are imported where they are needed."""

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Counts = NDArray[np.int64]
Cells = NDArray[np.unsignedinteger[Any]]
"""Rows of CMAC memory; without a sign, so that compiled code need not look for rows that count from the end."""


class Role(NamedTuple):
    """What an array that the loop changes means for the steps that follow; declared where the array is."""

    name: str
    ring_axis: int | None = None
    """Axis of the samples of a ring buffer: that of step k is at k % length."""


STATE, CLOCK, SCRATCH = Role("state"), Role("clock"), Role("scratch")
State = Annotated[Array, STATE]
"""Carried from step to step; learning can amplify it."""
Clock = Annotated[Array, CLOCK]
"""Carried from step to step, but the same for all states: time, distance, flags, logs."""
Scratch = Annotated[Array, SCRATCH]
"""Computed in each step before it is read."""

KernelParts = Mapping[str, Any]
"""Parameters and states by which the loop runs a component without calling it: what ``kernel_parts()`` of the
component returns after its reset, by the names of the fields of :class:`cmacexp.loop.step.Loop`."""
Weights = Mapping[str, NDArray[Any]]
"""What a feedforward has learnt, and the law by which it is addressed: arrays by name."""


class Status(StrEnum):
    """How a run, or a sweep, ended; a member is equal to its text."""

    COMPLETED = "completed"
    FELL = "fell"
    DIVERGED = "diverged"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    BAD_INPUT = "bad input"
    """No job of a sweep could be run."""
    NOT_INTACT = "not intact"
    """Manifest or tables of a run, in a table of runs, are missing or changed."""
    UNFINISHED = "unfinished"
    """Likewise: it was killed before it had any."""


RESULTS = (Status.COMPLETED, Status.FELL, Status.DIVERGED)
"""Statuses of runs that have a result, which can be compared with others."""
ENDS = (*RESULTS, Status.FAILED, Status.INTERRUPTED)
"""What the manifest of a run can say."""
