"""What the study of a body with mass measures, draws and tabulates."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY
from cmacexp.metrics.metric import Shown
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.study import Panel, Results, Series, draw, over_cycles
from cmacexp.study.interval import Interval, estimate
from cmacexp.typing import Array
from pipelines.dynamic_body_walks import ALL, CMAC, FEEDBACK, NAMES, NONE, without

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

CUT_OFF = 10.0
"""Force errors below this frequency are measured separately, Hz."""
SHOWN_LEG = 2
QUANTITIES = {
    "force_rmse_cycle": Shown("force error", "N"),
    "slow_force": Shown(f"force error below {CUT_OFF:g} Hz", "N"),
    "transfer_rmse_x": Shown("transfer error in x", "mm", 1e3),
    "transfer_rmse_y": Shown("transfer error in y", "mm", 1e3),
    "tilt_max": Shown("tilt", "mrad", 1e3),
    "off_course": Shown("error of the distance walked", "%", 100.0),
}
"""Metrics and measures of the last cycle."""
OVER_CYCLES = ("force_rmse_cycle", "transfer_rmse_x", "transfer_rmse_y", "tilt_max")


def walked(run: StoredRun) -> float:
    """Share of the planned time that a run lasted."""
    return float(run.manifest["steps"] / (run.steps_per_cycle * run.config["cycles"]))


def low_passed(error: Array, period: float) -> Array:
    """The part of ``error`` (steps, L), sampled every ``period`` s, below CUT_OFF, without delay.

    A second-order Butterworth filter, forth and back.
    """
    from scipy.signal import butter, sosfiltfilt

    slow: Array = sosfiltfilt(butter(2, CUT_OFF, fs=1.0 / period, output="sos"), error, axis=0)
    return slow


def forces(run: StoredRun) -> tuple[Array, Array, Array]:
    """Time (steps,), s, actual and desired forces (steps, L), N, in the last cycle."""
    rows = run.cycles([run.config["cycles"]])
    legs = int(rows["leg"].max())
    force, desired = (rows[name].to_numpy().reshape(-1, legs) for name in ("force", "force_desired"))
    return rows["time"].to_numpy()[::legs], force, desired


def slow_force(run: StoredRun) -> float:
    """RMS force error below CUT_OFF, all legs, in the last cycle, N; inf if the run ended before."""
    if run.status != "completed":
        return np.inf
    _, force, desired = forces(run)
    return float(np.sqrt((low_passed(force - desired, run.config["sampling_period"]) ** 2).mean()))


def off_course(run: StoredRun) -> float:
    """Relative error of the body's way in the last cycle; inf if the run ended before."""
    if run.status != "completed":
        return np.inf
    gait, body = run.config["gait"], run.cycles([run.config["cycles"]], BODY)
    speed = gait["stroke"] / (gait["duty_factor"] * gait["cycle_time"])
    planned = speed * run.config["sampling_period"] * (len(body) - 1)
    return float(abs((body["cog_x"].iloc[-1] - body["cog_x"].iloc[0]) / planned - 1.0))


def yaw(run: StoredRun) -> float:
    """How far the body has turned from the plan at the end, rad; inf if the run ended before."""
    return (
        float(abs(run.cycles([run.config["cycles"]], BODY)["yaw"].iloc[-1])) if run.status == "completed" else np.inf
    )


MEASURES = {"walked": walked, "slow_force": slow_force, "off_course": off_course, "yaw": yaw}


def last(results: Results, name: str) -> Array:
    """(runs,): a metric or measure of the last planned cycle; inf if a run ended before."""
    return results.end(name, cycles=1) if name in ALL_METRICS else results.measure(name)


def _bars(name: str, found: Sequence[Interval]) -> Series:
    """A bar for each interval, and its error bar if it has a spread; no bar where walks ended before."""
    values = [each.value if np.isfinite(each.value) else np.nan for each in found]
    spread = [each.method != "guard band" and np.isfinite(each.high) for each in found]
    low, high = (
        [getattr(each, side) if wide else np.nan for each, wide in zip(found, spread, strict=True)]
        for side in ("low", "high")
    )
    return Series(name, range(len(found)), values, low, high)


def draw_ladder(results: Results) -> "Figure":
    """Force error of each walk and its slow part, beside that of feedback alone on the same plan."""
    panels = []
    for part, title in (("made", "changes made one after the other"), ("left out", "all changes but one")):
        walks = results.select(part=part).by("walk")
        chosen = {
            CMAC: (CMAC, "force_rmse_cycle"),
            f"{CMAC}, below {CUT_OFF:g} Hz": (CMAC, "slow_force"),
            FEEDBACK: (FEEDBACK, "force_rmse_cycle"),
        }
        series = [
            _bars(name, [estimate(last(own.select(feedforward=kind), value)) for own in walks.values()])
            for name, (kind, value) in chosen.items()
        ]
        panels.append(Panel(title, "", "force error, N", series, kind="bars", ticks=list(walks)))
    return draw(panels, columns=1, height=3.0)


def _panel(results: Results, name: str, by: str) -> Panel:
    shown = QUANTITIES[name]
    return replace(over_cycles(results, name, by, log="y"), title=shown.title, y=f"{shown.title}, {shown.unit}")


def draw_learning(results: Results) -> "Figure":
    """Errors over the cycles without the changes, without one of them, and with all."""
    shown = results.select(feedforward=CMAC, walk=[NONE, without(NAMES[0]), ALL])
    return draw([_panel(shown, name, "walk") for name in OVER_CYCLES])


def draw_starts(results: Results) -> "Figure":
    """Force error and tilt over the cycles from disturbed starts."""
    return draw([_panel(results.select(part="starts"), name, "walk") for name in ("force_rmse_cycle", "tilt_max")])


def draw_foot(results: Results) -> "Figure":
    """Contact force of one foot with all changes, in the last cycle."""
    panels = []
    for kind in (FEEDBACK, CMAC):
        run = results.select(part="left out", walk=ALL, feedforward=kind).run
        time, force, desired = (each if each.ndim == 1 else each[:, SHOWN_LEG] for each in forces(run))
        slow = desired + low_passed(force - desired, run.config["sampling_period"])
        drawn = {"actual": force, f"desired plus the error below {CUT_OFF:g} Hz": slow, "desired": desired}
        title = f"{kind}, cycle {run.config['cycles']}: {LEG_NAMES[SHOWN_LEG]} foot"
        series = [Series(name, time - time[0], values) for name, values in drawn.items()]
        panels.append(Panel(title, "time in the cycle, s", "force, N", series))
    return draw(panels, columns=1, height=1.9)


def table_published(results: Results) -> "pd.DataFrame":
    """How walks with the paper's constants, or all but one of them, end."""
    import pandas as pd

    rows = []
    for reference, group in results.select(part="published").by("reference").items():
        for variant, own in group.by("variant").items():
            cause = own.rows[0].summary.cause or own.rows[0].summary.status
            share = 100.0 * float(own.measure("walked").mean())
            rows.append(
                {"reference": reference, "walk": variant, "planned time walked, %": share, "first ends": cause}
            )
    return pd.DataFrame(rows)


def table_walks(results: Results) -> "pd.DataFrame":
    """The last cycle of every walk on the ladder."""
    import pandas as pd

    rows = []
    for part in ("made", "left out", "faster"):
        for walk, group in results.select(part=part).by("walk").items():
            for kind, own in group.by("feedforward").items():
                shown = {
                    f"{each.title}, {each.unit}": each.factor * estimate(last(own, name)).value
                    for name, each in QUANTITIES.items()
                }
                rows.append({"walk": walk, "with": kind, "completed": f"{sum(own.completed)} of {len(own)}", **shown})
    return pd.DataFrame(rows)
