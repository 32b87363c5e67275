"""Static stability of a gait: margins of the centre of gravity over the planned support polygon.

McGhee & Frank 1968: the margin is the distance from the projected centre of gravity to the nearest edge of the
polygon, negative outside. The paper's rear stability margin is the distance to its rear boundary along the body.
"""

import numpy as np

from cmacexp.config import Config
from cmacexp.errors import BadInput
from cmacexp.models.mechanism import Mechanism
from cmacexp.typing import Array, Mask

STABILITY, FRONT, REAR = range(3)
ROUNDING = 1e-9
"""A margin no more negative than this is zero, m."""


def _half_hull(feet: list[Array]) -> list[Array]:
    """Feet that bound the others on one side, by turning left from each to the next."""
    hull: list[Array] = []
    for foot in feet:
        while len(hull) > 1 and np.cross(np.append(hull[-1] - hull[-2], 0), np.append(foot - hull[-1], 0))[2] <= 0.0:
            hull.pop()
        hull.append(foot)
    return hull[:-1]


def polygon(feet: Array) -> Array:
    """Convex hull of feet (n, 2), counterclockwise (Andrew 1979); a foot inside the hull is no corner."""
    ordered = [feet[i] for i in np.lexsort((feet[:, 1], feet[:, 0]))]
    return np.array(_half_hull(ordered) + _half_hull(ordered[::-1]))


def margins(feet: Array) -> tuple[float, float, float]:
    """Margins of the origin in the polygon of ``feet`` (n, 2), m: nearest edge, front and rear boundary along x.

    NaN with fewer than three feet; front and rear are NaN where the line along the body misses the polygon.
    """
    if len(feet) < 3:
        return float("nan"), float("nan"), float("nan")
    corners = polygon(feet)
    edges = np.roll(corners, -1, axis=0) - corners
    # The cross product of an edge with the way to the origin is positive where the origin lies on its inner side.
    nearest = float(((edges[:, 1] * corners[:, 0] - edges[:, 0] * corners[:, 1]) / np.hypot(*edges.T)).min())
    start, end = corners[:, 1], corners[:, 1] + edges[:, 1]
    crossing = (np.minimum(start, end) <= 0.0) & (np.maximum(start, end) >= 0.0) & (edges[:, 1] != 0.0)
    if not crossing.any():
        return nearest, float("nan"), float("nan")
    along = corners[crossing, 0] - start[crossing] / edges[crossing, 1] * edges[crossing, 0]
    return nearest, float(along.max()), float(-along.min())


def plan_margins(mechanism: Mechanism, feet: Array, support: Mask) -> Array:
    """Margins (N, 3) over a cycle: nearest edge, front, rear, m.

    Args:
        mechanism: the machine.
        feet: (N, L, 2): planned feet relative to the centre of gravity, m.
        support: (N, L): planned phases.
    """
    return np.array([margins(feet[k, support[k]]) for k in range(len(feet))]).reshape(-1, 3)


def check_stability(config: Config, support: Mask, planned: Array) -> None:
    """Check that a gait is statically stable throughout.

    Raises:
        BadInput: names the instant, and the feet that are down or the margin.
    """
    gait = config.gait
    if gait.allow_unstable:
        return
    own = gait.touch_down is not None
    key, value = ("gait.touch_down", gait.touch_down) if own else ("gait.duty_factor", gait.duty_factor)
    remedy = "take another, or set gait.allow_unstable=true"
    few = np.flatnonzero(support.sum(axis=1) < 3)
    if len(few):
        when = few[0] * config.sampling_period
        raise BadInput(
            key,
            value,
            f"only {support[few[0]].sum()} feet are down at t = {when:.3f} s, three are needed; {remedy}",
        )
    k = int(np.argmin(planned[:, STABILITY]))
    if planned[k, STABILITY] < -ROUNDING:
        when = k * config.sampling_period
        raise BadInput(
            key,
            value,
            f"the stability margin is {planned[k, STABILITY]:.4f} m at t = {when:.3f} s, below 0; {remedy}",
        )
