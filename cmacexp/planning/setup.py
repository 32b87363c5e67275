"""What every part of a run may know before it starts."""

from dataclasses import dataclass

from cmacexp.arrays import Array
from cmacexp.config import Config
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.plan import Plan


@dataclass(frozen=True)
class Setup:
    """Config, machine, plan and start of a run."""

    config: Config
    mechanism: Mechanism
    plan: Plan
    start: Array
    """(L, 2): joint angles at the start, rad; of a point mass its position, m."""
