"""What a quadruped is like: why a model that MuJoCo accepts is none that can walk, in one line."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.models.leg import GRAVITY
from cmacexp.models.robot_legs import LEGS, Legs
from cmacexp.typing import Array

LONGEST_LEG, SHORTEST_LEG = 3.0, 0.05
"""Lengths of stretched legs, m: those of toys and of the largest machines that walked, with a margin."""
DENSITIES = (5.0, 5000.0)
"""Mass over the cube of the length of a stretched leg, kg/m^3; 76 to 320 of the robots that were measured."""
SPACINGS = (0.1, 10.0)
"""Distance of hips of a diagonal over that length."""
LARGEST_FOOT = 0.3
"""Radius of a foot over that length."""
WIDEST = 3.0
"""Radius of gyration of a body over the distance of the hips of a diagonal."""
LIGHTEST = 1e-3
"""Part of the mass of the robot from which on the inertia of a body matters."""
MOST_TURNED = 15.0
"""Largest angle between axes of the frame of the trunk and of the robot, degrees."""


def require_frame(path: Path, trunk: str, hips: Array, feet: Sequence[str]) -> None:
    """Require legs in order in the frame of the ``trunk``, x forward, y left, z up; raises BadInput.

    ``hips`` (4, 3) are the thigh joints in that frame, m.
    """
    forward, left = hips[:2] - hips[2:], hips[::2] - hips[1::2]
    mean_forward, mean_left = forward.mean(axis=0), left.mean(axis=0)
    up = np.cross(mean_forward, mean_left)
    lean = np.degrees(np.arctan2(np.hypot(*up[:2]), up[2]))
    turned = float(np.degrees(np.arctan2(mean_forward[1], mean_forward[0])))
    if min(forward[0] @ forward[1], left[0] @ left[1]) <= 0.0 or (max(lean, abs(turned)) > 135.0):
        order = "front left, front right, rear left, rear right (trunk: x forward, y left)"
        raise BadInput("machine.feet", ", ".join(feet), f"must be in the order {order}")
    if max(lean, abs(turned)) > MOST_TURNED:
        by = f"leans by {lean:.0f} degrees" if lean > MOST_TURNED else f"is turned by {abs(turned):.0f} degrees"
        reason = (
            f"the frame of its trunk {trunk or '(without a name)'} {by}: turn it in the model, x forward and z up"
        )
        raise BadInput("machine.path", path, reason)


def require_sizes(path: Path, model: Any, legs: Legs, length: float, hips: Array) -> None:
    """Require sizes of a quadruped in m and kg: legs of ``length``, m, at ``hips`` (4, 3), m; raises BadInput."""

    def require(what: str, value: float, unit: str, least: float, most: float) -> None:
        if not least <= value <= most:
            reason = f"{what} is {value:.3g} {unit}, of robots {least:.3g} to {most:.3g}"
            raise BadInput("machine.path", path, f"{reason}: use m, kg and rad in the model")

    mass = float(model.body_subtreemass[legs.base])
    spacing = float(np.linalg.norm(hips[[0, 1]] - hips[[3, 2]], axis=1).min())
    require("the length of a stretched leg", length, "m", SHORTEST_LEG, LONGEST_LEG)
    require("the mass", mass, "kg", *(density * length**3 for density in DENSITIES))
    require("the distance of diagonal hips", spacing, "m", *(part * length for part in SPACINGS))
    require("the least damping of a joint", float(model.dof_damping.min()), "N m s/rad", 0.0, np.inf)
    require("the radius of a foot", float(legs.foot_radius.max()), "m", 0.0, LARGEST_FOOT * length)
    for k in np.flatnonzero(model.body_mass > LIGHTEST * mass):
        inertia = float(model.body_inertia[k].max())
        most = float(model.body_mass[k]) * (WIDEST * spacing) ** 2
        require(f"the moment of inertia of {model.body(k).name or f'body {k}'}", inertia, "kg m^2", 0.0, most)


def require_home(model: Any, data: Any, legs: Legs, length: float, torques: Array) -> None:
    """Require feet below their hips, and springs weaker than the ``torques`` (3,), N m, and than the legs' load.

    ``data`` has the legs, of ``length`` m, at home under a level trunk, after a forward pass. Raises BadInput.
    """
    below = data.xanchor[legs.joint[:, 1], 2] - data.geom_xpos[legs.foot_geom, 2]
    for i in np.flatnonzero(below <= 0.0):
        reason = f"puts the foot {-below[i]:.3g} m above {model.joint(int(legs.joint[i, 1])).name}; bend it downwards"
        raise BadInput("machine.home", data.qpos[legs.qpos[i]].tolist(), reason)
    largest = np.minimum(torques, model.body_subtreemass[legs.base] * GRAVITY * length / LEGS)
    spring = np.abs(data.qfrc_spring[legs.dof])
    for i, n in np.argwhere(spring > largest):
        name = model.joint(int(legs.joint[i, n])).name
        reason = f"has a spring of {spring[i, n]:.3g} N m at machine.home, more than the leg can hold"
        raise BadInput("machine.joints", name, f"{reason}: check springref")
