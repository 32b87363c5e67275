"""T, from feedforward torque to the learning error: the lead that holds is the samples from torque to feedback."""

import numpy as np
import pytest
from support.doors import make_scenario

from cmacexp.addons.stability.transfer import Local, compute_spectrum, locals_along, transfer

PERIOD = 0.005
FREQUENCIES = np.linspace(1.0, 100.0, 100)
MID_TRANSFER, MID_SUPPORT = 60, 360


def test_transfer_of_an_integrator_under_proportional_feedback():
    # x+ = x + f + u with f = -0.5 x, so -f/u = 0.5 z^-1/(1 - 0.5 z^-1).
    one = np.ones((1, 1))
    local = Local(one, one, -0.5 * one)
    z = np.exp(2j * np.pi * FREQUENCIES * PERIOD)
    path = 0.5 / (z - 1.0)
    np.testing.assert_allclose(transfer(local, FREQUENCIES, PERIOD)[:, 0, 0], path / (1.0 + path))


def respond(responses):
    """A loop whose torque shows in the feedback as minus ``responses`` (n, J, J), from the next sample on."""
    length, joints, _ = responses.shape
    closed, b = np.eye(length * joints, k=-joints), np.eye(length * joints, joints)
    c = -np.hstack(list(responses))
    return Local(closed - b @ c, b, c)


def test_eigenvalues_with_positive_real_parts_do_not_suffice():
    """Two joints that act on each other at other frequencies."""
    slow, fast = (np.poly1d([1.0, sign]) ** 4 / 16.0 for sign in (1.0, -1.0))
    responses = np.zeros((5, 2, 2))
    responses[0] = np.eye(2)
    responses[:, 0, 1], responses[:, 1, 0] = 3.0 * slow.c, 3.0 * fast.c
    local, rate = respond(responses), 0.05
    z = np.exp(2j * np.pi * FREQUENCIES * PERIOD)
    turned = z[:, None] * np.linalg.eigvals(transfer(local, FREQUENCIES, PERIOD))
    assert (turned.real - 1.5 * rate * np.abs(turned) ** 2).min() > 0.1  # condition 2 of eigenvalues, with lead 1
    assert compute_spectrum(local, FREQUENCIES, PERIOD).least(1) < -0.1


def test_a_weight_of_joints_whose_inertia_couples_them_keeps_learning_positive():
    """Gain over inertia is not symmetric, so its Hermitian part may be indefinite; with the weight it is not."""
    gain, inertia = np.diag([1.0, 0.05]), np.array([[2.0, 0.9], [0.9, 0.5]])
    response = gain @ np.linalg.inv(inertia)
    assert np.linalg.eigvalsh(response + response.T)[0] < 0.0
    found = compute_spectrum(respond(response[None]), FREQUENCIES, PERIOD)
    np.testing.assert_allclose(found.least_real(1), np.linalg.eigvals(response).real.min())
    share = 0.3
    np.testing.assert_allclose(
        found.least(1, share), min(value - share * value**2 for value in np.linalg.eigvals(response).real)
    )


ONE_LEG = ("scenario=one_leg", "cycles=9", "learning.lead=auto")


@pytest.mark.ci
@pytest.mark.parametrize("delay", [0, 1, 2])
def test_learning_settles_with_one_lead_alone_and_the_paper_learns_wrongly_above_some_20_hz(make_config, delay):
    config = make_config(*ONE_LEG, f"actuator.delay={delay}")
    for local in locals_along(config, 4, [MID_TRANSFER, MID_SUPPORT]):
        found = compute_spectrum(local, FREQUENCIES, PERIOD)
        assert [lead for lead in range(-2, 5) if found.least(lead) > 0.0] == [delay + 1]
        assert delay or 20.0 <= FREQUENCIES[np.argmax(found.least_real(0) < 0.0)] <= 30.0


@pytest.mark.ci
def test_counting_a_lag_in_the_lead_leaves_the_proof(make_config):
    config = make_config(*ONE_LEG, "actuator.lag=0.01")
    assert make_scenario(config).setup.lead == 2
    (local,) = locals_along(config, 4, [MID_TRANSFER])
    late = compute_spectrum(local, FREQUENCIES, PERIOD)
    assert late.least(2) < 0.0
    assert FREQUENCIES[np.argmax(late.least_real(2) < 0.0)] > 30.0  # positive below
