"""Measures of the walks of a dynamic body, and the names of the runs of its study."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd

PAPER, BASE, ALL, START = "constants of the paper", "none of the changes", "all changes", "start"
LATE = "long walk without lead"
BUT = ", but "
"""In the name of a run with one of the paper's constants changed."""
FEEDBACK = ", feedback alone"
CUT_OFF = 10.0
"""Force errors below this frequency are measured separately, Hz."""
MM, MRAD = 1e3, 1e3


def alone(name: str) -> str:
    """Feedback alone on the plan of a walk that learns."""
    return name + FEEDBACK


def first(names: list[str]) -> str:
    """The walk with these changes made."""
    return f"{BASE} + {len(names)}"


def plain(name: str) -> str:
    """A walk with none of the changes, except the one called ``name``; its trace is kept whole."""
    return f"plain, {name}"


def without(name: str) -> str:
    """The walk with all changes but one."""
    return f"all but {name}"


def low_passed(error: Array, period: float) -> Array:
    """The part of ``error`` (steps, L), sampled every ``period`` s, below CUT_OFF, without delay.

    A second-order Butterworth filter, forth and back.
    """
    from scipy.signal import butter, sosfiltfilt

    slow: Array = sosfiltfilt(butter(2, CUT_OFF, fs=1.0 / period, output="sos"), error, axis=0)
    return slow


def root_mean_square(values: Array) -> float:
    """Over all values."""
    return float(np.sqrt((values**2).mean()))


def by_cycle(run: StoredRun) -> "pd.DataFrame":
    """Force error over the whole cycle (N), transfer errors (mm) pooled over legs, and tilt (mrad), by cycle."""
    import pandas as pd

    table = run.metrics
    names = {"force": "force_rmse_cycle", "x": "transfer_rmse_x", "y": "transfer_rmse_y"}
    squares = {new: (table[old] ** 2).groupby(table["cycle"]).mean() ** 0.5 for new, old in names.items()}
    found = pd.DataFrame(squares)
    found[["x", "y"]] *= MM
    found["tilt"] = MRAD * run.body_metrics.set_index("cycle")["tilt_max"]
    return found


@dataclass(frozen=True)
class Walk:
    """What a cycle of a walk came to."""

    status: str
    seconds: float
    """Simulated until it ended."""
    force: float
    """RMSE over all legs and the whole cycle, N; NaN if the walk ended before, as all that follows."""
    slow: float
    """Of it what is slower than CUT_OFF, N."""
    x: float
    """Transfer errors, mm."""
    y: float
    tilt: float
    """mrad."""
    advance: float
    """Way of the body over that of the plan."""
    yaw: float
    """At the end of the cycle, rad."""


def body_speed(config: dict) -> float:
    """Planned speed of the body, m/s."""
    gait = config["gait"]
    return float(gait["stroke"] / (gait["duty_factor"] * gait["cycle_time"]))


def force_errors(run: StoredRun, cycle: int) -> tuple[Array, Array, Array]:
    """Time (steps,), s, desired forces and errors of the actual ones (steps, L), N, in a cycle."""
    rows = run.cycles([cycle])
    legs = int(rows["leg"].max())
    force, desired = (rows[name].to_numpy().reshape(-1, legs) for name in ("force", "force_desired"))
    return rows["time"].to_numpy()[::legs], desired, force - desired


def walk_at(run: StoredRun, cycle: int) -> Walk:
    """Results of ``cycle`` of a run, whose trace must contain it."""
    period = run.config["sampling_period"]
    seconds = run.manifest["steps"] * period
    table = by_cycle(run)
    if cycle > whole_cycles(run):
        return Walk(run.status, seconds, *[float("nan")] * 7)
    _, _, error = force_errors(run, cycle)
    body, row = run.cycles([cycle], BODY), table.loc[cycle]
    way = body["cog_x"].iloc[-1] - body["cog_x"].iloc[0]
    planned = body_speed(run.config) * period * (len(body) - 1)
    return Walk(
        run.status,
        seconds,
        row["force"],
        root_mean_square(low_passed(error, period)),
        row["x"],
        row["y"],
        row["tilt"],
        way / planned,
        body["yaw"].iloc[-1],
    )


def whole_cycles(run: StoredRun) -> int:
    """Cycles that a run walked from beginning to end."""
    period = round(run.config["gait"]["cycle_time"] / run.config["sampling_period"])
    return int(run.manifest["steps"]) // period


def last_cycle(run: StoredRun) -> int:
    """The last cycle that a run was to walk."""
    return int(run.config["cycles"])
