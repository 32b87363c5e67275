"""Where the force of one leg settles, from statics alone: under feedback, and once the feedforward carries all."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.planning.reference import Gains, combined_reference

if TYPE_CHECKING:
    import pandas as pd

Config = Mapping[str, Any]
EVERY = 20
"""Samples between the postures at which the weight of the leg is taken."""


def _reference(config: Config, static_load: bool) -> float:
    """Depth of the reference below the ground per newton of desired force, m/N."""
    controller, force = config["controller"], config["force_control"]
    names = ("position_gain", "velocity_gain")
    gains = Gains(
        *(controller[name] for name in names),
        force["force_gain"],
        force["elasticity"],
        force["admittance"],
        config["terrain"]["stiffness"],
    )
    return combined_reference(gains, static_load).depression


def literal_depth(config: Config) -> float:
    """D_r of eq. 13, m."""
    return _reference(config, True) * float(config["force_control"]["desired_force"])


def learned_error(config: Config) -> float:
    """Relative force error where the feedback is zero: D_r / (1/K_n + P_fn + K_av/K_ap V_fn) / F_d - 1."""
    return _reference(config, True) / _reference(config, False) - 1.0


def weight_at_foot(rows: "pd.DataFrame", config: Config) -> float:
    """What the weight of the leg presses the foot down with, N; mean over the postures of ``rows``."""
    from cmacexp.models.leg import Leg, bias_torque, jacobian, trigonometry

    links = config["machine"]["leg"]
    sizes = (links[name] for name in ("length_1", "length_2", "mass_1", "mass_2"))
    leg = Leg(*sizes, -1.0 if links["knee"] == "back" else 1.0)
    pressing = []
    for q1, q2 in zip(rows["q1"].iloc[::EVERY], rows["q2"].iloc[::EVERY], strict=True):
        trig = trigonometry(q1, q2)
        j11, j12, j21, j22 = jacobian(leg, trig)
        lifting = np.linalg.solve([[j11, j21], [j12, j22]], bias_torque(leg, trig, 0.0, 0.0))
        pressing.append(-lifting[1])
    return float(np.mean(pressing))


def _stiffness(config: Config) -> float:
    """How much less feedback and ground press for each newton of force, N/N: 1 + K_ap (1/K_n + P_fn + ...)."""
    return 1.0 + float(config["controller"]["position_gain"]) * _reference(config, False)


def feedback_force(config: Config, weight: float) -> float:
    """Force at which feedback alone and a weight at the foot balance the ground, N.

    K_ap (D_r - P_fn F - F/K_n) - K_av V_fn F + weight = F.
    """
    return (config["controller"]["position_gain"] * literal_depth(config) + weight) / _stiffness(config)


def weight_for(config: Config, force: float) -> float:
    """The weight at the foot (N, negative lifts it) with which feedback alone would settle at ``force`` (N)."""
    return force * _stiffness(config) - float(config["controller"]["position_gain"]) * literal_depth(config)
