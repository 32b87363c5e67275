"""The events of Fig. 17 to 20 in the traces of a walk, with their margins and forces.

Two kinds of margin: *planned* ones are those of the gait, from ``body.parquet``; *measured* ones are those of the
feet that carry, where they stand under the tilted body.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import read_traces
from cmacexp.planning.stability import FRONT, REAR, STABILITY, margins
from cmacexp.recording.run_view import RunView, make_view
from cmacexp.typing import Array, Mask

if TYPE_CHECKING:
    import pandas as pd

RESTORED = 0.1
"""The front margin counts as restored from when on it stays above this, m; the paper gives no figure."""


@dataclass(frozen=True)
class Walk:
    """Traces of a quadruped; arrays are (steps, 4), legs in the paper's order."""

    view: RunView

    @cached_property
    def force(self) -> Array:
        """Contact force, N."""
        return np.stack([leg["force"] for leg in self.view.legs], axis=1)

    @cached_property
    def desired(self) -> Array:
        """Desired force, N."""
        return np.stack([leg["force_desired"] for leg in self.view.legs], axis=1)

    @cached_property
    def support(self) -> Mask:
        """Whether a foot is planned to support."""
        return np.stack([leg.support for leg in self.view.legs], axis=1)

    @cached_property
    def feet(self) -> Array:
        """Feet in the horizontal plane, (steps, 4, 2), forward and left of the centre of gravity, m."""
        world = np.stack([self.view.in_world(leg.in_body(leg["x"], leg["y"])) for leg in self.view.legs], axis=1)
        return world[..., :2] - self.view.way()[:, None, :2]

    def carried(self, k: int) -> tuple[float, float, float]:
        """Margins of the feet that carry in step ``k``: nearest edge, front and rear boundary, m."""
        return margins(self.feet[k][self.force[k] > 0.0])

    def starts(self, leg: int, support: bool) -> Array:
        """Steps in which a planned support, or else a planned transfer, of ``leg`` begins."""
        now = self.support[:, leg - 1] == support
        return np.flatnonzero(now[1:] & ~now[:-1]) + 1

    def end(self, k: int, leg: int) -> int:
        """Step after the planned phase of ``leg`` that step ``k`` is in."""
        changes = np.flatnonzero(self.support[k:, leg - 1] != self.support[k, leg - 1])
        return k + int(changes[0]) if len(changes) else len(self.support)

    @property
    def period(self) -> float:
        """From one step to the next, s."""
        return float(self.view.time[1] - self.view.time[0])


def walk_of(run: StoredRun) -> Walk:
    """The walk of a stored run."""
    return Walk(make_view(read_traces(run.folder), run.config))


def _per_cycle(walk: Walk, rows: list[dict[str, float]], starts: Array) -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame(rows, index=pd.Index(walk.view.cycle[starts[: len(rows)]], name="cycle"))


def gait(walk: Walk) -> "pd.DataFrame":
    """Duty factor of each leg, and when it lifts and touches down, as parts of a cycle; from the first one's plan."""
    import pandas as pd

    samples = int((walk.view.cycle == walk.view.cycle[0]).sum())
    support = walk.support[:samples]
    before = np.roll(support, 1, axis=0)
    return pd.DataFrame(
        {
            "duty_factor": support.mean(axis=0),
            "lift_off": np.argmax(~support & before, axis=0) / samples,
            "touch_down": np.argmax(support & ~before, axis=0) / samples,
        },
        index=pd.Index(range(1, 5), name="leg"),
    )


def lift_off_of_3(walk: Walk) -> "pd.DataFrame":
    """Per cycle: rear margins as foot 3 leaves the ground, m; how the force of foot 2, N, follows the planned one."""
    starts, rows = walk.starts(3, support=False), []
    for k in starts:
        aloft = k + np.flatnonzero(walk.force[k : walk.end(k, 3), 2] == 0.0)
        planned, force = walk.view.body["margin_rear"][aloft], walk.force[aloft, 1]
        rows.append(
            {
                "rear_planned": walk.view.body["margin_rear"][k],
                "rear": walk.carried(aloft[0])[REAR] if len(aloft) else np.nan,
                "force_2": force[0] if len(aloft) else np.nan,
                "desired_2": walk.desired[aloft[0], 1] if len(aloft) else np.nan,
                "force_2_least": force.min(initial=np.inf),
                "correlation": float(np.corrcoef(planned, force)[0, 1]) if len(set(force)) > 1 else np.nan,
            }
        )
    return _per_cycle(walk, rows, starts)


def touch_down_of_3(walk: Walk) -> "pd.DataFrame":
    """Per cycle: what foot 1 still carries as foot 3 is to take over, N, for how long, s, and the margin then, m."""
    starts, rows = walk.starts(3, support=True), []
    for k in starts:
        carries = walk.force[k : walk.end(k, 1), 0] > 0.0
        late = int(np.argmin(carries)) if not carries.all() else len(carries)
        rows.append(
            {
                "force_1": walk.force[k, 0],
                "desired_1": walk.desired[k, 0],
                "delay": late * walk.period,
                "margin": min((walk.carried(j)[STABILITY] for j in range(k, k + late)), default=np.nan),
            }
        )
    return _per_cycle(walk, rows, starts)


def closest_in_transfer_of_2(walk: Walk, k: int) -> int:
    """Step between lift-off and ``k``, the touch-down of foot 2, in which it carries nothing and the measured front
    margin is least; only the second half of the transfer is searched."""
    begin = walk.starts(2, support=False)
    first = int(begin[begin < k][-1]) if (begin < k).any() else 0
    aloft = [j for j in range((first + k) // 2, k) if walk.force[j, 1] == 0.0] or [k - 1]
    return min(aloft, key=lambda j: (np.nan_to_num(walk.carried(j)[FRONT], nan=np.inf), -j))


def touch_down_of_2(walk: Walk) -> "pd.DataFrame":
    """Per cycle: the front margin late in the transfer of foot 2 and after its touch-down, m, and when, s."""
    starts, rows = walk.starts(2, support=True), []
    for k in starts:
        closest = closest_in_transfer_of_2(walk, k)
        contact = closest + int(np.argmax(walk.force[closest:, 1] > 0.0))
        until = min(walk.end(k, leg) for leg in (1, 3, 4))
        after = np.array([walk.carried(j)[FRONT] for j in range(contact, until)])
        low = np.flatnonzero(~(after > RESTORED))
        rows.append(
            {
                "front_planned": walk.view.body["margin_front"][k - 1],
                "front_planned_after": walk.view.body["margin_front"][k],
                "front": walk.carried(closest)[FRONT],
                "contact": (contact - k) * walk.period,
                "force_2": walk.force[contact, 1],
                "force_1_after": walk.force[contact:until, 0].min(initial=np.inf),
                "front_after": float(np.nanmin(after)) if len(after) else np.nan,
                "restored": (low[-1] + 1 if len(low) else 0) * walk.period,
            }
        )
    return _per_cycle(walk, rows, starts)


def instants(walk: Walk, cycle: int) -> dict[int, int]:
    """Steps of Fig. 17 to 20 in a cycle, by the figure's number.

    17: the first step in which foot 3, lifting, carries nothing. 18: the first from its planned touch-down on in
    which it carries. 19: foot 2 aloft, measured front margin least. 20: the first after it in which foot 2 carries.
    """

    def first(steps: Array) -> int:
        return int(steps[walk.view.cycle[steps] == cycle][0])

    lift, down, front = (first(walk.starts(*which)) for which in ((3, False), (3, True), (2, True)))
    closest = closest_in_transfer_of_2(walk, front)
    return {
        17: lift + int(np.argmax(walk.force[lift:, 2] == 0.0)),
        18: down + int(np.argmax(walk.force[down:, 2] > 0.0)),
        19: closest,
        20: closest + int(np.argmax(walk.force[closest:, 1] > 0.0)),
    }
