"""Input of the components: the setup of a run at its start, and the reference of each step."""

from dataclasses import dataclass
from typing import NamedTuple

from cmacexp.config import Config
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.plan import Plan
from cmacexp.planning.trajectory import ControlReference, Motion, read_old_columns
from cmacexp.typing import Array, Mask, Weights


@dataclass(frozen=True)
class Setup:
    """Config, machine, plan and start of a run; those of the plant are true, all others get what is nominal."""

    config: Config
    """Of all but the plant :attr:`Config.nominal`."""
    mechanism: Mechanism
    plan: Plan
    start: Array
    """(L, 2): joint angles at the start, rad; of a point mass its position, m."""
    learnt: Weights | None = None
    """Weights of an earlier run that the feedforward starts from, by their names; None: it starts from nothing."""
    lead: int = 0
    """``learning.lead`` in samples: feedback trains the cells of so many samples before the last one."""
    rate: float = 0.0
    """``learning.rate``, beta."""


class Reference(NamedTuple):
    """What the plan prescribes for one step; L is the number of legs."""

    step: int
    """Counts from 0 over the whole run."""
    sample: int
    """Counts from 0 within the cycle."""
    acting: bool
    """Whether the feedforward learns and acts in this step."""
    support: Mask
    """(L,): planned phase, true in support."""
    control: ControlReference
    """What the built-in controllers follow, (L, J) and (L,)."""
    foot_motion: Motion
    """Desired, (L, J)."""
    joint_motion: Motion
    """The same in joint angles, (L, J)."""
    force_desired: Array
    """(L,): N."""

    @property
    def values(self) -> Array:
        """Old name of ``control``, (L, 7 or 9): x, y, vx, vy, reference force, force to add, desired force, z, vz.

        Places are in m, velocities in m/s, forces in N.
        """
        return read_old_columns("reference.values", "reference.control", self.control)

    @property
    def desired(self) -> Array:
        """Old name of ``foot_motion``, (L, 6 or 9): x, y, vx, vy, ax, ay, z, vz, az, in m, m/s and m/s^2."""
        return read_old_columns("reference.desired", "reference.foot_motion", self.foot_motion)

    @property
    def joints(self) -> Array:
        """Old name of ``joint_motion``, (L, 6 or 9), in the same order, in rad, rad/s and rad/s^2."""
        return read_old_columns("reference.joints", "reference.joint_motion", self.joint_motion)
