"""The gait: phases of the feet, margins of static stability, and gaits that are refused."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import ConvexHull
from support.doors import BadInput

from cmacexp.planning.motion import make_timing
from cmacexp.planning.stability import margins

LF, RF, LR, RR = range(4)
STROKE = 0.3
WAVES = [(0.75, 2.0, 0.005), (0.8, 3.0, 0.005), (0.85, 3.0, 0.0025), (0.9, 5.0, 0.005), (11 / 12, 2.4, 0.005)]
"""Duty factor, cycle time and sampling period of gaits whose events fall on samples."""


@pytest.fixture
def walk_plan(plan_of):
    """The plan of a quadruped."""
    return lambda *overrides: plan_of("scenario=quadruped", *overrides)


def touch_downs(support):
    """Sample at which each foot touches down; each does so once."""
    legs, samples = np.nonzero((support & ~np.roll(support, 1, axis=0)).T)
    assert_array_equal(legs, range(support.shape[1]))
    return samples


@pytest.mark.parametrize(("duty", "cycle_time", "period"), WAVES)
def test_a_wave_has_the_phases_and_the_least_margins_of_the_theory(walk_plan, duty, cycle_time, period):
    """McGhee & Frank 1968: (duty factor - 3/4) stroke/duty factor behind lift-offs and before touch-downs."""
    plan = walk_plan(f"gait.duty_factor={duty!r}", f"gait.cycle_time={cycle_time}", f"sampling_period={period}")
    down, up, front = touch_downs(plan.support), touch_downs(~plan.support), plan.margins[:, 1]
    assert_allclose(down / len(plan.support), [0.0, 0.5, duty, duty - 0.5], atol=1e-12)
    assert_array_equal(np.argsort(up), [RR, RF, LR, LF])
    least = (duty - 0.75) * STROKE / duty
    assert_allclose(plan.margins[up[[LR, RR]], 2], least, atol=1e-9)
    before = down[[LF, RF]] - 1
    assert_allclose(2.0 * front[before] - front[before - 1], least, atol=1e-9)
    assert plan.margins[:, 1:].min() == pytest.approx(least, abs=1e-9)


@given(st.data(), st.booleans())
def test_every_foot_supports_for_exactly_its_duty_factor_from_its_touch_down_on(data, wave):
    """Of a wave at least three are down; touch-downs of one's own may be any."""
    samples = 2 * data.draw(st.integers(4, 2000))
    support = data.draw(st.integers(-(-3 * samples // 4) if wave else 1, samples - 1))
    begins = data.draw(st.lists(st.integers(0, samples - 1), min_size=4, max_size=4))
    own = None if wave else [begin / samples for begin in begins]
    timing = make_timing(SimpleNamespace(pattern="wave", duty_factor=support / samples, touch_down=own), samples)
    assert (timing.support_samples, timing.transfer_samples) == (support, samples - support)
    assert not wave or timing.support.sum(axis=1).min() == 3
    begins = touch_downs(timing.support) if wave else begins
    for leg, begin in enumerate(begins):
        assert_array_equal(np.roll(timing.support[:, leg], -begin), np.arange(samples) < support)
        assert_array_equal(np.roll(timing.sample[:, leg], -begin), [*range(support), *range(samples - support)])
    assert_array_equal(timing.progress, timing.sample / np.where(timing.support, support, samples - support))


# Margins of any polygon


def margins_of_hull(feet):
    """Margins of the origin in the convex hull of ``feet``, from its half planes; NaN where y = 0 misses it."""
    normal_x, _, offset = ConvexHull(feet).equations.T
    front, rear = ((-offset[side] / normal_x[side]) for side in (normal_x > 0.0, normal_x < 0.0))
    front, rear = front.min(), rear.max()
    return (-offset.max(), front, -rear) if rear <= front else (-offset.max(), np.nan, np.nan)


@pytest.mark.parametrize("count", [3, 4])
def test_margins_are_those_of_the_half_planes_of_the_feet_that_are_down(count):
    """Triangles and quadrangles, feet inside the others, the origin inside and outside, each moment by itself."""
    random = np.random.default_rng(count)
    feet = random.uniform(-1.0, 1.0, (300, count, 2)) + random.uniform(-0.5, 0.5, (300, 1, 2))
    down = random.random((300, count)) < 0.8
    expected = [margins_of_hull(f[d]) if d.sum() > 2 else [np.nan] * 3 for f, d in zip(feet, down, strict=True)]
    assert_allclose(margins(feet, down), expected, atol=1e-9)
    assert_array_equal(margins(feet.reshape(10, 30, count, 2)).reshape(300, 3), [margins(f) for f in feet])


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_a_foot_on_an_edge_or_within_changes_no_margin(scale):
    corners = scale * np.array([[0.3, 0.2], [0.25, -0.2], [-0.3, 0.1], [-0.2, -0.3]])
    for more in ((corners[0] + corners[1]) / 2.0, 0.25 * corners[2] + 0.75 * corners[3], np.zeros(2)):
        assert_allclose(margins(np.vstack([corners, more])), margins(corners), rtol=1e-9)


def test_an_origin_on_an_edge_has_the_margins_of_its_ends():
    assert_allclose(margins(np.array([[0.3, 0.0], [-0.2, 0.0], [0.0, 0.4]])), [0.0, 0.3, 0.2])


# Refusals


@pytest.mark.parametrize(
    ("override", "fewest"),
    [
        ("gait.touch_down=[0.0, 0.0, 0.5, 0.5]", 2),
        ("gait.touch_down=[0.0, 0.5, 0.25, 0.75]", 3),
        ("gait.duty_factor=0.7", 2),
    ],
)
def test_an_unstable_gait_is_refused_unless_it_is_allowed(walk_plan, override, fewest):
    with pytest.raises(BadInput, match=f"^{override.partition('=')[0]}="):
        walk_plan(override)
    plan = walk_plan(override, "gait.allow_unstable=true")
    down = plan.support.sum(axis=1)
    assert down.min() == fewest
    assert_array_equal(np.isnan(plan.margins[:, 0]), down < 3)
    assert fewest < 3 or plan.margins[:, 0].min() < 0.0
    assert all(np.isfinite(values).all() for values in (*plan.joints, plan.force_desired))


def test_an_uneven_number_of_steps_is_refused_and_the_period_named_is_not(walk_plan):
    with pytest.raises(BadInput, match=r"sampling_period") as caught:
        walk_plan("gait.cycle_time=3.025")
    named = re.search(r"try ([\d.]+)", str(caught.value))[1]
    assert len(walk_plan("gait.cycle_time=3.025", f"sampling_period={named}").support) % 2 == 0
