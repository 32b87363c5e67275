"""Check of a plan for collisions between the legs of one side."""

from itertools import combinations, product

import numpy as np

from cmacexp.config import Config
from cmacexp.config.machine import LEG_KEYS
from cmacexp.errors import BadInput
from cmacexp.models.mechanism import Mechanism
from cmacexp.planning.columns import Q1, Q2
from cmacexp.typing import Array, Mask


def joints_in_plane(mechanism: Mechanism, i: int, joints: Array) -> Array:
    """Hip, knee and foot of leg ``i`` along its plan (N, 6), (3, N, 2): x forward, y down in the body frame, m."""
    l1, l2 = mechanism.legs[i, 0], mechanism.legs[i, 1]
    q1, q12 = joints[:, Q1], joints[:, Q1] + joints[:, Q2]
    hip = np.stack([np.full(len(q1), mechanism.hips[i, 0]), np.zeros(len(q1))], axis=1)
    knee = hip + l1 * np.stack([np.cos(q1), np.sin(q1)], axis=1)
    return np.stack([hip, knee, knee + l2 * np.stack([np.cos(q12), np.sin(q12)], axis=1)])


def _side(a: Array, b: Array, point: Array) -> Array:
    """Side of the line from ``a`` to ``b`` of each point, -1, 0 or 1; all (N, 2)."""
    return np.sign((b[:, 0] - a[:, 0]) * (point[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (point[:, 0] - a[:, 0]))


def _links_cross(a: Array, b: Array, c: Array, d: Array) -> Mask:
    """Whether the links from ``a`` to ``b`` and from ``c`` to ``d`` cross, sample by sample; all (N, 2)."""
    return (_side(a, b, c) * _side(a, b, d) <= 0) & (_side(c, d, a) * _side(c, d, b) <= 0)


def check_crossing(config: Config, mechanism: Mechanism, joints: Array) -> None:
    """Check that the legs of each side do not touch in a plan of joint angles (N, L, 6).

    Raises:
        BadInput: names the legs and the instant.
    """
    points = [joints_in_plane(mechanism, i, joints[:, i]) for i in range(len(mechanism.legs))]
    for i, j in combinations(range(len(points)), 2):
        if mechanism.hips[i, 1] != mechanism.hips[j, 1]:
            continue
        crossing = np.zeros(len(joints), dtype=bool)
        for m, n in product((0, 1), repeat=2):
            crossing |= _links_cross(points[i][m], points[i][m + 1], points[j][n], points[j][n + 1])
        if crossing.any():
            time = int(np.argmax(crossing)) * config.sampling_period
            where = f"legs {LEG_KEYS[i]} and {LEG_KEYS[j]} would cross at t = {time:.3f} s"
            remedy = "must be shorter, or the hips further apart; front knees bend forward and rear knees back"
            raise BadInput("gait.stroke", config.gait.stroke, f"{where}; {remedy}")
