"""Static stability: margins of the centre of gravity in the polygon that feet span, and the check of a planned gait.

McGhee & Frank 1968: the margin is the distance from the projected centre of gravity to the nearest edge of the
polygon, negative outside. The paper's rear stability margin is the distance to its rear boundary along the body.
"""

from itertools import permutations

import numpy as np

from cmacexp.config import Config
from cmacexp.config.gait import PATTERNS
from cmacexp.errors import BadInput
from cmacexp.typing import Array, Mask

STABILITY, FRONT, REAR = range(3)
ROUNDING = 1e-9
"""A margin no more negative than this is zero, m."""
ON_EDGE = 1e-12
"""A foot whose cross product with an edge is no more negative than this lies on the edge, m^2."""
SAME_PLACE = 1e-6
"""Feet closer together than this span no edge, m."""


def margins(feet: Array, down: Mask | None = None) -> Array:
    """Margins (..., 3) of the origin in the polygon of feet (..., L, 2), m: nearest edge, front and rear along x.

    NaN with fewer than three feet; front and rear are NaN where the line along x misses the polygon. ``down`` (...,
    L) are those that span it; None: all.
    """
    x, y = np.ascontiguousarray(np.moveaxis(feet, (-1, -2), (0, 1)))
    present = np.ones(x.shape, dtype=bool) if down is None else np.moveaxis(down, -1, 0)
    nearest, front, behind = (np.full(feet.shape[:-2], value) for value in (np.inf, -np.inf, np.inf))
    for i, j in permutations(range(len(x)), 2):
        ex, ey = x[j] - x[i], y[j] - y[i]
        length = np.hypot(ex, ey)
        edge = present[i] & present[j] & (length > SAME_PLACE)
        for k in set(range(len(x))) - {i, j}:
            edge &= ~present[k] | (ex * (y[k] - y[i]) - ey * (x[k] - x[i]) >= -ON_EDGE)
        with np.errstate(divide="ignore", invalid="ignore"):
            # The cross product of an edge with the way to the origin is positive where that is on its inner side.
            distance, along = (ey * x[i] - ex * y[i]) / length, x[i] - y[i] / ey * ex
        crosses = edge & (np.minimum(y[i], y[i] + ey) <= 0.0) & (np.maximum(y[i], y[i] + ey) >= 0.0) & (ey != 0.0)
        nearest = np.where(edge, np.minimum(nearest, distance), nearest)
        front = np.where(crosses, np.maximum(front, along), front)
        behind = np.where(crosses, np.minimum(behind, along), behind)
    distances = np.stack([nearest, front, -behind], axis=-1)
    distances[(present.sum(axis=0)[..., None] < 3) | np.isinf(distances)] = np.nan
    return distances


def check_stability(config: Config, support: Mask, planned: Array) -> None:
    """Check that a gait of ``support`` (N, L) and ``planned`` margins (N, 3), m, is stable; raises BadInput."""
    gait = config.gait
    if gait.allow_unstable or PATTERNS[gait.pattern].is_dynamic:
        return
    key = "duty_factor" if gait.touch_down is None else "touch_down"
    few, k = np.flatnonzero(support.sum(axis=1) < 3), int(np.argmin(planned[:, STABILITY]))
    if len(few):
        k = few[0]
        reason = f"only {support[k].sum()} feet are down at t = {k * config.sampling_period:.3f} s, three are needed"
    elif planned[k, STABILITY] < -ROUNDING:
        margin, time = planned[k, STABILITY], k * config.sampling_period
        reason = f"the planned stability margin is {margin:.4f} m at t = {time:.3f} s, below 0"
    else:
        return
    remedy = "choose another value, or set gait.allow_unstable=true"
    raise BadInput(f"gait.{key}", getattr(gait, key), f"{reason}; {remedy}")
