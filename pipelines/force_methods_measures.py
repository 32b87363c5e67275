"""Steady states of a force-controlled point mass: measured, and those of eq. 8-15."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.planning.reference import SUPPORT_REFERENCES, Gains
from cmacexp.study import Results
from cmacexp.typing import Array

if TYPE_CHECKING:
    import pandas as pd

METHODS = tuple(SUPPORT_REFERENCES)
DIGITS = 6
"""Decimals of measures: what is below is rounding of the simulation."""


def settled_force(run: StoredRun) -> float:
    """Mean force over the second half of the run over the desired one; inf if the run ended before."""
    if run.status != "completed":
        return math.inf
    desired = float(run.config["force_control"]["desired_force"])
    return round(float(run.metrics["force_settled"].iloc[0]) / desired, DIGITS)


def rest_error(run: StoredRun) -> float:
    """RMS force error over the second half of the run, of the desired force; inf if the run ended before."""
    if run.status != "completed":
        return math.inf
    ripple = float(run.metrics["force_ripple"].iloc[0]) / float(run.config["force_control"]["desired_force"])
    return round(math.hypot(settled_force(run) - 1.0, ripple), DIGITS)


def end_speed(run: StoredRun) -> float:
    """Speed in the last step, m/s; inf if the run ended before."""
    return round(abs(float(run.trace["vy"].iloc[-1])), DIGITS) if run.status == "completed" else math.inf


def over_best_other(results: Results, metric: str, resting: float) -> Array:
    """(1,): a metric of combined control over the least of the other methods that come to rest; inf if it does not.

    Args:
        results: a run for each method.
        metric: of which small values are better.
        resting: largest :func:`rest_error` of a run that comes to rest.
    """
    rests = np.isfinite(results.at(1, metric)) & (results.measure("rest_error") <= resting)
    values = np.where(rests, results.at(1, metric), np.inf)
    combined = np.array([row.settings["method"] == "combined" for row in results.rows])
    if not rests[combined].all():
        return np.array([np.inf])
    ratio: Array = values[combined] / values[~combined].min()
    return ratio


def _depression(config: dict[str, Any], stiffness: float) -> float:
    """Depression per newton of desired force that is fed, m/N; NaN for a method without one."""
    controller, control = config["controller"], config["force_control"]
    gains = Gains(
        controller["position_gain"], controller["velocity_gain"], control["force_gain"], control["elasticity"],
        control["admittance"], stiffness,
    )  # fmt: skip
    return SUPPORT_REFERENCES[control["method"]](gains, True).depression


def predicted_force(config: dict[str, Any]) -> float:
    """Settled over desired force on ground that is not as stiff as assumed.

    The reference of eq. 9 and 13 is what the force needs on the assumed ground; the true ground answers with as much
    force as that reference would be made for there. Damping and explicit control do not know of the ground.
    """
    ground = config["terrain"]
    fed, needed = (_depression(config, ground[name]) for name in ("assumed_stiffness", "stiffness"))
    return 1.0 if math.isnan(fed) else fed / needed


def apparent_stiffness(softer: "pd.DataFrame", stiffer: "pd.DataFrame") -> float:
    """Stiffness of a controlled mass as the ground feels it, N/m: from where it rests on two grounds."""
    (force_1, depth_1), (force_2, depth_2) = (
        (trace["force"].iloc[-1], trace["y"].iloc[-1]) for trace in (softer, stiffer)
    )
    return float((force_2 - force_1) / (depth_1 - depth_2))


def predicted_forces(results: Results) -> Array:
    """(runs,): :func:`predicted_force` of each run."""
    return np.array([predicted_force(run.config) for run in results.runs])


def springs(results: Results) -> tuple[Array, Array]:
    """Apparent stiffness under stiffness control for each elasticity, rising, N/m: measured, and after eq. 8.

    Args:
        results: runs on two grounds for each elasticity.
    """
    groups = sorted(results.by("force_control.elasticity").items())
    traces = [[run.trace for run in group.runs] for _, group in groups]
    gain = float(results.value("controller.position_gain"))
    measured = np.array([round(apparent_stiffness(softer, stiffer), DIGITS) for softer, stiffer in traces])
    return measured, np.array([gain / (1.0 + gain * float(elasticity)) for elasticity, _ in groups])
