"""Laws of the gait: phases, static stability, and the gaits that are refused."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import ConvexHull

from cmacexp.errors import BadInput
from cmacexp.planning.gait import make_timing
from cmacexp.planning.machine import make_mechanism
from cmacexp.planning.stability import margins

LF, RF, LR, RR = range(4)
WAVES = [(0.75, 2.0, 0.005), (0.8, 3.0, 0.005), (0.85, 3.0, 0.0025), (0.9, 5.0, 0.005), (11 / 12, 2.4, 0.005)]
"""Duty factor, cycle time and sampling period of gaits whose events fall on samples."""
DUTIES = [duty for duty, _, _ in WAVES]
GOLDEN = {0.75: 0.0, 0.8: 18.75e-3, 0.85: 0.6 / 17.0, 0.9: 50e-3, 11 / 12: 0.6 / 11.0}
"""(duty factor - 3/4) stroke/duty factor for a stroke of 0.3 m, m."""


def of_wave(duty):
    """The command line of a wave gait whose events fall on samples."""
    _, cycle_time, period = WAVES[DUTIES.index(duty)]
    return f"gait.duty_factor={duty!r}", f"gait.cycle_time={cycle_time}", f"sampling_period={period}"


@pytest.fixture
def walk_plan(plan_of):
    """The plan of a quadruped."""
    return lambda *overrides: plan_of("scenario=quadruped", *overrides)


@pytest.fixture
def refusal(walk_plan):
    """What a command line is refused with."""

    def refused(*overrides):
        with pytest.raises(BadInput) as caught:
            walk_plan(*overrides)
        assert "\n" not in str(caught.value)
        return caught.value

    return refused


def timing_of(duty, samples, touch_down=None):
    gait = SimpleNamespace(pattern="wave", duty_factor=duty, touch_down=touch_down)
    return make_timing(gait, samples)


def touch_downs(support):
    """Sample at which each foot touches down; each does so once."""
    legs, samples = np.nonzero((support & ~np.roll(support, 1, axis=0)).T)
    assert_array_equal(legs, range(support.shape[1]))
    return samples


def lift_offs(support):
    return touch_downs(~support)


# Phases


@pytest.mark.parametrize("duty", DUTIES)
def test_feet_of_a_wave_touch_down_at_their_phases(walk_plan, duty):
    support = walk_plan(*of_wave(duty)).support
    assert_allclose(touch_downs(support) / len(support), [0.0, 0.5, duty, duty - 0.5], atol=1e-12)


@pytest.mark.parametrize("duty", DUTIES)
def test_transfers_go_right_rear_right_front_left_rear_left_front(walk_plan, duty):
    assert_array_equal(np.argsort(lift_offs(walk_plan(*of_wave(duty)).support)), [RR, RF, LR, LF])


@st.composite
def waves(draw):
    """Samples of a cycle, even, and of support, at least three quarters of them."""
    samples = 2 * draw(st.integers(4, 2000))
    return samples, draw(st.integers(-(-3 * samples // 4), samples - 1))


@given(waves())
def test_at_least_three_feet_of_a_wave_are_down(wave):
    samples, support = wave
    assert timing_of(support / samples, samples).support.sum(axis=1).min() == 3


@given(waves())
def test_every_foot_of_a_wave_supports_for_exactly_its_duty_factor(wave):
    samples, support = wave
    timing = timing_of(support / samples, samples)
    assert_array_equal(timing.support.sum(axis=0), support)
    assert (timing.support_samples, timing.transfer_samples) == (support, samples - support)
    assert_array_equal(np.sort(timing.sample[timing.support[:, LR], LR]), range(support))
    assert_array_equal(np.sort(timing.sample[~timing.support[:, LR], LR]), range(samples - support))
    assert timing.progress.min() == 0.0
    assert timing.progress.max() < 1.0


@given(waves(), st.data())
def test_own_phases_are_half_open_too(wave, data):
    samples, support = wave
    begins = data.draw(st.lists(st.integers(0, samples - 1), min_size=4, max_size=4))
    timing = timing_of(support / samples, samples, [begin / samples for begin in begins])
    for leg, begin in enumerate(begins):
        assert_array_equal(np.flatnonzero(np.roll(timing.support[:, leg], -begin)), range(support))


def test_own_phases_plan_the_same_cycle_as_the_wave_they_repeat(walk_plan):
    plans = [walk_plan(), walk_plan("gait.touch_down=[0.0, 0.5, 0.8, 0.3]")]
    for one, other in zip(*[[*plan._replace(load=0), *plan.load] for plan in plans], strict=True):
        assert_array_equal(one, other)


def test_the_defaults_transfer_at_the_samples_of_the_paper_s_gait_diagram(walk_plan):
    transfers = {LF: range(480, 600), RF: range(180, 300), LR: range(360, 480), RR: range(60, 180)}
    support = walk_plan().support
    for leg, samples in transfers.items():
        assert_array_equal(np.flatnonzero(~support[:, leg]), samples)


# Margins of a wave


@pytest.mark.parametrize("duty", DUTIES)
def test_rear_margin_at_lift_off_of_foot_3_is_that_of_the_gait(walk_plan, duty):
    plan = walk_plan(*of_wave(duty))
    for leg in (LR, RR):
        assert plan.margins[lift_offs(plan.support)[leg], 2] == pytest.approx(GOLDEN[duty], abs=1e-9)


@pytest.mark.parametrize("duty", DUTIES)
def test_front_margin_at_touch_down_of_foot_2_is_that_of_the_gait(walk_plan, duty):
    plan = walk_plan(*of_wave(duty))
    front = plan.margins[:, 1]
    for leg in (LF, RF):
        k = touch_downs(plan.support)[leg]
        assert 2.0 * front[k - 1] - front[k - 2] == pytest.approx(GOLDEN[duty], abs=1e-9)


@pytest.mark.parametrize("duty", DUTIES)
def test_no_longitudinal_margin_of_a_wave_is_shorter(walk_plan, duty):
    assert walk_plan(*of_wave(duty)).margins[:, 1:].min() == pytest.approx(GOLDEN[duty], abs=1e-9)


@pytest.mark.parametrize("stroke", [0.1, 0.2, 0.35])
@pytest.mark.parametrize("hip_x", [0.2, 0.3])
def test_least_longitudinal_margin_goes_with_the_stroke_and_not_with_the_hips(walk_plan, stroke, hip_x):
    hips = [f"machine.legs.{side}_front.hip_x={hip_x}" for side in ("left", "right")]
    hips += [f"machine.legs.{side}_rear.hip_x=-{hip_x}" for side in ("left", "right")]
    plan = walk_plan(f"gait.stroke={stroke}", *hips)
    assert plan.margins[:, 1:].min() == pytest.approx(0.05 * stroke / 0.8, abs=1e-9)


# Margins of any polygon


def margins_of_hull(feet):
    """Margins of the origin in the convex hull of ``feet``, from its half planes; NaN where y = 0 misses it."""
    normal_x, _, offset = ConvexHull(feet).equations.T
    front, rear = np.inf, -np.inf
    for a, b in zip(normal_x, offset, strict=True):
        if a > 0.0:
            front = min(front, -b / a)
        elif a < 0.0:
            rear = max(rear, -b / a)
    nearest = -offset.max()
    return (nearest, front, -rear) if rear <= front else (nearest, np.nan, np.nan)


def random_feet(count, corners, seed):
    """Sets of ``count`` feet of whose convex hull ``corners`` are corners."""
    random, sets = np.random.default_rng(seed), []
    while len(sets) < 300:
        feet = random.uniform(-1.0, 1.0, (count, 2)) + random.uniform(-0.5, 0.5, 2)
        if len(ConvexHull(feet).vertices) == corners:
            sets.append(feet)
    return sets


@pytest.mark.parametrize(
    ("count", "corners"), [(3, 3), (4, 4), (4, 3)], ids=["triangle", "quadrangle", "foot inside"]
)
def test_margins_are_those_of_the_support_polygon_s_half_planes(count, corners):
    sets = random_feet(count, corners, seed=count + corners)
    expected = np.array([margins_of_hull(feet) for feet in sets])
    outside = expected[:, 0] < 0.0
    assert outside.any()
    assert not outside.all()
    assert_allclose([margins(feet) for feet in sets], expected, atol=1e-9)


def test_margins_of_some_feet_at_many_moments_are_those_of_each_moment():
    sets = np.array(random_feet(4, 4, seed=5)[:64]).reshape(8, 8, 4, 2)
    down = np.random.default_rng(6).random((8, 8, 4)) < 0.7
    each = [margins(feet[own]) for feet, own in zip(sets.reshape(64, 4, 2), down.reshape(64, 4), strict=True)]
    assert_array_equal(margins(sets, down), np.reshape(each, (8, 8, 3)))
    assert np.isnan(each).any()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_fewer_than_three_feet_have_no_margin(count):
    assert np.isnan(margins(np.ones((count, 2)))).all()


def test_planned_margins_are_those_of_the_planned_feet(walk_plan, make_config):
    hips = make_mechanism(make_config("scenario=quadruped").machine).hips
    plan = walk_plan()
    for k in range(0, 600, 7):
        feet = hips + np.stack([plan.desired[k, :, 0], np.zeros(4)], axis=1)
        assert_allclose(plan.margins[k], margins_of_hull(feet[plan.support[k]]), atol=1e-12)


# Refusals


TROT = "gait.touch_down=[0.0, 0.0, 0.5, 0.5]"
OUTSIDE = "gait.touch_down=[0.0, 0.5, 0.25, 0.75]"


def test_a_gait_with_the_centre_of_gravity_outside_is_refused_with_the_instant_and_the_margin(refusal, walk_plan):
    error = refusal(OUTSIDE)
    assert error.key == "gait.touch_down"
    margin, time = map(float, re.search(r"margin is (-[\d.]+) m at t = ([\d.]+) s", str(error)).groups())
    planned = walk_plan(OUTSIDE, "gait.allow_unstable=true").margins[:, 0]
    assert margin == pytest.approx(planned.min(), abs=1e-4)
    assert planned[round(time / 0.005)] == planned.min() < 0.0


@pytest.mark.parametrize("override", [TROT, OUTSIDE, "gait.duty_factor=0.7", "gait.duty_factor=0.5"])
def test_an_unstable_gait_is_planned_if_it_is_allowed(walk_plan, override):
    plan = walk_plan(override, "gait.allow_unstable=true")
    few = plan.support.sum(axis=1) < 3
    assert_array_equal(np.isnan(plan.margins).all(axis=1), few)
    assert few.any() or plan.margins[:, 0].min() < 0.0
    assert np.isfinite(plan.joints).all()
    assert np.isfinite(plan.force_desired).all()


def test_a_margin_of_exactly_zero_is_still_stable(walk_plan):
    assert walk_plan("gait.duty_factor=0.75").margins[:, 0].min() == pytest.approx(0.0, abs=1e-9)


def test_an_uneven_number_of_steps_is_refused_and_the_period_named_is_not(refusal, walk_plan):
    error = refusal("gait.cycle_time=3.025")
    assert error.key == "sampling_period"
    assert "605" in str(error)
    named = re.search(r"try ([\d.]+)", str(error))[1]
    assert len(walk_plan("gait.cycle_time=3.025", f"sampling_period={named}").support) % 2 == 0
