"""What every part of a run may know before it starts."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from cmacexp.arrays import Array
from cmacexp.config import Config
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.plan import Plan

Weights = Mapping[str, NDArray[Any]]
"""What a feedforward has learnt, and the law by which it is addressed: arrays by name."""


@dataclass(frozen=True)
class Setup:
    """Config, machine, plan and start of a run."""

    config: Config
    mechanism: Mechanism
    plan: Plan
    start: Array
    """(L, 2): joint angles at the start, rad; of a point mass its position, m."""
    learnt: Weights | None = None
    """What the feedforward starts from, by the names that it keeps it under; None: nothing."""
