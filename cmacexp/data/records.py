"""Outcome and events of a run besides its samples, as entries of its manifest."""

from dataclasses import dataclass, field
from typing import Any

from cmacexp.config.fields import number
from cmacexp.typing import RESULTS

MOST = 2**63 - 1
"""Largest integer in a manifest."""


@dataclass(kw_only=True)
class Drift:
    """Drift of learning: growing feedback of a leg, as known when it was reported."""

    cycle: int = number("", at_least=0, at_most=MOST)
    """Cycle in which the growth began: the middle of the window with the lowest feedback."""
    leg: int = number("", at_least=0, at_most=MOST)
    """Number of the leg that drifted first."""
    named: int = number("", at_least=0, at_most=MOST)
    """Cycle in which the drift was detected."""
    growth: float
    """Factor by which the feedback of this leg grows per cycle, when it was reported; NaN if unknown."""


@dataclass(kw_only=True)
class GuardEvent:
    """Intervention of the guard of learning."""

    cycle: int = number("", at_least=1, at_most=MOST)
    """Cycle in which the guard intervened, from 1."""
    step: int = number("", at_least=0, at_most=MOST)
    cause: str
    restored: int = number("", at_least=0, at_most=MOST)
    """Cycle whose feedforward torque is repeated from then on; 0: feedback only."""


@dataclass
class LeadEstimate:
    """Result of a probe of the delay from torque to feedback."""

    cycle: int = number("", at_least=1, at_most=MOST)
    """Cycle after the probe, from 1."""
    lead: int = number("samples", at_least=0, at_most=MOST)
    """Estimated lead; if the response was not clear that of ``auto``, or, after a retreat, the former one plus 1."""


@dataclass
class MemoryUse:
    """Memory use of the network of a leg along its planned path."""

    rows: int = number("", at_least=1, at_most=MOST)
    """Number of rows of memory."""
    rows_used: int = number("", at_least=0, at_most=MOST)
    """Number of rows that the path reads and trains."""
    cells_visited: int | None = number("", at_least=0, at_most=MOST)
    """Number of cells visited, before hashing, over all layers; None if their positions do not fit into 64 bits."""
    cells_colliding: int | None = number("", at_least=0, at_most=MOST)
    """Number of visited cells that share their row with another one."""
    clipped: int = number("", at_least=0, at_most=MOST)
    """Number of inputs along the path that lie outside their range."""


@dataclass
class DroppedSensor:
    """A force sensor that fault detection switched off for the rest of the run, at a step."""

    leg: int = number("", at_least=0, at_most=MOST)
    step: int = number("", at_least=0, at_most=MOST)


@dataclass(kw_only=True)
class CarriedLoad:
    """Load that the plan used after a cycle, see :class:`cmacexp.planning.plan.LoadEstimate`."""

    cycle: int = number("", at_least=1, at_most=MOST)
    weight: float = number("N")
    x: float = number("m")
    y: float = number("m")
    slope_x: float = number("m/m")
    slope_y: float = number("m/m")
    measured_weight: float | None = number("N", default=None)
    """Weight that the feet carried in that cycle, N; the plan adopts a fraction of its change."""


@dataclass
class RunEnd:
    """Outcome of a run, kept up to date while it runs. All fields except ``error`` are entries of its manifest."""

    status: str
    """``completed``, ``diverged``, ``fell``, ``interrupted`` or ``failed``; ``not intact`` for a damaged run,
    ``unfinished`` without a manifest."""
    cause: str = ""
    """Why the run did not complete: step, time and cause; empty if it did."""
    steps: int = 0
    """Number of sampling periods simulated."""
    learning_lead: int | None = None
    """Lead of learning at the end, samples."""
    learning_rate: float | None = None
    """Learning rate at the end."""
    guard: list[GuardEvent] = field(default_factory=list)
    """Interventions of the guard of learning."""
    lead_estimates: list[LeadEstimate] = field(default_factory=list)
    """Estimates of the lead, with ``learning.lead=estimate``."""
    carried: list[CarriedLoad] = field(default_factory=list)
    """Loads that the plan used, with ``force_control.load_sharing=adaptive``."""
    rollout_seconds: float = 0.0
    """Wall time of the closed loop only, without compilation, s."""
    processor_seconds: float = 0.0
    """Processor time of the closed loop, s."""
    error: Exception | None = None
    """Exception that a component raised."""

    @property
    def is_result(self) -> bool:
        """True if the run has results that can be compared with those of others."""
        return self.status in RESULTS

    def list_entries(self) -> dict[str, Any]:
        """List the entries of the manifest, by name."""
        return {name: value for name, value in vars(self).items() if name != "error"}
