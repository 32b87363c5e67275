"""What a quadruped is like: why a model that MuJoCo accepts is none that can walk, in one line."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.errors import BadInput
from cmacexp.models.robot_legs import Legs
from cmacexp.typing import Array

LONGEST_LEG, SHORTEST_LEG = 3.0, 0.05
"""Lengths of stretched legs, m: those of toys and of the largest machines that walked, with a margin."""
DENSITIES = (5.0, 5000.0)
"""Mass over the cube of the length of a stretched leg, kg/m^3; 76 to 320 of the robots that were measured."""
WIDEST = 3.0
"""Radius of gyration of a body over the length of a stretched leg."""
LIGHTEST = 1e-3
"""Part of the mass of the robot from which on the inertia of a body matters."""
LEAST_COSINE = 0.96
"""Of the angle between axes of the frame of the trunk and of the robot; 15 degrees are about the most."""


def require_frame(hips: Array, feet: Sequence[str]) -> None:
    """Require legs in order in the frame of the trunk, x forward, y left, z up; raises BadInput.

    ``hips`` (4, 3) are the thigh joints in that frame, m; ``feet`` their names for the message.
    """
    forward, left = hips[:2] - hips[2:], hips[::2] - hips[1::2]
    cosines = [each[axis] / np.linalg.norm(each) for axis, pair in enumerate((forward, left)) for each in pair]
    if not min(cosines) >= LEAST_COSINE:
        order = "front left, front right, rear left, rear right in the frame of the trunk, x forward, y left, z up"
        raise BadInput("machine.feet", ", ".join(feet), f"must be {order}: change the order, or turn the frame")


def require_sizes(path: Path, model: Any, legs: Legs, length: float) -> None:
    """Require sizes of a quadruped in m and kg, with legs of ``length``, m; raises BadInput."""

    def require(what: str, value: float, unit: str, least: float, most: float) -> None:
        if not least <= value <= most:
            reason = f"{what} is {value:.3g} {unit}, of robots {least:.3g} to {most:.3g}"
            raise BadInput("machine.path", path, f"{reason}: use m, kg and rad in the model")

    mass = float(model.body_subtreemass[legs.base])
    require("the length of a stretched leg", length, "m", SHORTEST_LEG, LONGEST_LEG)
    require("the mass", mass, "kg", *(density * length**3 for density in DENSITIES))
    for k in np.flatnonzero(model.body_mass > LIGHTEST * mass):
        inertia, most = float(model.body_inertia[k].max()), float(model.body_mass[k]) * (WIDEST * length) ** 2
        require(f"the moment of inertia of {model.body(k).name or f'body {k}'}", inertia, "kg m^2", 0.0, most)
