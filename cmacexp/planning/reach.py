"""Check that the planned foot paths are within the reach of the legs."""

import math

import numpy as np

from cmacexp.config import Config
from cmacexp.errors import BadInput
from cmacexp.models.mechanism import Mechanism, get_leg
from cmacexp.typing import Array

STRAIGHT = 1.0 - 1e-6
"""Largest extension over reach: a straight leg cannot move along itself."""
FOLDED = 1e-3
"""Least distance of the foot from its position with folded links, and from the height of the hip, m."""


def _round_down(value: float) -> str:
    """``value`` to four digits, rounded towards minus infinity, so that the printed limit is valid itself."""
    scale = 10.0 ** (3 - math.floor(math.log10(abs(value)))) if value else 1.0
    return f"{math.floor(value * scale) / scale:.10g}"


def _check_far(config: Config, mechanism: Mechanism, i: int, x: Array, y: Array) -> None:
    """Check that the path (N,) of leg ``i`` is within its full length."""
    leg = get_leg(mechanism, i)
    reach = (leg.length_1 + leg.length_2) * STRAIGHT
    distance = np.hypot(x, y)
    k = int(np.argmax(distance))
    if distance[k] <= reach:
        return
    where = f"the foot of leg {i + 1} would be {distance[k]:.3f} m from its hip at sample {k}, "
    where += f"but it reaches only {reach:.3f} m"
    depression = y.max() - mechanism.hip_height
    if y.max() >= reach and mechanism.hip_height < reach - 1e-6 and depression > 0.5 * (reach - FOLDED):
        key = "assumed_stiffness" if config.terrain.assumed_stiffness is not None else "stiffness"
        stiffest = config.assumed_stiffness * depression / (reach - mechanism.hip_height)
        allowed = (
            f"gives way by {depression:.3g} m under the desired force, further than leg {i + 1} reaches; "
            f"must be above {stiffest:.4g} N/m, or the desired force smaller"
        )
        raise BadInput(f"terrain.{key}", config.assumed_stiffness, allowed)
    if y.max() >= reach:
        height = mechanism.hip_height - (y.max() - reach)
        allowed = (
            f"{where}, and the ground gives way by {depression:.3g} m under the desired force; "
            f"must be below {_round_down(height - 1e-9)} m"
        )
        raise BadInput("machine.hip_height", mechanism.hip_height, allowed)
    # Every x is proportional to the stroke.
    room = np.sqrt(reach**2 - y**2) / np.maximum(np.abs(x), 1e-12)
    widest = config.gait.stroke * float(room.min())
    raise BadInput("gait.stroke", config.gait.stroke, f"{where}; must be at most {_round_down(widest)} m")


def _check_near(config: Config, mechanism: Mechanism, i: int, x: Array, y: Array) -> None:
    """Check that the path (N,) of leg ``i`` is below its hip, and outside the circle of the folded leg."""
    leg = get_leg(mechanism, i)
    nearest = float(abs(leg.length_1 - leg.length_2)) + FOLDED
    ground = float(y.max())
    if ground <= nearest:
        allowed = f"leg {i + 1} cannot fold that far: its foot comes no nearer to the hip than {nearest:.3f} m"
        raise BadInput("machine.hip_height", mechanism.hip_height, allowed)
    k = int(np.argmin(np.where(y < FOLDED, y, np.hypot(x, y))))
    if y[k] < FOLDED or np.hypot(x[k], y[k]) <= nearest:
        place = f"{abs(y[k]):.3f} m {'above' if y[k] < 0.0 else 'below'} its hip"
        allowed = (
            f"leg {i + 1} cannot lift its foot to {place}, as at sample {k}; "
            f"must be below {_round_down(ground - nearest)} m"
        )
        raise BadInput("gait.lift", config.gait.lift, allowed)


def check_reach(config: Config, mechanism: Mechanism, path: Array) -> None:
    """Check that the ``path`` (N, L, 2) of the feet, m, is within reach; raises BadInput with a value that is."""
    for i in range(mechanism.shape[0]):
        _check_near(config, mechanism, i, *path[:, i].T)
        _check_far(config, mechanism, i, *path[:, i].T)
