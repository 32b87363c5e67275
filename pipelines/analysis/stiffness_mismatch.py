"""Steady states of eq. 8-15 on ground that is not as stiff as the controller assumes."""

import math
from typing import Any

import pandas as pd

from cmacexp.planning.reference import SUPPORT_REFERENCES, Gains

METHODS = tuple(SUPPORT_REFERENCES)


def _reference(method: str, config: dict[str, Any], stiffness: float) -> float:
    """Depression per newton of desired force that is fed, m/N; NaN for a method without one."""
    controller, control = config["controller"], config["force_control"]
    gains = Gains(
        controller["position_gain"],
        controller["velocity_gain"],
        control["force_gain"],
        control["elasticity"],
        control["admittance"],
        stiffness,
    )
    return SUPPORT_REFERENCES[method](gains, True).depression


def predicted_force(method: str, config: dict[str, Any], assumed: float, factor: float) -> float:
    """Settled over desired force on ground ``factor`` times as stiff as ``assumed`` (N/m).

    The reference of eq. 9 and 13 is what the force needs on the assumed ground; the true ground answers with as much
    force as that reference would be made for there. Damping and explicit control do not know of the ground.
    """
    fed, needed = (_reference(method, config, stiffness) for stiffness in (assumed, factor * assumed))
    return 1.0 if math.isnan(fed) else fed / needed


def apparent_stiffness(softer: pd.DataFrame, stiffer: pd.DataFrame) -> float:
    """Stiffness of a controlled mass as the ground feels it, N/m: from where it rests on two grounds."""
    (force_1, depth_1), (force_2, depth_2) = (
        (trace["force"].iloc[-1], trace["y"].iloc[-1]) for trace in (softer, stiffer)
    )
    return float((force_2 - force_1) / (depth_1 - depth_2))
