"""How much the feedback of a stored run grew from cycle to cycle."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from cmacexp.data.parquet import as_array, read_parts
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import TRACE
from cmacexp.stability.cycle_map import NotPredictable
from cmacexp.stability.growth import GROWTH_CYCLES, MAX_CYCLES_BEFORE, SETTLING_CYCLES, calmest, fitted_growth
from cmacexp.typing import Array

MIN_GROWTH_RATIO = 2.0
"""A change at least this many times the least one counts as growth."""
SHARE_LEFT_OUT = 0.05
"""Share of the cycles that are left out at the end of a run that did not complete: nothing is small there."""


class Stretch(NamedTuple):
    """The cycles over which growth is read."""

    calm: int
    """The cycle before them where the loop is linearised, in cycles done."""
    first: int
    last: int


def stretch(sizes: Sequence[float] | Array, first: int, completed: bool) -> Stretch:
    """Choose where to read growth: from the calmest cycle on if changes grow after it, else early on.

    Args:
        sizes: (n,), of the change from each cycle to the next, the first that of cycle 1.
        first: cycle in which the feedforward begins to act.
        completed: whether the run reached its end.
    """
    last = len(sizes) if completed else len(sizes) - max(2, round(SHARE_LEFT_OUT * len(sizes)))
    calm = calmest(sizes[:last], first) if last > first else first
    grows = last > calm and bool(sizes[last - 1] > MIN_GROWTH_RATIO * sizes[calm - 1])
    if not grows:
        calm = min(first + MAX_CYCLES_BEFORE, (first + last) // 2)
    start = calm + SETTLING_CYCLES if last > calm + 2 * SETTLING_CYCLES else calm + 1
    return Stretch(calm, start, min(start + GROWTH_CYCLES, last))


def read_changes(run: StoredRun, joints: int) -> Array:
    """Root of the summed squares of the change of the feedback torque from each cycle to the next, (n,), N m.

    Entry j is from cycle j + 1 to j + 2; legs have so many ``joints``.

    Raises:
        BadRun: the trace cannot be read.
        NotPredictable: it is thinned: its norm would be another, or its cycles not successive.
    """
    record: dict[str, Any] = run.config["record"]
    if record.get("every_nth_step", 1) > 1 or record.get("cycles") is not None:
        raise NotPredictable(
            "the trace lacks steps, but growth is computed from every step; run it again without record.cycles and "
            "record.every_nth_step"
        )
    names = [f"tau_feedback_{joint + 1}" for joint in range(joints)]
    parts = read_parts(run.folder / TRACE, names)
    torques = np.concatenate([np.stack([as_array(part, name) for name in names], axis=1) for part in parts])
    rows = len(torques) // run.manifest["steps"] * run.steps_per_cycle
    whole = torques[: len(torques) // rows * rows].reshape(-1, rows, joints)
    return np.array([np.linalg.norm(after - before) for before, after in pairwise(whole)])


def growth_over(sizes: Sequence[float] | Array, place: Stretch) -> float:
    """Growth per cycle of the changes over a stretch; NaN where it is too short."""
    return fitted_growth(sizes[place.first - 1 : place.last])
