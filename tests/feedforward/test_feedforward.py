"""Laws of feedforwards: which torque is given when, what feedback teaches, and from which step on."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from support.doors import (
    RULES,
    BadInput,
    Leg,
    forward_dynamics,
    get_leg,
    jacobian,
    make_scenario,
    train_by_rule,
    trigonometry,
)

from cmacexp.feedforward import (
    CmacFeedforward,
    CmacOnModel,
    InverseDynamics,
    IterativeLearning,
    NoFeedforward,
    RadialBasis,
)
from cmacexp.feedforward.ilc import WIDEST, gaussian_taps
from cmacexp.feedforward.kernels import Smoothing, correct, feedforward_step, find_rows, log_weights, smooth
from cmacexp.feedforward.network import kernel_norm, network, planned_inputs, resample
from cmacexp.feedforward.rbf import activations, spacing, spread_out
from cmacexp.planning import Motion

SHORT = ("scenario=quadruped", "gait.cycle_time=0.2", "gait.lift=0.005")
SAMPLES, LEGS, ROWS = 40, 4, 25


@pytest.fixture(scope="module")
def setup(make_config):
    return make_scenario(make_config(*SHORT, "learning.start_cycle=1")).setup


def make_network(setup, activation=None, **learning):
    """A network of three random rows at each sample, and of random weights."""
    rng = np.random.default_rng(1)
    cells = np.stack([rng.permutation(ROWS)[:3] for _ in range(SAMPLES * LEGS)]).reshape(SAMPLES, LEGS, 3)
    params = network(setup, cells, ROWS, activation)
    params.weights[:] = rng.normal(size=params.weights.shape)
    if "rate" in learning:
        learning["rate"] = np.full(LEGS, learning["rate"])
    return params._replace(learning=params.learning._replace(**learning))


def some_activation():
    return np.random.default_rng(2).uniform(0.1, 1.0, (SAMPLES, LEGS, 3))


def learnt_change(params, step, error):
    """Change of the weights by one step."""
    before = params.weights.copy()
    feedforward_step(params, step, step % SAMPLES, error, np.zeros((LEGS, 2)))
    return params.weights - before


# What is given


def test_inverse_dynamics_accelerates_every_leg_as_planned_at_every_sample(make_config):
    """Against the force of the desired depression; without a feedforward there is no torque."""
    scenario = make_scenario(make_config("scenario=quadruped", "feedforward=inverse_dynamics"))
    plan, mechanism, output = scenario.setup.plan, scenario.setup.mechanism, np.zeros((4, 2))
    depression = np.maximum(0.0, plan.desired.position[..., 1] - mechanism.hip_height)  # of y
    pressed = scenario.setup.config.assumed_stiffness * depression
    for sample in range(3, len(plan.support), 60):
        feedforward_step(scenario.feedforward.params, sample, sample, np.ones((4, 2)), output)
        for i, (q, dq, ddq) in enumerate(zip(*(values[sample] for values in plan.joints), strict=True)):
            leg, trig = get_leg(mechanism, i), trigonometry(*q)
            assert_allclose(forward_dynamics(leg, trig, *dq, *output[i], pressed[sample, i]), ddq, atol=1e-9)
    assert not scenario.feedforward.params.weights.any()  # which no error teaches
    nothing = NoFeedforward(NoFeedforward.Config())
    nothing.reset(scenario.setup)
    feedforward_step(nothing.params, 7, 7, np.ones((4, 2)), output)
    assert not output.any()


def torque_of_model(make_config, *more):
    return make_scenario(make_config("feedforward=inverse_dynamics", *more))


@pytest.mark.parametrize(
    ("overrides", "samples"),
    [(("feedforward.advance=0.01",), 2.0), (("feedforward.advance=0.0075",), 1.5),
     (("feedforward.advance=auto",), 0.0),
     (("feedforward.advance=auto", "actuator.delay=1", "actuator.lag=0.0125"), 3.5),
     (("feedforward.advance=0", "actuator.delay=1"), 0.0)],
)  # fmt: skip
@pytest.mark.parametrize("kind", ["inverse_dynamics", "cmac_on_model"])
def test_the_torque_of_a_model_is_played_earlier_by_its_advance(make_config, kind, overrides, samples):
    """Of 5 ms each; between two samples it is interpolated."""
    plain = torque_of_model(make_config, *SHORT).feedforward.params.torque
    earlier = make_scenario(make_config(*SHORT, f"feedforward={kind}", *overrides)).feedforward.params.torque
    whole, share = divmod(samples, 1.0)
    expected = (1.0 - share) * np.roll(plain, -int(whole), axis=0) + share * np.roll(plain, -int(whole) - 1, axis=0)
    assert_allclose(earlier, expected, rtol=1e-12, atol=1e-12)
    if not samples:
        assert_array_equal(earlier, plain)


def test_what_a_controller_adds_for_the_desired_force_is_not_in_the_model_again(make_config):
    """Of the planned torque in support, J^T F_d is the controller's with ``force_feedforward``."""
    whole, rest = (torque_of_model(make_config, *SHORT, f"reference={law}") for law in ("aware", "force_feedforward"))
    plan = rest.setup.plan
    for k, i in np.argwhere(plan.support)[::7]:
        angles = trigonometry(*plan.joints.position[k, i])
        jacobian_of = np.array(jacobian(Leg(*rest.setup.mechanism.legs[i]), angles)).reshape(2, 2)
        added = jacobian_of.T @ [0.0, plan.force_desired[k, i]]
        torques = [scenario.feedforward.params.torque[k, i] for scenario in (whole, rest)]
        assert_allclose(torques[1] + added, torques[0], rtol=1e-9)


def test_a_wrong_model_errs_in_what_it_has_wrong(make_config):
    """Torque is linear in both masses together; the contact force, of the ground assumed, has no part in that."""
    exact, other, heavy, light, long = (
        torque_of_model(make_config, "gait.cycle_time=0.2", "gait.lift=0.005", *changes).feedforward.params.torque
        for changes in (
            (),
            ("terrain.stiffness=0.001", "terrain.assumed_stiffness=10"),
            *((f"feedforward.{name}",) for name in ("mass_factor=1.2", "mass_factor=0.8", "length_factor=1.1")),
        )
    )
    assert_allclose(exact, other)
    assert_allclose(heavy - exact, exact - light, atol=1e-9)
    assert min(np.abs(heavy - exact).max(), np.abs(long - exact).max()) > 0.1


@pytest.mark.parametrize("activation", [None, some_activation()], ids=["plain", "weighted"])
def test_a_network_gives_the_sum_of_its_active_weights(setup, activation):
    params, output = make_network(setup, activation), np.zeros((LEGS, 2))
    shares = np.ones((SAMPLES, LEGS, 3)) if activation is None else activation
    for sample in range(SAMPLES):
        feedforward_step(params, sample, sample, np.zeros((LEGS, 2)), output)
        active = [shares[sample, i] @ params.weights[i, params.cells[sample, i]] for i in range(LEGS)]
        assert_allclose(output, active, atol=1e-12)


# What is learnt


@pytest.mark.parametrize("lead", [0, 2, -1, SAMPLES + 3])
@pytest.mark.parametrize("activation", [None, some_activation()], ids=["plain", "weighted"])
def test_an_error_moves_the_output_of_its_own_sample_by_rate_times_error(setup, activation, lead):
    """That of the step before, less the lead; on all legs and around the end of the cycle."""
    params = make_network(setup, activation, rate=0.3, lead=lead)
    shares = np.ones((SAMPLES, LEGS, 3)) if activation is None else activation
    rng = np.random.default_rng(3)
    for step in (0, 1, 2, 17, SAMPLES - 1, SAMPLES):
        error = rng.normal(size=(LEGS, 2))
        change, own = learnt_change(params, step, error), (step - 1 - lead) % SAMPLES
        for leg in range(LEGS):
            rows = params.cells[own, leg]
            assert_allclose(shares[own, leg] @ change[leg, rows], 0.3 * error[leg], atol=1e-12)
            assert not np.delete(change[leg], rows, axis=0).any()


@pytest.mark.parametrize("name", [name for name in RULES if name != "zero_phase"])
def test_a_network_learns_by_its_rule(setup, name):
    activation, error = some_activation(), np.random.default_rng(4).normal(size=(LEGS, 2))
    rule = RULES[name].params._replace(strength=0.5)
    params = make_network(setup, activation, rule=rule, is_paper_rule=False, rate=0.4)
    expected = params.weights.copy()
    for leg in range(LEGS):
        train_by_rule(rule, expected[leg], params.cells[6, leg], activation[6, leg], error[leg], 0.4)
    assert learnt_change(params, 7, error).any()
    assert_array_equal(params.weights, expected)


@pytest.mark.parametrize("start", [0, SAMPLES, 7 * SAMPLES])
def test_a_rate_decays_by_the_cycles_since_learning_began(setup, start):
    rule, activation = RULES["decaying_rate"].params._replace(strength=2.0), some_activation()
    params = make_network(setup, activation, rule=rule, is_paper_rule=False, rate=0.6, lead=0, start_step=start)
    for cycle in range(4):
        for sample in (0, 1, SAMPLES - 1):
            change = learnt_change(params, start + cycle * SAMPLES + sample, np.ones((LEGS, 2)))
            own = (sample - 1) % SAMPLES
            assert_allclose(activation[own, 0] @ change[0, params.cells[own, 0]], 0.6 / (1.0 + cycle / 2.0))


@pytest.mark.parametrize("addressing", ["hashed", "visited"])
def test_cmacs_that_go_on_from_what_was_learnt_give_the_same_torque(setup, addressing):
    """Also on a path that visits other cells before, with another seed."""
    cmac = replace(setup.config.cmac, addressing=addressing)
    first, again = (CmacFeedforward(CmacFeedforward.Config()) for _ in range(2))
    first.reset(replace(setup, config=replace(setup.config, cmac=cmac)))
    first.params.weights[:] = np.random.default_rng(6).normal(size=first.params.weights.shape)
    turned = setup.plan._replace(joints=Motion(*np.roll(setup.plan.joints, 5, axis=1)))
    config = replace(setup.config, cmac=cmac, seed=9)
    again.reset(replace(setup, config=config, plan=turned, learnt=first.learnt()))
    one, other = np.zeros((2, LEGS, 2))
    for sample in range(SAMPLES):
        feedforward_step(first.params, 1, sample, np.zeros((LEGS, 2)), one)
        feedforward_step(again.params, 1, (sample + 5) % SAMPLES, np.zeros((LEGS, 2)), other)
        assert_array_equal(one, other)
        assert one.all()


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_weights_in_use_are_weighed_and_no_others(seed, share):
    """Norm and largest of the weights of the rows in use, and how many rows have a weight other than 0."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, ROWS, (5, LEGS, 2)).astype(np.uint32)
    weights = rng.normal(size=(LEGS, ROWS, 2)) * (rng.random((LEGS, ROWS, 2)) < share)
    entry = np.full((LEGS, 3), np.nan)
    log_weights(find_rows(cells), weights, entry)
    for leg in range(LEGS):
        used = weights[leg, np.unique(cells[:, leg])]
        assert_allclose(entry[leg, :2], [np.linalg.norm(used), np.abs(used).max()])
        assert entry[leg, 2] == np.count_nonzero(used.any(axis=1))


def test_one_update_a_cycle_moves_the_torque_by_the_kernel_over_its_norm(make_config):
    """As a guard that refines does; the norm, the largest sum of a row, bounds the eigenvalues of the kernel."""
    learning = (
        "cmac.memory_bytes=16384",
        "learning=lasting",
        "learning.rate=0.2",
        "learning.guard=refine",
        "learning.lead=3",
    )
    params = make_scenario(make_config("gait.cycle_time=0.2", "gait.lift=0.005", *learning)).feedforward.params
    active, errors, torque = (
        np.zeros((SAMPLES, params.weights.shape[1])),
        np.zeros((SAMPLES, 1, 2)),
        np.ones((SAMPLES, 1, 2)),
    )
    np.add.at(active, (np.arange(SAMPLES)[:, None], params.cells[:, 0]), 1.0)
    kernel = active @ active.T / params.cells.shape[2]
    errors[30] = 2.0, -1.0
    correct(params, errors, np.zeros(2), torque)
    norm = kernel_norm(params.cells, np.ones(params.cells.shape))
    assert norm == pytest.approx(kernel.sum(axis=1).max())
    assert_allclose(torque[:, 0], 1.0 + 0.2 / norm * kernel[:, 27, None] * errors[30], rtol=1e-12)


def test_one_update_a_cycle_leaves_whole_numbers_of_steps(setup):
    params = make_network(setup, cycle_rate=0.3, weight_step=0.25, weight_limit=2.0)
    errors = np.random.default_rng(3).normal(size=(SAMPLES, LEGS, 2))
    correct(params, errors, np.zeros(2), np.zeros_like(errors))
    steps = params.weights[0, np.unique(params.cells[:, 0])] / 0.25
    assert abs(steps).max() > 1.0
    assert_array_equal(steps, np.rint(steps))


def test_a_cmac_on_a_model_knows_the_torque_of_the_model(setup):
    wrong = InverseDynamics.Config(1.1, 0.9)
    feedforward = CmacOnModel(wrong)
    feedforward.reset(setup)
    known = InverseDynamics(wrong).compute_torque(setup)
    assert_array_equal(feedforward.model_torque, known)
    assert_array_equal(feedforward.predict(SimpleNamespace(step=7, sample=7), np.zeros((LEGS, 2))), known[7])


def test_an_input_of_the_phase_turns_once_a_cycle_at_equal_steps(setup):
    cosine, sine = planned_inputs(setup, 1, ("angle", "phase"))[:, 2:].T
    turned = np.unwrap(np.arctan2(sine, cosine))
    assert_allclose(turned, 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES, atol=1e-12)
    assert_allclose(np.hypot(cosine, sine), 1.0)


# Iterative learning


@pytest.mark.parametrize("cutoff", [None, 30.0, 1e6])
def test_torques_of_a_cycle_are_filtered_at_its_start_alone_and_only_with_a_cutoff(setup, cutoff):
    """A lone torque stays as large in all, and is spread unless the cutoff is far above the sampling."""
    ilc, output = IterativeLearning(IterativeLearning.Config(cutoff)), np.zeros((LEGS, 2))
    ilc.reset(setup)
    ilc.params.weights[:, 7] = 1.0
    for step in range(1, SAMPLES + 1):
        before = ilc.params.weights.copy()
        feedforward_step(ilc.params, step, step % SAMPLES, np.zeros((LEGS, 2)), output)
        changed = not np.array_equal(ilc.params.weights, before)
        assert changed == (step == SAMPLES and cutoff == 30.0)
        assert_array_equal(output, ilc.params.weights[:, step % SAMPLES])
    assert_allclose(ilc.params.weights.sum(axis=1), 1.0)


def test_torques_of_another_number_of_samples_are_gone_on_from_at_the_same_phase(setup):
    learnt = np.random.default_rng(3).normal(size=(LEGS, SAMPLES, 2))
    feedforward = IterativeLearning(IterativeLearning.Config(None))

    def weights_from(known):
        feedforward.reset(replace(setup, learnt={"weights": known}))
        return feedforward.params.weights

    assert_array_equal(weights_from(learnt), learnt)
    assert_allclose(weights_from(np.repeat(learnt, 2, axis=1)), learnt)
    with pytest.raises(BadInput, match="start_from"):
        weights_from(learnt[:1])


@pytest.mark.parametrize(("known", "samples"), [(600, 400), (400, 600), (7, 1)])
def test_a_harmonic_is_resampled_to_itself(known, samples):
    """Up to a linear interpolation's error, half of (angle step / 2)^2; where samples coincide, exactly."""
    given, wanted = (np.cos(2.0 * np.pi * np.arange(n) / n + 0.3) for n in (known, samples))
    assert_allclose(resample(given, samples), wanted, atol=0.5 * (np.pi / known) ** 2)


@pytest.mark.parametrize("cutoff", [5.0, 20.0, 40.0])
def test_gain_of_the_low_pass_is_at_most_one_and_as_given_at_the_cutoff(cutoff):
    taps, period = gaussian_taps(cutoff, 0.005, 600), 0.005

    def gain(hertz):
        return taps[0] + 2.0 * np.sum(taps[1:] * np.cos(2.0 * np.pi * hertz * period * np.arange(1, len(taps))))

    assert gain(0.0) == pytest.approx(1.0)
    assert all(abs(gain(hertz)) <= 1.0 for hertz in np.linspace(0.0, 100.0, 50))
    # Samples of a Gaussian that is cut off, as against the whole one, are off by little.
    assert gain(cutoff) == pytest.approx(np.sqrt(0.5), abs=0.02)
    assert_array_equal(gaussian_taps(1e6, period, 600), [1.0])


@pytest.mark.parametrize("samples", [60, 61])
def test_a_low_pass_far_wider_than_a_cycle_is_the_mean_over_it(samples):
    """As given by the Gaussian that is a little narrower; its taps are no more, however low the cutoff."""
    before = np.random.default_rng(0).normal(size=(samples, 2))
    limit = np.sqrt(np.log(2.0)) / (2.0 * np.pi * 0.005 * WIDEST * samples)
    for cutoff, near in ((1.001 * limit, 1e-3), (0.999 * limit, 1e-12), (1e-300, 1e-12)):
        taps = gaussian_taps(cutoff, 0.005, samples)
        assert len(taps) <= 1 + 4.0 * WIDEST * samples
        filtered = sum(taps[abs(j)] * np.roll(before, j, axis=0) for j in range(-len(taps) + 1, len(taps)))
        assert_allclose(filtered, np.broadcast_to(before.mean(axis=0), before.shape), atol=near)


def test_weights_are_smoothed_as_a_ring():
    weights = np.zeros((6, 2))
    weights[0], weights[3] = (1.0, 0.0), (0.0, 8.0)
    smooth(weights, Smoothing(np.array([0.5, 0.25]), np.zeros(6)))
    assert_allclose(weights.T, [[0.5, 0.25, 0.0, 0.0, 0.0, 0.25], [0.0, 0.0, 2.0, 4.0, 2.0, 0.0]])


# Radial basis functions


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.floats(0.05, 5.0))
def test_activations_sum_up_to_one_and_fall_with_the_distance(seed, active, width):
    rng = np.random.default_rng(seed)
    points, centres = rng.normal(size=(7, 2)), rng.normal(size=(6, 2))
    cells, activation = activations(points, centres, width, active)
    distance = np.linalg.norm(points[:, None] - centres, axis=2)
    assert_allclose(activation.sum(axis=1), 1.0)
    for own, rows, heights in zip(distance, cells, activation, strict=True):
        assert_array_equal(rows, np.argsort(own)[:active])
        # A ratio of Gaussians; in logarithms, as long as they can be told from 0.
        ratio = (own[rows[0]] ** 2 - own[rows] ** 2) / (2.0 * width**2)
        assert_allclose(heights, heights[0] * np.exp(ratio), rtol=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(2, 12))
def test_each_centre_is_the_point_farthest_from_those_before(seed, number):
    points = np.random.default_rng(seed).normal(size=(15, 3))
    centres = spread_out(points, number)
    assert_array_equal(centres[0], points[0])
    for k in range(1, number):
        away = np.linalg.norm(points[:, None] - centres[:k], axis=2).min(axis=1)
        assert_array_equal(centres[k], points[away.argmax()])


def test_the_spacing_is_the_mean_distance_to_the_nearest_other_centre():
    assert spacing(np.array([[0.0], [1.0], [3.0]])) == pytest.approx((1.0 + 1.0 + 2.0) / 3.0)
    assert spacing(np.zeros((3, 2))) == spacing(np.zeros((1, 2))) == 1.0


@pytest.mark.parametrize("inputs", [["angle"], ["angle", "velocity"]])
def test_centres_are_on_the_path_scaled_to_its_span_whatever_the_unit(setup, inputs):
    rbf, other = (RadialBasis(RadialBasis.Config(inputs, SAMPLES, active=3, width=1.0)) for _ in range(2))
    rbf.reset(setup)
    stretched = Motion(*np.multiply(setup.plan.joints, np.reshape([2.0, 0.5, 4.0, 8.0, 1.0, 1.0], (3, 1, 1, 2))))
    other.reset(replace(setup, plan=setup.plan._replace(joints=stretched)))
    assert_array_equal(rbf.params.cells, other.params.cells)
    assert_allclose(rbf.params.activation, other.params.activation, atol=1e-9)
    for leg, use in enumerate(rbf.memory):
        path = np.concatenate(setup.plan.joints[: len(inputs)], axis=2)[:, leg]
        scaled = (path - path.min(axis=0)) / np.ptp(path, axis=0)
        assert_allclose(rbf.places[leg][rbf.params.cells[:, leg, 0]], scaled, atol=1e-12)  # its nearest is itself
        assert (use.cells_colliding, use.clipped, use.rows_used) == (0, 0, SAMPLES)
