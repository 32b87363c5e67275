"""What happened in a run besides its samples: entries of its manifest, as those who find them out write them."""

from dataclasses import dataclass

from cmacexp.config.fields import number

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
