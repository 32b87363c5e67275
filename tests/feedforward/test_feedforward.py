"""Laws of feedforwards: which torque is given when, what feedback teaches, and from which step on."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from cmacexp.cmac.rules import DECAYING, NEIGHBOURS, PAPER, RULES, RuleParams, train_by_rule
from cmacexp.errors import BadInput
from cmacexp.feedforward import CmacFeedforward, InverseDynamics, IterativeLearning, RadialBasis
from cmacexp.feedforward.cmac_on_model import CmacOnModel
from cmacexp.feedforward.kernels import LearningParams, feedforward_step
from cmacexp.feedforward.network import known_torque, network, resample
from cmacexp.feedforward.rbf import activations, spread_out
from cmacexp.feedforward.weight_log import log_weights, new_log
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.ground import NEVER
from cmacexp.models.leg import Leg, jacobian, trigonometry
from cmacexp.planning.columns import JOINT_COLUMNS

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
    return params._replace(learning=params.learning._replace(**learning))


def some_activation():
    return np.random.default_rng(2).uniform(0.1, 1.0, (SAMPLES, LEGS, 3))


def taught(params, step, error):
    """Change of the weights by one step."""
    before = params.weights.copy()
    feedforward_step(params, step, step % SAMPLES, error, np.zeros((LEGS, 2)))
    return params.weights - before


# What is given


def test_a_known_torque_is_that_of_the_sample_for_every_leg_and_joint(setup):
    torque, output = np.random.default_rng(0).normal(size=(SAMPLES, LEGS, 2)), np.zeros((LEGS, 2))
    params = known_torque(setup, torque)
    for step in range(2 * SAMPLES):
        feedforward_step(params, step, step % SAMPLES, np.ones((LEGS, 2)), output)
        assert_array_equal(output, torque[step % SAMPLES])
    assert not params.weights.any()


def test_what_a_controller_adds_for_the_desired_force_is_not_in_the_model_again(make_config):
    """Of the planned torque in support, J^T F_d is the controller's with ``force_feedforward``."""
    walk = ("scenario=quadruped", "feedforward=inverse_dynamics")
    whole, rest = (make_scenario(make_config(*walk, f"reference={law}")) for law in ("aware", "force_feedforward"))
    plan, legs = rest.setup.plan, rest.setup.mechanism.legs
    for i, leg in enumerate(legs):
        for k in np.flatnonzero(plan.support[:, i])[::40]:
            jacobian_of = np.array(jacobian(Leg(*leg), trigonometry(*plan.joints[k, i, :2]))).reshape(2, 2)
            added = jacobian_of.T @ [0.0, plan.force_desired[k, i]]
            torques = [scenario.feedforward.params.torque[k, i] for scenario in (whole, rest)]
            assert_allclose(torques[1] + added, torques[0], rtol=1e-9)


@pytest.mark.parametrize("activation", [None, some_activation()], ids=["plain", "weighted"])
def test_a_network_gives_the_sum_of_its_active_weights(setup, activation):
    params, output = make_network(setup, activation), np.zeros((LEGS, 2))
    shares = np.ones((SAMPLES, LEGS, 3)) if activation is None else activation
    for sample in range(SAMPLES):
        feedforward_step(params, sample, sample, np.zeros((LEGS, 2)), output)
        for leg in range(LEGS):
            expected = shares[sample, leg] @ params.weights[leg, params.cells[sample, leg]]
            assert_allclose(output[leg], expected, atol=1e-12)


def test_only_without_a_feedforward_there_is_none_that_acts(setup, make_config):
    nothing = make_scenario(make_config(*SHORT, "feedforward=none"))
    assert not nothing.feedforward.acts
    assert nothing.setup.plan.start_step == NEVER
    assert all(each.acts for each in (IterativeLearning, InverseDynamics, RadialBasis))


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
        change, own = taught(params, step, error), (step - 1 - lead) % SAMPLES
        for leg in range(LEGS):
            rows = params.cells[own, leg]
            assert_allclose(shares[own, leg] @ change[leg, rows], 0.3 * error[leg], atol=1e-12)
            assert not np.delete(change[leg], rows, axis=0).any()


@pytest.mark.parametrize("name", [name for name, rule in RULES.items() if rule.params.teaches != NEIGHBOURS])
def test_a_network_learns_by_its_rule(setup, name):
    activation, error = some_activation(), np.random.default_rng(4).normal(size=(LEGS, 2))
    rule = RULES[name].params._replace(strength=0.5)
    params = make_network(setup, activation, rule=rule, plain=False, rate=0.4)
    expected = params.weights.copy()
    for leg in range(LEGS):
        train_by_rule(rule, expected[leg], params.cells[6, leg], activation[6, leg], error[leg], 0.4)
    assert taught(params, 7, error).any()
    assert_array_equal(params.weights, expected)


@pytest.mark.parametrize("start", [None, 0, SAMPLES, 7 * SAMPLES])
def test_a_rate_decays_by_the_cycles_since_learning_began(setup, start):
    rule, later = RuleParams(rate=DECAYING, strength=2.0), {} if start is None else {"start_step": start}
    learning = LearningParams(0.6, 0, rule, **later)
    params = make_network(setup, some_activation())._replace(learning=learning)
    error = np.ones((LEGS, 2))
    for cycle in range(4):
        for sample in (0, 1, SAMPLES - 1):
            step = (start or 0) + cycle * SAMPLES + sample
            change, own = taught(params, step, error), (sample - 1) % SAMPLES
            moved = some_activation()[own, 0] @ change[0, params.cells[own, 0]]
            assert_allclose(moved, 0.6 / (1.0 + cycle / 2.0))


def test_learning_begins_with_the_first_cycle_that_the_config_names(make_config):
    for cycle in (1, 3):
        params = make_scenario(make_config(*SHORT, f"learning.start_cycle={cycle}", "cycles=3")).feedforward.params
        assert params.learning.start_step == (cycle - 1) * SAMPLES
        assert params.learning.rule == PAPER


@pytest.mark.parametrize("addressing", ["hashed", "visited"])
def test_cmacs_that_go_on_from_what_was_learnt_give_the_same_torque(setup, addressing):
    """Also on a path that visits other cells before."""
    cmac = replace(setup.config.cmac, addressing=addressing)
    first, again = (CmacFeedforward(CmacFeedforward.Config()) for _ in range(2))
    first.reset(replace(setup, config=replace(setup.config, cmac=cmac)))
    first.params.weights[:] = np.random.default_rng(6).normal(size=first.params.weights.shape)
    learnt = first.learnt()
    assert ("visited_4" in learnt) == (addressing == "visited")
    turned = setup.plan._replace(joints=np.roll(setup.plan.joints, 5, axis=0))
    again.reset(replace(setup, config=replace(setup.config, cmac=cmac, seed=9), plan=turned, learnt=learnt))
    one, other = np.zeros((2, LEGS, 2))
    for sample in range(SAMPLES):
        feedforward_step(first.params, 1, sample, np.zeros((LEGS, 2)), one)
        feedforward_step(again.params, 1, (sample + 5) % SAMPLES, np.zeros((LEGS, 2)), other)
        assert_array_equal(one, other)
        assert one.all()


# What is logged


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 1.0))
def test_weights_in_use_are_weighed_and_no_others(seed, share):
    """Norm and largest of the weights of the rows in use, and how many rows have a weight other than 0."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, ROWS, (5, LEGS, 2)).astype(np.uint32)
    weights = rng.normal(size=(LEGS, ROWS, 2)) * (rng.random((LEGS, ROWS, 2)) < share)
    entry = np.full((LEGS, 3), np.nan)
    log_weights(new_log(cells), weights, entry)
    for leg in range(LEGS):
        used = weights[leg, np.unique(cells[:, leg])]
        assert_allclose(entry[leg, :2], [np.linalg.norm(used), np.abs(used).max()])
        assert entry[leg, 2] == np.count_nonzero(used.any(axis=1))


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


def test_feedback_of_a_sample_is_learnt_at_that_sample(setup):
    ilc = IterativeLearning(IterativeLearning.Config(None))
    ilc.reset(setup)
    error = np.random.default_rng(5).normal(size=(LEGS, 2))
    for step in (4, 0, SAMPLES):
        change = taught(ilc.params, step, error)
        own = (step - 1) % SAMPLES
        assert_allclose(change[:, own], setup.config.learning.rate * error)
        assert not np.delete(change, own, axis=1).any()


# Radial basis functions


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.floats(0.05, 5.0))
def test_activations_sum_up_to_one_and_fall_with_the_distance(seed, active, width):
    rng = np.random.default_rng(seed)
    points, centres = rng.normal(size=(7, 2)), rng.normal(size=(6, 2))
    cells, activation = activations(points, centres, width, active)
    distance = np.linalg.norm(points[:, None] - centres, axis=2)
    assert cells.shape == activation.shape == (7, active)
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


@pytest.mark.parametrize("inputs", [["angle"], ["angle", "velocity"]])
def test_centres_are_on_the_path_scaled_to_its_span(setup, inputs):
    rbf = RadialBasis(RadialBasis.Config(inputs, centres=SAMPLES, active=3, width=1.0))
    rbf.reset(setup)
    columns = [column for name in inputs for column in JOINT_COLUMNS[name][:2]]
    assert rbf.params.cells.shape == rbf.params.activation.shape == (SAMPLES, LEGS, 3)
    for leg in range(LEGS):
        path = setup.plan.joints[:, leg, columns]
        scaled = (path - path.min(axis=0)) / np.ptp(path, axis=0)
        found = rbf.places[leg]
        assert_allclose(found[np.lexsort(found.T)], scaled[np.lexsort(scaled.T)], atol=1e-12)
        assert_allclose(found[rbf.params.cells[:, leg, 0]], scaled, atol=1e-12)  # the nearest is the sample itself


def test_its_activations_do_not_depend_on_the_unit_of_its_inputs(setup):
    stretched = setup.plan.joints * [2.0, 0.5, 4.0, 8.0, 1.0, 1.0]
    config = RadialBasis.Config(["angle", "velocity"], centres=9, active=4, width=1.0)
    one, other = RadialBasis(config), RadialBasis(config)
    one.reset(setup)
    other.reset(replace(setup, plan=setup.plan._replace(joints=stretched)))
    assert_array_equal(one.params.cells, other.params.cells)
    assert_allclose(one.params.activation, other.params.activation, atol=1e-9)


def test_a_cmac_on_a_model_knows_the_torque_of_the_model(make_config):
    planned, wrong = make_scenario(make_config(*SHORT)).setup, InverseDynamics.Config(1.1, 0.9)
    feedforward = CmacOnModel(wrong)
    feedforward.reset(planned)
    assert_array_equal(feedforward.known, InverseDynamics(wrong).compute_torque(planned))


def test_torques_of_another_number_of_samples_are_gone_on_from_at_the_same_phase(setup):
    learnt = np.random.default_rng(3).normal(size=(LEGS, SAMPLES, 2))
    feedforward = IterativeLearning(IterativeLearning.Config(None))
    feedforward.reset(replace(setup, learnt={"weights": learnt}))
    assert_array_equal(feedforward.params.weights, learnt)
    feedforward.reset(replace(setup, learnt={"weights": np.repeat(learnt, 2, axis=1)}))
    assert_allclose(feedforward.params.weights, learnt)
    feedforward.reset(replace(setup, learnt={"weights": learnt[:, ::2]}))
    assert_allclose(feedforward.params.weights[:, ::2], learnt[:, ::2])
    ring = np.concatenate([learnt[:, ::2], learnt[:, :1]], axis=1)
    assert_allclose(feedforward.params.weights[:, 1::2], (ring[:, 1:] + ring[:, :-1]) / 2.0)
    with pytest.raises(BadInput, match="start_from"):
        feedforward.reset(replace(setup, learnt={"weights": learnt[:1]}))


@pytest.mark.parametrize(("known", "samples"), [(600, 400), (400, 600), (7, 1)])
def test_a_harmonic_is_resampled_to_itself(known, samples):
    """Up to a linear interpolation's error, half of (angle step / 2)^2; where samples coincide, exactly."""

    def harmonic(n):
        return np.cos(2.0 * np.pi * np.arange(n) / n + 0.3)

    assert_allclose(resample(harmonic(known), samples), harmonic(samples), atol=0.5 * (np.pi / known) ** 2)


def test_radial_basis_functions_share_no_memory_and_clip_no_input(setup):
    feedforward = RadialBasis(RadialBasis.Config(["angle"], 12, 3, 0.5))
    feedforward.reset(setup)
    for use in feedforward.memory:
        assert (use.cells_colliding, use.clipped) == (0, 0)
        assert use.rows_used == use.cells_visited <= use.rows == 12
