"""Static stability: margins of the centre of gravity in the support polygon, and the check of a planned gait.

McGhee & Frank 1968: the margin is the distance from the projected centre of gravity to the nearest edge of the
polygon, negative outside. The paper's rear stability margin is the distance to its rear boundary along the body. The
true margins of a walk use the actual positions of the feet that carry load.
"""

from collections.abc import Mapping
from itertools import permutations
from typing import NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.config.gait import PATTERNS
from cmacexp.errors import BadInput
from cmacexp.models.body import Load
from cmacexp.models.leg import GRAVITY
from cmacexp.models.mechanism import Mechanism
from cmacexp.typing import Array, Mask

STABILITY, FRONT, REAR = range(3)
ROUNDING = 1e-9
"""Largest negative margin that counts as zero, m."""
ON_EDGE = 1e-12
"""Largest negative cross product of an edge with a foot that counts as on the edge, m^2."""
SAME_POSITION = 1e-6
"""Distance of two feet up to which they span no edge, m."""


def margins(feet: Array, down: Mask | None = None) -> Array:
    """Compute the margins (..., 3), m, of the origin in the polygon of ``feet`` (..., L, 2), m.

    They are those to the nearest edge, and to front and rear along x: NaN with fewer than three feet; front and rear
    are NaN where the line along x misses the polygon. ``down`` (..., L) is true for the feet that span it; None:
    all.
    """
    x, y = np.ascontiguousarray(np.moveaxis(feet, (-1, -2), (0, 1)))
    present = np.ones(x.shape, dtype=bool) if down is None else np.moveaxis(down, -1, 0)
    nearest, front, behind = (np.full(feet.shape[:-2], value) for value in (np.inf, -np.inf, np.inf))
    for i, j in permutations(range(len(x)), 2):
        ex, ey = x[j] - x[i], y[j] - y[i]
        length = np.hypot(ex, ey)
        edge = present[i] & present[j] & (length > SAME_POSITION)
        for k in set(range(len(x))) - {i, j}:
            edge &= ~present[k] | (ex * (y[k] - y[i]) - ey * (x[k] - x[i]) >= -ON_EDGE)
        with np.errstate(divide="ignore", invalid="ignore"):
            # The cross product of an edge with the vector to the origin is positive on the inner side of the edge.
            distance = (ey * x[i] - ex * y[i]) / length
            along = x[i] - y[i] / ey * ex
        crosses = edge & (np.minimum(y[i], y[i] + ey) <= 0.0) & (np.maximum(y[i], y[i] + ey) >= 0.0) & (ey != 0.0)
        nearest = np.where(edge, np.minimum(nearest, distance), nearest)
        front = np.where(crosses, np.maximum(front, along), front)
        behind = np.where(crosses, np.minimum(behind, along), behind)
    distances = np.stack([nearest, front, -behind], axis=-1)
    distances[(present.sum(axis=0)[..., None] < 3) | np.isinf(distances)] = np.nan
    return distances


def check_stability(config: Config, support: Mask, planned: Array) -> None:
    """Check that a gait with ``support`` (N, L) and ``planned`` margins (N, 3), m, is stable; else raise BadInput."""
    gait = config.gait
    if gait.allow_unstable or PATTERNS[gait.pattern].is_dynamic:
        return
    key = "duty_factor" if gait.touch_down is None else "touch_down"
    few = np.flatnonzero(support.sum(axis=1) < 3)
    k = int(np.argmin(planned[:, STABILITY]))
    if len(few):
        k = few[0]
        reason = f"only {support[k].sum()} feet are down at t = {k * config.sampling_period:.3f} s, three are needed"
    elif planned[k, STABILITY] < -ROUNDING:
        margin = f"the planned stability margin is {planned[k, STABILITY]:.4f} m"
        reason = f"{margin} at t = {k * config.sampling_period:.3f} s, below 0"
    else:
        return
    remedy = "choose another value, or set gait.allow_unstable=true"
    raise BadInput(f"gait.{key}", vars(gait)[key], f"{reason}; {remedy}")


class Masses(NamedTuple):
    """Masses of a machine with a body and its payload."""

    mechanism: Mechanism
    body_mass: float | None
    """Mass of the body without legs, kg; None: the legs are massless, all weight of the mechanism is at its
    centre."""
    payload: Load
    carried: Mask
    """(N,): True while the body carries the payload."""
    centre: Array | None = None
    """(3, N): centre of gravity of a robot without payload in the body frame, m; None: it is computed from the
    masses."""


def centre_of_gravity(masses: Masses, q1: Array, feet: Array) -> Array:
    """Compute the centre of gravity in the body frame, (3, N), m: x forward, y left, z up.

    ``q1`` (L, N) are angles of the thighs, rad, ``feet`` (3, L, N) positions of the feet in the body frame, m.
    """
    mechanism = masses.mechanism
    weight = mechanism.weight
    moment = np.zeros((3, feet.shape[2]))
    if masses.centre is not None:
        moment = weight * masses.centre
    elif masses.body_mass is not None:
        hip_x, hip_y = mechanism.hips.T[..., None]
        legs = mechanism.planar_legs
        length, knee_mass, foot_mass = (values[:, None] for values in (legs.length_1, legs.mass_1, legs.mass_2))
        knees = np.stack([hip_x + length * np.cos(q1), hip_y + 0.0 * q1, -length * np.sin(q1)])
        weight = GRAVITY * (masses.body_mass + knee_mass.sum() + foot_mass.sum())
        moment = GRAVITY * (knee_mass * knees + foot_mass * feet).sum(axis=1)
    load = np.where(masses.carried, masses.payload.weight, 0.0)
    return (moment + load * np.array([[masses.payload.x], [masses.payload.y], [0.0]])) / (weight + load)


def true_margins(masses: Masses, legs: Mapping[str, Array], body: Mapping[str, Array]) -> Array:
    """Compute the margins (N, 3), m, of the centre of gravity among the feet that carry load, under the tilted body.

    They are nearest edge, front and rear boundary, as in :func:`margins`. ``legs`` (N, L) and ``body`` (N,) hold the
    columns of the traces by name.
    """
    down, q1, force = (np.ascontiguousarray(legs[name].T) for name in ("y", "q1", "force"))
    hip_x, hip_y = masses.mechanism.hips.T[..., None]
    aside = legs["z"].T if "z" in legs else 0.0 * down
    feet = np.stack([hip_x + legs["x"].T, hip_y + aside, -down])
    x, y, z = feet - centre_of_gravity(masses, q1, feet)[:, None]
    (sp, cp), (sr, cr) = ((np.sin(body[name]), np.cos(body[name])) for name in ("pitch", "roll"))
    level = np.stack([x * cp + (y * sr + z * cr) * sp, y * cr - z * sr])
    return margins(np.moveaxis(level, (0, 1), (-1, -2)), (force > 0.0).T)
