"""Laws of the body against scipy and plain rotations: balance on elastic ground, posture control, patches."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import minimize
from support.grounds import still_ground
from support.rollout import roll_out

from cmacexp.control.hybrid_kernels import posture_term
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.body import Load, balance, depth, energy, make_pose, slope
from cmacexp.models.ground import stiffness_at
from cmacexp.plants.environment import make_ground

WEIGHT = 40.0
LEVEL = np.zeros(4)
LOAD = Load(WEIGHT, 0.0, 0.0)
HIPS = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])


# Written anew: a body frame turned by roll about x (forward), then by pitch about y (left); z is up


def rotation(pitch, roll):
    cp, sp, cr, sr = np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    return about_y @ about_x


def in_world(body, points):
    """Points (n, 3) of the body frame relative to the centre of gravity's projection on the ground, (n, 3)."""
    return points @ rotation(body[1], body[2]).T + np.array([0.0, 0.0, body[0]])


def feet_in_body(foot, hips=HIPS):
    return np.column_stack([hips[:, 0] + foot[:, 0], hips[:, 1], -foot[:, 1]])


def pressed(body, foot, stiffness):
    """Contact forces (L,) and feet in the world (L, 3)."""
    world = in_world(body, feet_in_body(foot))
    return stiffness * np.maximum(0.0, -world[:, 2]), world


def out_of_balance(body, foot, stiffness):
    """What weight (N) and both moments (N m) leave over."""
    force, world = pressed(body, foot, stiffness)
    return np.array([force.sum() - WEIGHT, force @ world[:, 0], force @ world[:, 1]])


def energy_by_rotation(body, foot, stiffness, level=LEVEL, load=LOAD):
    world = in_world(body, feet_in_body(foot))
    lies = in_world(body, np.array([[load.x, load.y, 0.0]]))[0, 2]
    return load.weight * lies + 0.5 * stiffness @ np.maximum(0.0, -world[:, 2] - level) ** 2


def find_balance(foot, stiffness, start=(0.5, 0.0, 0.0)):
    """Whether there is a balance, the body and the forces."""
    body, force = np.array(start, dtype=float), np.zeros(len(foot))
    found = balance(HIPS, foot, np.asarray(stiffness, dtype=float), LEVEL, LOAD, body, force)
    return found, body, force


def slope_at(body, *ground):
    """Gradient (3,) and curvature (3, 3) of the energy."""
    h, p, r, hh, hp, hr, pp, pr, rr = slope(np.asarray(body, dtype=float), HIPS, *ground, np.zeros(4))
    return np.array([h, p, r]), np.array([[hh, hp, hr], [hp, pp, pr], [hr, pr, rr]])


tilts = st.floats(-0.4, 0.4)


@st.composite
def standing(draw, lifted=False):
    """Feet (4, 2) in the frames of their hips, about as deep as they would press a level body, and K_n under each.

    ``lifted``: one of them is up in the air, and the centre of gravity within the polygon of the others.
    """
    stiffness = np.array([draw(st.floats(5e3, 5e4)) for _ in range(4)])
    down = 0.5 + np.array([draw(st.floats(6.0, 14.0)) for _ in range(4)]) / stiffness
    foot = np.column_stack([[draw(st.floats(-0.12, 0.12)) for _ in range(4)], down])
    if lifted:
        leg = draw(st.integers(0, 3))
        foot[leg, 1] -= 0.1
        foot[:, 0] = np.sign(HIPS[leg, 0]) * draw(st.floats(0.06, 0.15))  # towards where the lifted foot is missing
        foot[3 - leg, 0] = 0.0
    return foot, stiffness


@st.composite
def tilted(draw):
    """A body, what it stands on and its load; some feet press, some do not, none is about to."""
    foot, stiffness = draw(standing())
    body = np.array([draw(st.floats(0.4, 0.55)), draw(tilts), draw(tilts)])
    level = np.array([draw(st.floats(-0.01, 0.01)) for _ in range(4)])
    load = Load(draw(st.floats(1.0, 60.0)), draw(st.floats(-0.2, 0.2)), draw(st.floats(-0.2, 0.2)))
    assume((np.abs(in_world(body, feet_in_body(foot))[:, 2] + level) > 1e-3).all())
    return body, foot, stiffness, level, load


# Depth and energy


@given(st.floats(0.3, 0.6), tilts, tilts, st.tuples(*[st.floats(-0.6, 0.6)] * 3))
def test_depth_is_that_of_the_turned_point(height, pitch, roll, point):
    x, y, down = point
    expected = -in_world((height, pitch, roll), np.array([[x, y, -down]]))[0, 2]
    assert depth(make_pose(np.array([height, pitch, roll])), x, y, down) == pytest.approx(expected, abs=1e-12)


def test_pitch_is_positive_nose_down_and_roll_right_side_down():
    pitched, rolled = make_pose(np.array([0.5, 0.1, 0.0])), make_pose(np.array([0.5, 0.0, 0.1]))
    assert depth(pitched, 0.3, 0.0, 0.5) > depth(pitched, -0.3, 0.0, 0.5)
    assert depth(rolled, 0.0, -0.3, 0.5) > depth(rolled, 0.0, 0.3, 0.5)


@given(tilted())
def test_energy_is_that_of_weight_and_springs(case):
    body, *ground = case
    assert energy(body, HIPS, *ground) == pytest.approx(energy_by_rotation(*case), rel=1e-12)


def differences(function, body, step=1e-5):
    """Derivatives of ``function`` by height, pitch and roll, by central differences."""
    shifts = step * np.eye(3)
    return np.array([(function(body + shift) - function(body - shift)) / (2.0 * step) for shift in shifts])


@given(tilted())
def test_gradient_is_the_derivative_of_the_energy(case):
    body, *ground = case
    expected = differences(lambda b: energy(b, HIPS, *ground), body)
    assert_allclose(slope_at(*case)[0], expected, rtol=1e-6, atol=1e-4)


@given(tilted())
def test_curvature_is_the_derivative_of_the_gradient(case):
    body, *ground = case
    expected = differences(lambda b: slope_at(b, *ground)[0], body)
    curvature = slope_at(*case)[1]
    assert_allclose(curvature, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max() + 1e-3)


# Balance


STANDING = pytest.mark.parametrize("lifted", [False, True], ids=["four feet", "three feet"])


@STANDING
@given(data=st.data())
def test_forces_in_balance_carry_the_weight_and_no_moment(lifted, data):
    foot, stiffness = data.draw(standing(lifted))
    found, body, force = find_balance(foot, stiffness)
    assert found
    assert (force > 0.0).sum() == (3 if lifted else 4)
    assert_allclose(out_of_balance(body, foot, stiffness), 0.0, atol=1e-9 * WEIGHT)
    assert_allclose(force, pressed(body, foot, stiffness)[0], atol=1e-8 * WEIGHT)


@STANDING
@settings(max_examples=25)
@given(data=st.data())
def test_balance_is_where_a_general_solver_finds_the_least_energy(lifted, data):
    case = data.draw(standing(lifted))
    options = {"xatol": 1e-10, "fatol": 1e-15, "maxiter": 2000, "initial_simplex": SIMPLEX}
    least = minimize(energy_by_rotation, SIMPLEX[0], args=case, method="Nelder-Mead", options=options)
    assert_allclose(find_balance(*case)[1], least.x, atol=1e-6)


SIMPLEX = np.array([0.5, 0.0, 0.0]) + 0.01 * np.vstack([np.zeros(3), np.eye(3)])


@STANDING
@given(data=st.data(), shift=st.tuples(*[st.floats(-0.02, 0.02)] * 3))
def test_from_wherever_the_search_starts_it_ends_in_the_same_balance(lifted, data, shift):
    foot, stiffness = data.draw(standing(lifted))
    _, body, force = find_balance(foot, stiffness)
    for start in (body, body + shift, np.array([0.5, 0.0, 0.0]) + shift):
        found, other, again = find_balance(foot, stiffness, start)
        assert found
        assert_allclose(other, body, atol=1e-10)
        assert_allclose(again, force, atol=1e-6)


@given(standing())
def test_a_body_in_balance_stays_as_it_is_to_the_bit(case):
    _, body, force = find_balance(*case)
    found, same, again = find_balance(*case, start=body)
    assert found
    assert_array_equal(same, body)
    assert_array_equal(again, force)


@pytest.mark.parametrize("stiffness", [1e3, 1e4, 1e5, 1e6, 1e7])
def test_it_finds_balance_on_ground_of_any_stiffness(stiffness):
    depression = np.array([9.0, 11.0, 10.5, 9.5]) / stiffness
    foot = np.column_stack([[0.05, -0.05, 0.02, 0.0], 0.5 + depression])
    found, body, force = find_balance(foot, np.full(4, stiffness))
    assert found
    assert force.sum() == pytest.approx(WEIGHT, rel=1e-6)
    assert_allclose(body, [0.5, 0.0, 0.0], atol=100.0 / stiffness)


UP = -5.0
"""Height of a foot that never comes down, m below its hip."""
NOWHERE = {
    "feet on the left alone": [(0.0, 0.5), (0.0, UP), (0.0, 0.5), (0.0, UP)],
    "feet in front alone": [(0.0, 0.5), (0.0, 0.5), (0.0, UP), (0.0, UP)],
    "all feet in front": [(0.3, 0.5), (0.3, 0.5), (0.6, 0.5), (0.6, 0.5)],
    "one foot": [(0.0, 0.5), (0.0, UP), (0.0, UP), (0.0, UP)],
    "no foot": [(0.0, UP)] * 4,
    "feet that are nowhere": [(np.nan, np.nan)] * 4,
}


@pytest.mark.parametrize("feet", NOWHERE)
def test_where_there_is_no_balance_the_search_says_so(feet):
    assert not find_balance(np.array(NOWHERE[feet]), [1e4] * 4)[0]


def test_ground_too_soft_for_the_height_of_the_body_lets_it_topple():
    """Tilting stiffness K_n sum d^2 against W h: below it a level body is a maximum of the energy, not a minimum."""
    critical = WEIGHT * 0.5 / (4.0 * 0.225**2)
    level = np.tile([0.0, 0.5], (4, 1))
    tilt = (0.5 - 10.0 / critical, 0.01, 0.0)
    assert abs(find_balance(level, [1.3 * critical] * 4, tilt)[1][1]) < 1e-6
    found, body, _ = find_balance(level, [0.9 * critical] * 4, tilt)
    assert not found or abs(body[1]) > 0.05


# Posture control


@pytest.fixture(scope="module")
def walk(make_config):
    """Samples of a short walk by column, the body, the plan and the config."""

    def run(*overrides):
        config = make_config("scenario=quadruped", "cycles=3", *overrides)
        scenario = make_scenario(config)
        rollout = roll_out(scenario)
        return rollout.columns(), rollout.body_samples, rollout.plan, scenario

    return run


@pytest.mark.parametrize("gain", [0.0, 4.0, 8.0])
@pytest.mark.parametrize("reference", ["literal", "aware", "force_feedforward"])
def test_supporting_feet_are_sent_gain_times_what_their_hip_lacks_below_the_plan(walk, gain, reference):
    columns, body, plan, _ = walk(f"posture.gain={gain}", f"reference={reference}")
    at_hips = np.column_stack([HIPS, np.zeros(4)])
    heights = np.array([in_world(b, at_hips)[:, 2] for b in body])
    step = np.arange(len(body))
    stage = (step >= plan.start_step).astype(int)
    planned, support = plan.reference[stage, step % 600, :, :2], plan.support[step % 600]
    expected = planned[..., 1] + np.where(support, gain * (0.5 - heights), 0.0)
    assert_allclose(columns["y_reference"], expected, atol=1e-12)
    assert_array_equal(columns["x_reference"], planned[..., 0])


def test_one_leg_on_a_stand_has_no_posture(make_config):
    params = make_scenario(make_config("scenario=one_leg")).controller.params
    assert params.posture_gain == 8.0
    assert posture_term(params, 0, make_pose(np.array([0.3, 0.1, 0.1]))) == 0.0


# Ground in patches

PATCHY = still_ground(1e4, 0.15, 0.5, 0)
CORNERS = [(i, j) for i in range(-20, 20) for j in range(-20, 20)]
places = st.floats(-30.0, 30.0)


def of_patches(ground):
    """Stiffness in the middle of many patches."""
    side = ground.patch_size
    return np.array([stiffness_at(ground, (i + 0.5) * side, (j + 0.5) * side) for i, j in CORNERS])


@given(st.integers(-200, 200), st.integers(-200, 200), st.floats(0.01, 0.99), st.floats(0.01, 0.99))
def test_within_a_patch_the_ground_is_of_one_stiffness(i, j, u, v):
    side = PATCHY.patch_size
    assert stiffness_at(PATCHY, (i + u) * side, (j + v) * side) == stiffness_at(
        PATCHY, (i + 0.5) * side, (j + 0.5) * side
    )


@given(places, places, st.floats(0.0, 0.99), st.integers(0, 2**32 - 1))
def test_stiffness_stays_within_its_spread(x, y, spread, seed):
    ground = still_ground(1e4, 0.15, spread, seed)
    assert 1e4 * (1.0 - spread) * (1.0 - 1e-12) <= stiffness_at(ground, x, y) <= 1e4 * (1.0 + spread) * (1.0 + 1e-12)


def test_patches_differ_and_fill_the_spread_evenly():
    stiffness = of_patches(PATCHY)
    assert len(np.unique(stiffness)) == len(CORNERS)
    assert_allclose(np.histogram(stiffness, 4, (0.5e4, 1.5e4))[0] / len(CORNERS), 0.25, atol=0.04)
    assert stiffness.mean() == pytest.approx(1e4, rel=0.03)


def test_neighbouring_patches_know_nothing_of_each_other():
    grid = of_patches(PATCHY).reshape(40, 40)
    for one, other in ((grid[1:], grid[:-1]), (grid[:, 1:], grid[:, :-1]), (grid, grid.T)):
        upper = np.triu_indices(40, 1) if one is grid else np.nonzero(np.ones_like(one))
        assert abs(np.corrcoef(one[upper], other[upper])[0, 1]) < 0.1


def test_another_seed_gives_other_patches_and_the_same_seed_the_same():
    one, other = of_patches(PATCHY), of_patches(PATCHY._replace(patch_seed=1))
    assert (one != other).all()
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.1
    assert_array_equal(one, of_patches(PATCHY))


@given(places, places, st.integers(0, 2**32 - 1))
def test_without_spread_the_ground_is_of_its_stiffness_everywhere(x, y, seed):
    assert stiffness_at(still_ground(1e4, 0.15, 0.0, seed), x, y) == 1e4


def test_each_foot_presses_the_patch_that_it_stands_on(walk):
    columns, body, _, scenario = walk("terrain=patchy", "terrain.patch_seed=5")
    config = scenario.setup.config
    ground = make_ground(config.terrain, 0.005)
    assert (ground.stiffness, ground.patch_spread) == (1e4, 0.5)
    seen = set()
    for k in range(0, len(body), 3):
        foot = np.column_stack([columns["x"][k], columns["y"][k]])
        x = HIPS[:, 0] + foot[:, 0] + config.body_speed * k * 0.005
        clear = np.abs(x / 0.15 - np.rint(x / 0.15)) > 1e-9
        stiffness = np.array([stiffness_at(ground, x[i], HIPS[i, 1]) for i in range(4)])
        seen |= set(stiffness)
        expected = pressed(body[k], foot, stiffness)[0]
        assert_allclose(columns["force"][k][clear], expected[clear], rtol=1e-9, atol=1e-9)
    assert len(seen) > 10


# Body and legs in motion


def test_with_the_body_balanced_in_every_stage_the_integration_is_of_fourth_order(make_config):
    """From standing, under torques that load the feet unevenly and keep all of them down."""

    def after(substeps):
        plant = make_scenario(make_config("scenario=quadruped", f"plant.substeps={substeps}")).plant
        weight_of_legs = -np.array([(6.0, 1.5), (6.5, 1.2), (-6.0, -1.5), (-5.5, -1.8)])
        for _ in range(4):
            state = plant.step(weight_of_legs)
        assert (state.force > 0.0).all()
        return np.concatenate([state.q.ravel(), state.dq.ravel(), state.body])

    exact = after(400)
    errors = [np.abs(after(substeps) - exact).max() for substeps in (5, 10, 20)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert_allclose(orders, 4.0, atol=0.5)
