"""What docs/theory.md says is proven, with the project's kernels, and the counterexamples to what is not."""

import math

import numpy as np
import pytest
from support.doors import make_scenario

from cmacexp.cmac.memory import read, train
from cmacexp.cmac.rules import PAPER_RATE, derive_rate

SAMPLES, LAYERS, WIDTH = 40, 8, 10
CELLS = np.array([[(k + j) // WIDTH * LAYERS + j for j in range(LAYERS)] for k in range(SAMPLES)], dtype=np.uint32)
SHARED = np.zeros_like(CELLS) + CELLS[:1]
"""One set of cells for all samples."""
OWN = np.arange(SAMPLES, dtype=np.uint32)[:, None]
"""K = I: no two samples share a cell."""


def lagging(lead, share=1.0):
    """Responses h_0, h_1, ... of T: ``lead`` samples of delay, then a lag that passes ``share`` in a sample."""
    return np.concatenate([np.zeros(lead), share * (1.0 - share) ** np.arange(SAMPLES if share < 1.0 else 1)])


def count_active(cells):
    """A, (N, rows): how often a row is active at each sample."""
    matrix = np.zeros((len(cells), int(cells.max()) + 1))
    np.add.at(matrix, (np.arange(len(cells))[:, None], cells), 1.0)
    return matrix[:, matrix.any(axis=0)]


def kernel(cells):
    active = count_active(cells)
    return active @ active.T / cells.shape[1]


def start_weights(cells):
    return np.random.default_rng(0).standard_normal((int(cells.max()) + 1, 2))


def learn(cells, lead, rate, response, weights, steps=4000, before=None, disturbance=None):
    """|w|^2 before each step, torques and feedback, (steps, 2), where the feedback vanishes without a torque.

    ``before`` (len(response), 2) are the torques before the first step, the latest one first: none, learning starts
    from rest. ``disturbance`` (steps, 2) is added to the feedback.
    """
    weights, squares = weights.copy(), []
    torques, errors = np.zeros((steps, 2)), np.zeros((steps, 2)) if disturbance is None else disturbance.copy()
    recent = np.zeros((len(response), 2)) if before is None else np.vstack([np.zeros((1, 2)), before[:-1]])
    for n in range(steps):
        if n > 0:
            train(weights, cells[(n - 1 - lead) % SAMPLES], errors[n - 1], rate)
            recent = np.roll(recent, 1, axis=0)
        squares.append(float((weights**2).sum()))
        read(weights, cells[n % SAMPLES], torques[n])
        recent[0] = torques[n]
        errors[n] -= response @ recent
    return np.array(squares), torques, errors


@pytest.mark.parametrize("lead", [1, 2, 4])
def test_no_cmac_grows_within_condition_2(lead):
    squares, _, errors = learn(CELLS, lead, 0.95 / (lead + 0.5), lagging(lead), start_weights(CELLS))
    assert squares.max() <= squares[0]
    assert np.abs(errors[-SAMPLES:]).max() < 0.1 * np.abs(errors[:SAMPLES]).max()


@pytest.mark.parametrize("layers_per_row", [1, 2])
@pytest.mark.parametrize("lead", [1, 4])
def test_shared_cells_grow_beyond_the_critical_rate_where_a_row_of_two_layers_counts_twice(lead, layers_per_row):
    cells = np.concatenate([SHARED[:, : LAYERS // layers_per_row]] * layers_per_row, axis=1)
    assert kernel(cells).max() == layers_per_row
    critical = 2.0 * math.sin(math.pi / (4 * lead + 2)) / layers_per_row
    for share, grows in ((0.95, False), (1.05, True)):
        squares, _, _ = learn(cells, lead, share * critical, lagging(lead), start_weights(cells))
        assert (squares[-1] > squares[0]) == grows
        assert share * critical < 2.0 / layers_per_row  # which condition 1 allows


@pytest.mark.parametrize("cells", [CELLS, SHARED, OWN], ids=["overlapping", "shared", "own"])
def test_a_first_order_lag_lowers_no_rate_if_the_lead_is_the_delay_alone(cells):
    for lead, share in ((1, 0.1), (1, 0.9), (3, 0.5)):
        squares, _, errors = learn(cells, lead, 0.95 / (lead + 0.5), lagging(lead, share), start_weights(cells))
        assert squares.max() <= squares[0]
        assert np.abs(errors[-SAMPLES:]).max() < 0.5 * np.abs(errors[: 2 * SAMPLES]).max()


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_no_lead_but_the_delay_meets_a_condition_behind_a_lag(share):
    z = np.exp(1j * np.linspace(0.0, math.pi, 400))
    for delay in (1, 3):
        transfer = sum(h * z**-n for n, h in enumerate(lagging(delay, share)))
        least = {lead: (z**lead * transfer).real.min() for lead in range(8)}
        assert [lead for lead, real in least.items() if real > 0.0] == [delay]


def test_pending_errors_can_raise_v_where_learning_from_rest_cannot():
    """K = I, lead 1, behind a lag: errors that are pending at first train samples that did not cause them."""
    weights = np.repeat(np.where(np.arange(SAMPLES) < SAMPLES // 2, 1.0, -1.0)[:, None], 2, axis=1) / math.sqrt(2.0)
    weights[-1] *= -1.0
    response, before = lagging(1, 0.2), weights[(-1 - np.arange(SAMPLES + 1)) % SAMPLES]
    at_rest, _, _ = learn(OWN, 1, 1.0, response, weights)
    pending, _, errors = learn(OWN, 1, 1.0, response, weights, before=before)
    assert at_rest.max() <= at_rest[0] == pytest.approx(SAMPLES)
    assert pending.max() == pytest.approx(42.1, abs=0.05)
    assert np.abs(errors[-SAMPLES:]).max() < 1e-6  # the feedback vanishes all the same


@pytest.mark.ci
def test_hashing_raises_the_diagonal_of_the_kernel_of_the_quadruped(make_config):
    """By default two layers of some samples share a row; with a row for each visited cell none do."""
    for addressing, largest, share in (("hashed", 1.0625, 0.038), ("visited", 1.0, 0.0)):
        config = make_config("scenario=quadruped", f"cmac.addressing={addressing}")
        cells = make_scenario(config).feedforward.params.cells
        diagonals = np.stack([np.diag(kernel(cells[:, i])) for i in range(cells.shape[1])])
        assert (diagonals.min(), diagonals.max()) == (1.0, largest)
        assert (diagonals > 1.0).mean(axis=1).max() == pytest.approx(share, abs=0.001)


@pytest.mark.ci
def test_the_kernel_of_the_paper_s_leg_is_singular_and_narrow_after_lift_off(make_config):
    cells = make_scenario(make_config("scenario=one_leg")).feedforward.params.cells[:, 0]
    matrix = kernel(cells)
    assert (np.linalg.matrix_rank(count_active(cells)), len(matrix)) == (252, 600)
    assert np.diag(matrix).max() == matrix.max() == 1.0
    shared = np.diag(matrix, 1)  # with the next sample, 5 ms later
    assert (shared[:8].min().round(2), shared[:8].max().round(2), np.median(shared)) == (0.09, 0.53, 1.0)


MAPPED = lagging(1, 0.5)[:SAMPLES], 0.5, 1
"""Responses, rate and lead of :func:`map_cycles`."""
DISTURBANCE = np.random.default_rng(1).standard_normal((SAMPLES, 2))
"""Of every cycle; no weights cancel it."""


def map_torques(matrix, within, before, rate, lead):
    """The map of (u^j, u^(j-1)) for K, G_0 and G_1, each (N, N), and the functionals that it conserves."""
    samples = len(matrix)
    shifted = matrix[:, (np.arange(samples) - lead) % samples]
    earlier = np.tril(shifted, -1)
    one, none, later = np.eye(samples), np.zeros((samples, samples)), shifted - earlier
    own = one + rate * earlier @ within
    first = np.linalg.solve(own, one - rate * later @ within - rate * earlier @ before)
    second = np.linalg.solve(own, -rate * later @ before)
    return np.block([[first, second], [one, none]]), np.hstack([own, rate * earlier @ before])


def map_weights(active, layers, within, before, rate, lead):
    """The map of the weights in the range of A^T, in an orthonormal basis, and of the last torque."""
    samples = len(active)
    _, values, basis = np.linalg.svd(active)
    basis = basis[: (values > 1e-9 * values[0]).sum()].T
    teaching = np.roll(active, lead, axis=0)
    earlier = np.tril(active @ teaching.T / layers, -1)
    own = np.eye(samples) + rate * earlier @ within
    torque = np.linalg.solve(own, np.hstack([active @ basis, -rate * earlier @ before]))
    error = -within @ torque - np.hstack([np.zeros((samples, basis.shape[1])), before])
    change = rate / layers * basis.T @ teaching.T @ error
    return np.vstack([np.hstack([np.eye(basis.shape[1]), np.zeros((basis.shape[1], samples))]) + change, torque])


def respond(response):
    """G_0 and G_1, (N, N) each, of a loop that is constant over the cycle."""
    lags = np.arange(SAMPLES)[:, None] - np.arange(SAMPLES)
    return (np.where(chosen, response[lags % SAMPLES], 0.0) for chosen in (lags >= 0, lags < 0))


def map_cycles():
    """The map of (u^j, u^(j-1)) of CELLS, and the functionals that it conserves."""
    response, rate, lead = MAPPED
    return map_torques(kernel(CELLS), *respond(response), rate, lead)


def test_the_torque_follows_the_cycle_map():
    """Changes from cycle to cycle, in which a constant disturbance drops out."""
    (step, _), (response, rate, lead) = map_cycles(), MAPPED
    disturbance = np.tile(DISTURBANCE, (6, 1))
    _, torques, _ = learn(CELLS, lead, rate, response, start_weights(CELLS), 6 * SAMPLES, disturbance=disturbance)
    changes = np.diff(torques.reshape(6, SAMPLES, 2), axis=0)
    for j in range(2, 5):
        expected = step @ np.concatenate([changes[j - 1], changes[j - 2]])
        np.testing.assert_allclose(expected[:SAMPLES], changes[j], atol=1e-12)


def test_eigenvalue_one_is_semisimple_and_counts_what_a_singular_kernel_does_not_learn():
    (step, conserved), matrix = map_cycles(), kernel(CELLS)
    unlearnt = SAMPLES - np.linalg.matrix_rank(matrix)
    values = np.linalg.eigvals(step)
    ones = np.abs(values - 1.0) < 1e-6
    assert ones.sum() == unlearnt > 0  # so the spectral radius is 1 ...
    assert np.abs(values[~ones]).max() < 1.0  # ... and learning converges all the same,
    assert np.linalg.matrix_rank(step - np.eye(len(step)), tol=1e-9) == len(step) - unlearnt  # since 1 is semisimple
    # Components outside the range of K of the torque that the weights give at the start of a cycle never change.
    outside = np.linalg.svd(matrix)[0][:, SAMPLES - unlearnt :].T @ conserved
    np.testing.assert_allclose(outside @ step, outside, atol=1e-9)


def test_the_map_of_weights_has_the_eigenvalues_of_the_map_of_torques_but_the_conserved_ones():
    (step, _), (response, rate, lead) = map_cycles(), MAPPED
    of_torques, of_weights = (
        np.sort(np.abs(values[np.abs(values) > 1e-3]))
        for values in map(
            np.linalg.eigvals, (step, map_weights(count_active(CELLS), LAYERS, *respond(response), rate, lead))
        )
    )
    unlearnt = SAMPLES - np.linalg.matrix_rank(kernel(CELLS))
    assert len(of_weights) == len(of_torques) - unlearnt
    np.testing.assert_allclose(of_weights, of_torques[:-unlearnt], atol=1e-6)


@pytest.mark.parametrize("rate", [0.05, 0.5])
def test_a_torque_that_weights_give_may_be_fixed_where_learning_diverges(rate):
    """Two samples share all cells; the second one disturbs the first one of the next cycle."""
    within, before = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, -1.0], [0.0, 0.0]])
    step, _ = map_torques(np.ones((2, 2)), within, before, rate, lead=0)
    np.testing.assert_allclose(step @ np.ones(4), np.ones(4))
    expected = (1.0 + math.sqrt(1.0 + 4.0 * rate**2)) / 2.0
    values = np.linalg.eigvals(map_weights(np.ones((2, 1)), 1, within, before, rate, lead=0))
    assert np.abs(values).max() == pytest.approx(expected)
    assert np.abs(values - 1.0).min() > rate**2 / 2.0
    weights, cells, torque, sizes = np.ones((1, 2)), np.zeros((1,), np.uint32), np.zeros((2, 2)), []
    last = torque.copy()
    for _ in range(2000):
        for k in range(2):
            read(weights, cells, torque[k])
            train(weights, cells, -within[k] @ torque - before[k] @ last, rate)
        last[:] = torque
        sizes.append(abs(weights[0, 0]))
        if sizes[-1] > 1e200:
            break
    assert sizes[-1] / sizes[-2] == pytest.approx(expected, rel=1e-6)


def test_learning_converges_to_a_residual_that_no_weights_cancel():
    (response, rate, lead), cycles = MAPPED, 400
    steps, disturbance = cycles * SAMPLES, np.tile(DISTURBANCE, (cycles, 1))
    _, _, errors = learn(CELLS, lead, rate, response, start_weights(CELLS), steps, disturbance=disturbance)
    first, last = (np.roll(errors[n : n + SAMPLES], -lead, axis=0) for n in (0, steps - SAMPLES))
    taught, left = (np.abs(count_active(CELLS).T @ each).max() for each in (first, last))
    assert left < 0.02 * taught
    assert np.abs(last).max() > 0.1 * np.abs(first).max()


@pytest.mark.parametrize(
    ("cells", "rate", "excess"),
    [(OWN, 0.5, 0.5 / (2.0 - 0.5)), (OWN, 0.05, 0.05 / 2.0), (CELLS, 0.05, 0.05 / 2.0)],
    ids=["own fast", "own", "overlapping"],
)
def test_noise_leaves_half_the_rate_of_its_variance_in_the_torque(cells, rate, excess):
    noise, weights = np.random.default_rng(3).standard_normal((24000, 2)), np.zeros((int(cells.max()) + 1, 2))
    _, torques, _ = learn(cells, 1, rate, lagging(1), weights, len(noise), disturbance=noise)
    assert (torques[4000:] ** 2).mean() == pytest.approx(excess, rel=0.1)


def test_the_rate_by_rule_has_the_margins_that_the_page_states():
    assert {derive_rate(lead) for lead in range(-5, 2)} == {PAPER_RATE}
    leads = np.arange(1, 50)
    rates = np.array([derive_rate(lead) for lead in leads])
    allowed = 1.0 / (leads + 0.5) / rates
    assert allowed.min() == allowed[0] == pytest.approx(3.413, abs=0.001)
    crossing = 2.0 * np.arcsin(rates / 2.0)  # where the loop gain rate z^-lead / (z - 1) is 1
    margins = 90.0 - np.degrees(crossing * (leads + 0.5))
    assert margins[:2].round() == pytest.approx([73, 81])
    assert (np.diff(margins) > 0.0).all()
