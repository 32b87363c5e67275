"""The true stability margin of a walk: of its centre of gravity among the feet that carry load, wherever they are."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from cmacexp.models.body import Load
from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.stability import margins
from cmacexp.typing import Array, Mask


class Masses(NamedTuple):
    """What gives a machine with a body its weight."""

    mechanism: Mechanism
    body_mass: float | None
    """Without legs, kg; None: the legs do not load the body, all weight of the mechanism is at its centre."""
    payload: Load
    carried: Mask
    """(N,): whether the payload is there."""
    centre: Array | None = None
    """(3, N): centre of gravity of a robot without payload in the body frame, m; None: it follows from masses."""


def centre_of_gravity(masses: Masses, q1: Array, feet: Array) -> Array:
    """Centre of gravity in the body frame, (3, N), m: x forward, y left, z up; ``feet`` (3, L, N) likewise.

    ``q1`` (L, N) are angles of the thighs, rad.
    """
    mechanism, payload = masses.mechanism, masses.payload
    weight, moment = mechanism.weight, np.zeros((3, feet.shape[2]))
    if masses.centre is not None:
        moment = weight * masses.centre
    elif masses.body_mass is not None:
        (hip_x, hip_y), legs = mechanism.hips.T[..., None], mechanism.planar_legs
        length, knee_mass, foot_mass = (each[:, None] for each in (legs.length_1, legs.mass_1, legs.mass_2))
        knees = np.stack([hip_x + length * np.cos(q1), hip_y + 0.0 * q1, -length * np.sin(q1)])
        weight = GRAVITY * (masses.body_mass + knee_mass.sum() + foot_mass.sum())
        moment = GRAVITY * (knee_mass * knees + foot_mass * feet).sum(axis=1)
    load = np.where(masses.carried, payload.weight, 0.0)
    return (moment + load * np.array([[payload.x], [payload.y], [0.0]])) / (weight + load)


def true_margins(masses: Masses, legs: Mapping[str, Array], body: Mapping[str, Array]) -> Array:
    """Margins (N, 3) of the centre of gravity among the feet that carry load, under the tilted body, m.

    Nearest edge, front and rear boundary, as :func:`cmacexp.planning.stability.margins` gives them. Columns of legs
    (N, L) and body (N,) are by the names of the traces.
    """
    down, q1, force = (np.ascontiguousarray(legs[name].T) for name in ("y", "q1", "force"))
    hip_x, hip_y = masses.mechanism.hips.T[..., None]
    aside = legs["z"].T if "z" in legs else 0.0 * down
    feet = np.stack([hip_x + legs["x"].T, hip_y + aside, -down])
    x, y, z = feet - centre_of_gravity(masses, q1, feet)[:, None]
    (sp, cp), (sr, cr) = ((np.sin(body[name]), np.cos(body[name])) for name in ("pitch", "roll"))
    level = np.stack([x * cp + (y * sr + z * cr) * sp, y * cr - z * sr])
    return margins(np.moveaxis(level, (0, 1), (-1, -2)), (force > 0.0).T)
