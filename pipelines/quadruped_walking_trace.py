"""Measures and figures of the quadruped study from the traces of its walks.

Measures cover the events of Fig. 14 and 17 to 20, and shares of the force error. Figures are the gait diagram
(Fig. 14) and three views of the machine (Fig. 16 to 20).

Stability margins are the true ones: of the polygon of loaded feet at their actual positions under the tilted body. An
undefined margin counts as -inf: fewer than three feet are loaded, or the line along the body misses their polygon.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.data.signals import TRUE_MARGINS
from cmacexp.data.trace import Trace
from cmacexp.planning.stability import FRONT, REAR, STABILITY
from cmacexp.recording import palette
from cmacexp.recording.run_view import RunView
from cmacexp.report.style import ALOFT, DESIRED, MM, NEAR, SERIES, colour, joints
from cmacexp.study import Array, DataFrame, Figure, Measures, Panel, Run, Series, Status, draw
from cmacexp.typing import Mask
from pipelines.common_results import if_completed

X, Y, Z = range(3)
AXES = ("x forward of the centre of gravity, mm", "y left, mm", "z up, mm")
AROUND = (0, 1, 3, 2)
"""Indices of the legs in their order around the machine."""
BODY, COG, POLYGON = map(colour, (palette.BODY_COLOR, palette.COG, palette.POLYGON))
DUTY_FACTOR = 0.8
WAVE = (0.2, 0.7, 0.0, 0.5)
"""Delay of each leg's transfer relative to leg 3, parts of a cycle, in the wave gait of Fig. 14.

Leg 1 lifts as foot 3 touches down, and the right side follows the left one by half a cycle.
"""
RESTORED = 0.1
"""The front margin counts as restored once it stays above this, m; the paper gives no value."""
LATE = 5
"""Number of cycles at the end of a run in which the learnt walk is measured."""


@dataclass(frozen=True)
class Walk:
    """Trace of a walk of the quadruped; arrays are (steps, 4), legs in the paper's order."""

    trace: Trace
    length: float
    """Length of the body from the rear to the front hips, m."""
    period: float
    """Sampling period, s."""

    @property
    def cycle(self) -> Array:
        """Number of the cycle, (steps,), from 1."""
        return self.trace.shared("cycle")

    @cached_property
    def carried(self) -> Array:
        """True stability margins (steps, 3), m: to the nearest edge, to the front and to the rear boundary."""
        assert self.trace.body is not None
        margins = [self.trace.body[name] for name in TRUE_MARGINS]
        return np.nan_to_num(margins, nan=-np.inf, posinf=np.inf, neginf=-np.inf).T

    def start(self, cycle: int, leg: int, support: bool) -> int:
        """Return the step of a cycle in which a planned support (else: transfer) of ``leg`` begins."""
        now = self.trace.support[:, leg - 1] == support
        steps = np.flatnonzero(now[1:] & ~now[:-1]) + 1
        return int(steps[self.cycle[steps] == cycle][0])

    def end(self, k: int, leg: int) -> int:
        """Return the first step after the planned phase of ``leg`` that contains step ``k``."""
        changes = np.flatnonzero(self.trace.support[k:, leg - 1] != self.trace.support[k, leg - 1])
        return k + int(changes[0]) if len(changes) else len(self.trace.support)

    def first(self, k: int, leg: int, carries: bool) -> int:
        """Return the first step from ``k`` on in which the foot of ``leg`` is loaded (else: unloaded)."""
        return k + int(np.argmax((self.trace["force"][k:, leg - 1] > 0.0) == carries))


@cache
def view_walk(folder: Path) -> RunView:
    """Read the stored run in a folder for drawing; cached, as several figures need it."""
    run = Run(folder)
    return RunView(run, run.read_trace())


def walk_in(view: RunView) -> Walk:
    """Return the walk of a run that is drawn."""
    return Walk(view.trace, float(np.ptp(view.hips[:, 0])), view.run.config["sampling_period"])


def contacts(walk: Walk, cycle: int) -> dict[str, float]:
    """Compare the foot contacts of a cycle with the wave gait of Fig. 14.

    ``duty_factor_off`` and ``wave_off`` are the largest deviations of a leg from duty factor and phase, parts of a
    cycle; ``two_feet`` is the share of time with fewer than three loaded feet.
    """
    carries = walk.trace["force"][walk.cycle == cycle] > 0.0
    turn = np.exp(2j * np.pi * np.arange(len(carries)) / len(carries))
    middle = np.array([(turn[~loaded]).sum() for loaded in carries.T])  # points to the middle of the time aloft
    wave = np.exp(2j * np.pi * np.array(WAVE))
    return {
        "duty_factor_off": float(np.abs(carries.mean(axis=0) - DUTY_FACTOR).max()),
        "wave_off": float(np.abs(np.angle(middle / middle[2] / wave)).max() / (2.0 * np.pi)) if middle.all() else 0.5,
        "two_feet": float((carries.sum(axis=1) < 3).mean()),
    }


def lift_off_of_3(walk: Walk, cycle: int) -> dict[str, float]:
    """Measure ``rear``, the rear margin relative to the body's length as foot 3 leaves the ground (Fig. 17)."""
    k = walk.start(cycle, 3, support=False)
    aloft = k + np.flatnonzero(walk.trace["force"][k : walk.end(k, 3), 2] == 0.0)
    return {"rear": float(walk.carried[aloft[0], REAR]) / walk.length if len(aloft) else -np.inf}


def touch_down_of_3(walk: Walk, cycle: int) -> dict[str, float]:
    """Measure the planned touch-down of foot 3 (Fig. 18).

    ``force_1`` is the load on foot 1 at that step, N; ``margin`` is the least margin until foot 1 is unloaded, m.
    """
    k = walk.start(cycle, 3, support=True)
    carries = walk.trace["force"][k : walk.end(k, 1), 0] > 0.0
    late = int(np.argmin(carries)) if not carries.all() else len(carries)
    return {
        "force_1": float(walk.trace["force"][k, 0]),
        "margin": float(walk.carried[k : k + max(late, 1), STABILITY].min()),
    }


def closest_in_transfer_of_2(walk: Walk, cycle: int) -> int:
    """Return the step of least front margin in the second half of the transfer of foot 2, with the foot unloaded."""
    k = walk.start(cycle, 2, support=True)
    before = np.flatnonzero(walk.trace.support[:k, 1])
    first = int(before[-1]) + 1 if len(before) else 0
    aloft = [j for j in range((first + k) // 2, k) if walk.trace["force"][j, 1] == 0.0] or [k - 1]
    return min(aloft, key=lambda j: (walk.carried[j, FRONT], -j))


def touch_down_of_2(walk: Walk, cycle: int) -> dict[str, float]:
    """Measure the touch-down of foot 2 (Fig. 19, 20).

    ``front`` is the least front margin late in its transfer, relative to the body's length; ``front_gain`` is the
    least one after the contact relative to that; ``restored`` is the time from contact until it is restored, s.
    """
    closest = closest_in_transfer_of_2(walk, cycle)
    planned = walk.start(cycle, 2, support=True)
    until = min(walk.end(planned, leg) for leg in (1, 3, 4))
    after = walk.carried[walk.first(closest, 2, carries=True) : until, FRONT]
    low = np.flatnonzero(after <= RESTORED)
    before = float(walk.carried[closest, FRONT])
    return {
        "front": before / walk.length,
        "front_gain": float(after.min(initial=np.inf)) / before if before > 0.0 else -np.inf,
        "restored": (int(low[-1]) + 1 if len(low) else 0) * walk.period,
    }


def four_feet(walk: Walk, cycle: int) -> dict[str, float]:
    """Return shares of the squared force error of a cycle.

    ``four_feet`` is the share while four feet are planned to be down; ``diagonal`` is the share of this part that
    moves load from one diagonal pair of feet to the other.
    """
    rows = walk.cycle == cycle
    error = (walk.trace["force"] - walk.trace["force_desired"])[rows]
    four_down = error[walk.trace.support[rows].all(axis=1)]
    square = float((four_down**2).sum())
    diagonal = four_down @ np.array([0.5, -0.5, -0.5, 0.5])
    return {"four_feet": square / float((error**2).sum()), "diagonal": float((diagonal**2).sum()) / square}


def measure_events(walk: Walk, cycles: Iterable[int]) -> DataFrame:
    """Measure the events of a walk, a row for each of ``cycles``."""
    events = (contacts, touch_down_of_3, lift_off_of_3, touch_down_of_2)
    return pd.DataFrame(
        {key: value for find in events for key, value in find(walk, cycle).items()} for cycle in cycles
    )


def instants(walk: Walk, cycle: int) -> dict[int, int]:
    """Return the steps of Fig. 17 to 20 in a cycle, by the figure's number.

    17: the first step after the planned lift-off of foot 3 in which the foot is unloaded. 18: the first one after its
    planned touch-down in which it is loaded. 19: least front margin with foot 2 aloft. 20: the first step after that
    in which foot 2 is loaded.
    """
    closest = closest_in_transfer_of_2(walk, cycle)
    return {
        17: walk.first(walk.start(cycle, 3, support=False), 3, carries=False),
        18: walk.first(walk.start(cycle, 3, support=True), 3, carries=True),
        19: closest,
        20: walk.first(closest, 2, carries=True),
    }


def measure_share(run: Run, name: str) -> float:
    """Return the median of a share of :func:`four_feet` over the last cycles of a run.

    It is 0 if the run did not complete or its trace lacks cycles.
    """
    if run.status != Status.COMPLETED or run.config["record"]["cycles"] is not None:
        return 0.0
    walk = walk_in(view_walk(run.folder))
    last = run.whole_cycles
    return float(np.median([four_feet(walk, cycle)[name] for cycle in range(max(1, last - LATE + 1), last + 1)]))


@if_completed
def burst(run: Run) -> float:
    """Return the largest transfer error in x of the last fifth of cycles relative to the second fifth's median."""
    errors = run.pooled["transfer_rmse_x"]
    fifth = len(errors) // 5
    return float(errors[-fifth:].max() / np.median(errors[fifth : 2 * fifth]))


MEASURES: Measures = {
    "four_feet": partial(measure_share, name="four_feet"),
    "diagonal": partial(measure_share, name="diagonal"),
    "burst": burst,
}
"""Measures of a run."""


def gait_diagram(walk: RunView, cycles: int = 2) -> Figure:
    """Draw Fig. 14: planned and actual foot contacts over the last cycles."""
    rows = walk.cycle > walk.cycle[-1] - cycles
    time = walk.time[rows] - walk.time[rows][0]
    style = {"lw": 7.0, "linestyle": "-", "solid_capstyle": "butt"}
    contact_lines = {
        "planned support": (walk.trace.support, -0.15, "black"),
        "foot carries": (walk.trace["force"] > 0.0, 0.15, SERIES[1]),
    }
    series = [
        Series(name, time, np.where(down[rows, leg - 1], leg + shift, np.nan), style={**style, "color": ink})
        for leg in range(1, 5)
        for name, (down, shift, ink) in contact_lines.items()
    ]
    panel = Panel(
        "support and transfer", "time, s", "leg", series,
        x_limits=time[1:][np.diff(walk.cycle[rows]) > 0], y_range=(0.5, 4.5), y_down=True,
    )  # fmt: skip
    return draw([panel])


def _connect(points: Array, chosen: Mask) -> Array:
    """Return the closed line (n + 1, 3) through the points (4, 3) of the n chosen legs."""
    legs = [leg for leg in AROUND if chosen[leg]]
    return points[[*legs, *legs[:1]]]


def _outline(walk: RunView, k: int) -> list[tuple[str, Array, dict[str, Any]]]:
    """Return the lines that show the machine in step ``k``: names, points (n, 3), mm, and styles.

    The origin is on the ground below the centre of gravity; the foot of each leg is marked with its number.
    """
    links = joints(walk)[k]
    carries = walk.trace["force"][k] > 0.0
    support = walk.trace.support[k]
    ends = MM * walk_in(walk).carried[k][[REAR, FRONT]] * [-1.0, 1.0]
    above = MM * np.array([[0.0, 0.0, walk.body["height"][k]]])
    margins = np.outer(np.where(np.isfinite(ends), ends, np.nan), [1.0, 0.0, 0.0])
    line = {"linestyle": "-", "marker": None}
    legs = [
        (
            f"leg in {'support' if down else 'transfer'}",
            points,
            {**line, "color": NEAR if down else ALOFT, "lw": 2.4, "marker": f"${leg}$", "markevery": [-1], "ms": 9},
        )
        for leg, (points, down) in enumerate(zip(links, support, strict=True), 1)
    ]
    return [
        ("body", _connect(links[:, 0], support | True), {**line, "color": BODY, "lw": 4.0}),
        ("planned support", _connect(links[:, -1], support), {**line, "color": "black", "linestyle": "--"}),
        ("feet that carry", _connect(links[:, -1], carries), {**line, "color": POLYGON, "lw": 1.4}),
        ("margins along the body", margins, {**line, "color": COG, "lw": 2.6}),
        ("centre of gravity", above, {"color": COG, "linestyle": "none", "marker": "o", "ms": 7}),
        *legs,
    ]  # fmt: skip


def views(walk: RunView, cycle: int, number: int) -> Figure:
    """Draw Fig. 16 to 20: the machine from above, from the right and from the front, and its foot forces."""
    k = ({16: 0} | instants(walk_in(walk), cycle))[number]
    lines = _outline(walk, k)
    panels = [
        Panel(
            title, AXES[x], AXES[y], [Series(name, xyz[:, x], xyz[:, y], style=style) for name, xyz, style in lines],
            equal=True, y_limits=[0.0] if y == Z else (),
        )
        for title, x, y in (("from above", X, Y), ("side, from the right", X, Z), ("front", Y, Z))
    ]  # fmt: skip
    forces = [
        Series("actual force", range(4), walk.trace["force"][k], style={"color": SERIES[0]}),
        Series("desired force", range(4), walk.trace["force_desired"][k],
               style={"fc": "white", "ec": DESIRED, "hatch": "////"}),
    ]  # fmt: skip
    panels.insert(
        1, Panel("foot forces", "leg", "contact force, N", forces, "bars", ticks="1234", y_range=(0.0, 29.0))
    )
    return draw(panels, height=2.9)
