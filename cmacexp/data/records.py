"""How a run ended, and what happened in it besides its samples: entries of its manifest, as they are found out."""

from dataclasses import dataclass, field
from typing import Any

from cmacexp.config.fields import number
from cmacexp.typing import RESULTS

MOST = 2**63 - 1
"""Largest whole number of a manifest."""


@dataclass(kw_only=True)
class Drift:
    """A drift, as known when it was reported."""

    cycle: int = number("", at_least=0, at_most=MOST)
    """Cycle in which the trend started: the middle of the window in which the feedback was lowest."""
    leg: int = number("", at_least=0, at_most=MOST)
    """The first leg that drifts."""
    named: int = number("", at_least=0, at_most=MOST)
    """Cycle in which the drift was detected."""
    growth: float
    """Factor by which the feedback of that leg grows per cycle, at the time of the report; NaN: not known."""


@dataclass(kw_only=True)
class GuardEvent:
    """What the guard of learning did, and why."""

    cycle: int = number("", at_least=1, at_most=MOST)
    """Cycle in which it acted, from 1."""
    step: int = number("", at_least=0, at_most=MOST)
    cause: str
    restored: int = number("", at_least=0, at_most=MOST)
    """Cycle whose torque acts since then; 0: feedback is alone."""


@dataclass
class LeadEstimate:
    """What a probe of the delay of the feedback gave."""

    cycle: int = number("", at_least=1, at_most=MOST)
    """Cycle before which it ended, from 1."""
    lead: int = number("samples", at_least=0, at_most=MOST)
    """Its result; where the response was not clear that of ``auto``, or after a retreat one more than before."""


@dataclass
class MemoryUse:
    """Use of memory by the inputs of a path."""

    rows: int = number("", at_least=1, at_most=MOST)
    """Rows of memory."""
    rows_used: int = number("", at_least=0, at_most=MOST)
    """Rows that the path reads and trains."""
    cells_visited: int | None = number("", at_least=0, at_most=MOST)
    """Cells of the CMAC before hashing, over all layers; None if their positions do not fit into 64 bits."""
    cells_colliding: int | None = number("", at_least=0, at_most=MOST)
    """Visited cells that share their row with another one."""
    clipped: int = number("", at_least=0, at_most=MOST)
    """Inputs of the path outside their range."""


@dataclass
class DroppedSensor:
    """A force sensor that the controller ignores for good since a step."""

    leg: int = number("", at_least=0, at_most=MOST)
    step: int = number("", at_least=0, at_most=MOST)


@dataclass(kw_only=True)
class CarriedLoad:
    """What the plan used from the end of a cycle on, see :class:`cmacexp.planning.plan.LoadEstimate`."""

    cycle: int = number("", at_least=1, at_most=MOST)
    weight: float = number("N")
    x: float = number("m")
    y: float = number("m")
    slope_x: float = number("m/m")
    slope_y: float = number("m/m")
    measured_weight: float | None = number("N", default=None)
    """Weight that the feet carried in that cycle, of which the plan takes a part, N."""


@dataclass
class RunEnd:
    """How a run ended; while it runs, as if it ended now. All but ``error`` are entries of its manifest."""

    status: str
    """``completed``, ``diverged``, ``fell``, ``interrupted`` or ``failed``; of a damaged run ``not intact``, of one
    without a manifest ``unfinished``."""
    cause: str = ""
    """Why it did not complete: step, time and cause; empty if it did."""
    steps: int = 0
    """Steps that it took."""
    learning_lead: int | None = None
    """Lead of learning at the end, samples."""
    learning_rate: float | None = None
    """Rate of learning at the end."""
    guard: list[GuardEvent] = field(default_factory=list)
    """What the guard of learning did."""
    lead_estimates: list[LeadEstimate] = field(default_factory=list)
    """Estimates of the lead, with ``learning.lead=estimate``."""
    carried: list[CarriedLoad] = field(default_factory=list)
    """What the plan used of the load, with ``force_control.load_sharing=adaptive``."""
    rollout_seconds: float = 0.0
    """Wall time of the closed loop alone, without compiling, s."""
    processor_seconds: float = 0.0
    """Processor time of the same, s."""
    error: Exception | None = None
    """What a component raised."""

    @property
    def is_result(self) -> bool:
        """Whether the run can be compared with others."""
        return self.status in RESULTS

    def list_entries(self) -> dict[str, Any]:
        """Entries of the manifest, by name."""
        return {name: value for name, value in vars(self).items() if name != "error"}
