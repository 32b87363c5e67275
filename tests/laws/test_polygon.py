"""Laws of the polygon of support and of crossing legs, against hulls of scipy and intersections of straight lines."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmacexp.errors import BadInput
from cmacexp.models.leg import foot_position, trigonometry
from cmacexp.models.mechanism import get_leg
from cmacexp.planning.crossing import check_crossing, joints_in_plane
from cmacexp.planning.machine import make_mechanism
from cmacexp.planning.stability import margins


@pytest.fixture(scope="module")
def quadruped(make_config):
    config = make_config("scenario=quadruped")
    return config, make_mechanism(config.machine)


def test_links_keep_their_lengths_and_end_at_the_foot(quadruped):
    _, mechanism = quadruped
    q = np.random.default_rng(1).uniform(-3.0, 3.0, size=(20, 6))
    for i in range(4):
        leg = get_leg(mechanism, i)
        hip, knee, foot = joints_in_plane(mechanism, i, q)
        assert_allclose(np.linalg.norm(knee - hip, axis=1), leg.length_1)
        assert_allclose(np.linalg.norm(foot - knee, axis=1), leg.length_2)
        reached = [foot_position(leg, trigonometry(q1, q2)) for q1, q2 in q[:, :2]]
        assert_allclose(foot - hip, reached, atol=1e-12)
        assert_allclose(hip, [(mechanism.hips[i, 0], 0.0)] * 20)


def meet(a, b, c, d):
    """Whether the lines from ``a`` to ``b`` and from ``c`` to ``d`` have a point in common, by solving for it."""
    along = np.linalg.solve(np.column_stack([b - a, c - d]), c - a)
    return bool(((along >= 0.0) & (along <= 1.0)).all())


def test_legs_cross_where_links_of_one_side_meet(quadruped):
    """At the first instant, and only between the legs of one side."""
    config, mechanism = quadruped
    sides = [(i, j) for i in range(4) for j in range(i + 1, 4) if mechanism.hips[i, 1] == mechanism.hips[j, 1]]
    rng, found = np.random.default_rng(2), []
    for _ in range(60):
        joints = rng.uniform(-0.5, 3.5, size=(3, 4, 6))
        points = [joints_in_plane(mechanism, i, joints[:, i]) for i in range(4)]
        crossing = [
            (i, j, k)
            for i, j in sides
            for k in range(3)
            for m in (0, 1)
            for n in (0, 1)
            if meet(points[i][m][k], points[i][m + 1][k], points[j][n][k], points[j][n + 1][k])
        ]
        found.append(bool(crossing))
        if not crossing:
            check_crossing(config, mechanism, joints)
            continue
        first = min(k for i, j, k in crossing if (i, j) == crossing[0][:2])
        with pytest.raises(BadInput, match=f"would cross at t = {first * config.sampling_period:.3f} s"):
            check_crossing(config, mechanism, joints)
    assert 10 < sum(found) < 50


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_a_foot_on_an_edge_or_within_changes_no_margin(scale):
    corners = scale * np.array([[0.3, 0.2], [0.25, -0.2], [-0.3, 0.1], [-0.2, -0.3]])
    for more in ((corners[0] + corners[1]) / 2.0, 0.25 * corners[2] + 0.75 * corners[3], np.zeros(2)):
        assert_allclose(margins(np.vstack([corners, more])), margins(corners), rtol=1e-9)
