"""Types of the whole project: arrays, and the status of a run."""

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
    """Only for annotations; their libraries are imported where they are needed."""

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Counts = NDArray[np.int64]
Cells = NDArray[np.unsignedinteger[Any]]
"""Row indices of CMAC memory; unsigned, so that compiled code need not handle indices from the end."""


class Role(NamedTuple):
    """The role of an array that the loop changes, declared with the array."""

    name: str
    ring_axis: int | None = None
    """Axis of the samples of a ring buffer; the sample of step k has index k % length."""


STATE = Role("state")
CLOCK = Role("clock")
SCRATCH = Role("scratch")
State = Annotated[Array, STATE]
"""State that is carried from step to step, and that learning can amplify."""
Clock = Annotated[Array, CLOCK]
"""Values that are carried from step to step but do not depend on the state: time, distance, flags, logs."""
Scratch = Annotated[Array, SCRATCH]
"""Values that every step computes before it reads them."""

Weights = Mapping[str, NDArray[Any]]
"""Learned weights of a feedforward and the parameters of their addressing: arrays by name."""


class Status(StrEnum):
    """The status of a run or a sweep; a member equals its text."""

    COMPLETED = "completed"
    FELL = "fell"
    DIVERGED = "diverged"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    BAD_INPUT = "bad input"
    """A sweep of which no job could be run."""
    NOT_INTACT = "not intact"
    """A run in a table of runs whose manifest or tables are missing or changed."""
    UNFINISHED = "unfinished"
    """A run in a table of runs that was killed before it wrote a manifest."""


RESULTS = (Status.COMPLETED, Status.FELL, Status.DIVERGED)
"""Statuses of runs with a result, which can be compared with other runs."""
ENDS = (*RESULTS, Status.FAILED, Status.INTERRUPTED)
"""Statuses that the manifest of a run can have."""
