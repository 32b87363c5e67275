"""Figures and tables of the study of sensors."""

from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.report.numbers import format_number
from cmacexp.study import Results, over_setting
from cmacexp.study.interval import estimate
from pipelines import sensors_measures as measures
from pipelines.sensors_measures import BREAK, CHECK, ERRORS, FELT, GAIN_KEY, NO_CHECK, NONE, SOUND, WALK

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

CONTROLLERS = {"cmac": "with CMAC", "none": "feedback alone"}
FORCE = ERRORS[WALK]["force error"]
UNITS = {
    "force": ("% of the force", 100.0),
    "position": ("mrad", 1e3),
    "velocity": ("rad/s", 1.0),
    "height": ("mm", 1e3),
    "tilt": ("mrad", 1e3),
}
"""Of the noise on each signal, and the factor to it."""


def draw_failures(results: Results) -> "Figure":
    """Share of the failures after which the machine walks on, over the gain."""
    panels = [
        over_setting(
            own, GAIN_KEY, "share that walk on", lambda runs: np.array(runs.completed), "check",
            title=CONTROLLERS[feedforward], log="x",
        )
        for feedforward, own in results.by("feedforward").items()
    ]  # fmt: skip
    return draw(
        [Panel(p.title, "elasticity and admittance, m/N and m/(N s)", p.y, p.series, log="x") for p in panels]
    )


def draw_failure(results: Results) -> "Figure":
    """Desired, true and measured force of the leg with the broken sensor; the failure, and its detection."""
    panels = []
    for check, own in results.by("check").items():
        run = own.run
        fault, period = run.config["sensors"]["force"]["fault"], run.config["sampling_period"]
        trace = run.trace[run.trace["leg"] == fault["legs"][0]]
        series = [
            Series(name, trace["time"], trace[column])
            for name, column in (("desired", "force_desired"), ("true", "force"), ("measured", "force_measured"))
        ]
        rejected = [dropped["step"] * period for dropped in run.manifest["dropped"]]
        panels.append(Panel(check, "time, s", "force, N", series, x_limits=[fault["start"], *rejected]))
    return draw(panels, columns=1, height=1.9)


def draw_noise(results: Results) -> "Figure":
    """Errors and torque over those without noise, over the level of noise on each signal."""
    machine, panels = results.value("machine"), []
    for signal in results.values("signal"):
        if signal == NONE:
            continue
        levels = [float(level) for level in results.select(signal=signal).values("level")]
        (unit, factor), series = UNITS[signal], []
        for name, metric in ERRORS[machine].items():
            chosen = [results.select(signal=[NONE, signal], level=[None, level]) for level in levels]
            found = [estimate(measures.worsening(own, metric)) for own in chosen]
            series.append(Series(name, factor * np.array(levels), [each.value for each in found]))
        y = "value over that without noise"
        panels.append(Panel(f"noise on the {signal}", f"noise, {unit}", y, series, log="x", y_limits=[FELT]))
    return draw(panels, columns=3)


def table_of_gains(results: Results) -> "pd.DataFrame":
    """How many failures machines survive at each gain, and their force error."""
    import pandas as pd

    rows = []
    for feedforward, own in results.select(part=BREAK).by("feedforward").items():
        for gain, broken in own.by("gain").items():
            sound = results.select(part=SOUND, gain=gain, feedforward=feedforward)
            row = {"gain": gain, "controller": CONTROLLERS[feedforward], "sound: force error, N": _force(sound)}
            for check, runs in broken.by("check").items():
                row |= {f"{check}: walk on": f"{sum(runs.completed)} of {len(runs)}", f"{check}: N": _force(runs)}
            latest = broken.select(check=CHECK).measure("rejected_after").max()
            rows.append(row | {"detected after, at most, samples": latest})
    return pd.DataFrame(rows)


def _force(results: Results) -> float:
    return estimate(measures.end(results, FORCE)).value


def table_of_kinds(results: Results) -> "pd.DataFrame":
    """How many failures of each kind a machine survives at each gain, without and with the check."""
    import pandas as pd

    def cell(own: Results) -> str:
        without, checked = (sum(own.select(check=check).completed) for check in (NO_CHECK, CHECK))
        return f"{without}, {checked} of {len(own.select(check=CHECK))}"

    return pd.DataFrame(
        {"failure": kind} | {f"gain {gain}": cell(broken) for gain, broken in own.by("gain").items()}
        for kind, own in results.by("kind").items()
    )


def table_of_force_noise(results: Results) -> "pd.DataFrame":
    """Errors of the quadruped at each gain, without and with noise on the forces."""
    import pandas as pd

    shown = {
        "force error, N": (FORCE, 1.0),
        "feedback torque, N m": ("feedback_rms", 1.0),
        "tilt, mrad": ("tilt_max", 1e3),
    }
    return pd.DataFrame(
        {"gain": gain}
        | {
            f"{name}, {what}": estimate(factor * measures.end(own.select(signal=signal), metric)).value
            for name, (metric, factor) in shown.items()
            for what, signal in (("sound", NONE), ("noisy", "force"))
        }
        for gain, own in results.by("gain").items()
    )


def table_of_lateness(results: Results) -> "pd.DataFrame":
    """Transfer error at the end by what is late and by lead, or the cycle in which runs ended."""
    import pandas as pd

    def cell(own: Results) -> str:
        if all(own.completed):
            return format_number(1e3 * estimate(measures.end(own, "transfer_rmse_y")).value)
        return f"{sum(own.completed)} of {len(own)} complete; ended in {np.median(own.cycles) + 1:.0f}"

    return pd.DataFrame(
        {"late": late} | {f"lead {lead}": cell(each) for lead, each in own.by("learning.lead").items()}
        for late, own in results.by("late").items()
    )
