"""T, from feedforward torque to the learning error: the lead that holds is the samples from torque to feedback."""

import numpy as np
import pytest

from cmacexp.stability.cycle_map import make_restorable_loop
from cmacexp.stability.transfer import Local, compute_spectrum, locals_along, transfer

PERIOD = 0.005
FREQUENCIES = np.linspace(1.0, 100.0, 100)
MID_TRANSFER, MID_SUPPORT = 60, 360


@pytest.fixture(scope="module")
def places(make_config):
    return locals_along(make_config("scenario=one_leg", "cycles=9"), 4, [MID_TRANSFER, MID_SUPPORT])


def test_transfer_of_an_integrator_under_proportional_feedback():
    # x+ = x + f + u with f = -0.5 x, so -f/u = 0.5 z^-1/(1 - 0.5 z^-1).
    one = np.ones((1, 1))
    local = Local(one, one, -0.5 * one)
    z = np.exp(2j * np.pi * FREQUENCIES * PERIOD)
    path = 0.5 / (z - 1.0)
    np.testing.assert_allclose(transfer(local, FREQUENCIES, PERIOD)[:, 0, 0], path / (1.0 + path))


def test_a_torque_shows_in_the_feedback_of_the_next_step(make_config, places):
    loop = make_restorable_loop(make_config("scenario=one_leg", "cycles=9"))
    for _ in range(5):
        loop.advance(loop.period)
    torque = loop.column("tau_feedforward")
    loop.play(torque)
    loop.advance(loop.period)
    loop.advance(MID_TRANSFER)
    state, answers = loop.hold(), []
    for sign in (1.0, -1.0):
        loop.put(state)
        torque[MID_TRANSFER, 0, 0] += sign * 1e-4
        assert loop.advance(3)
        answers.append(loop.column("tau_feedback")[:3, 0])
        torque[MID_TRANSFER, 0, 0] -= sign * 1e-4
    response = (answers[0] - answers[1]) / 2e-4
    local = places[0]
    closed = local.a + local.b @ local.c
    np.testing.assert_array_equal(response[0], 0.0)
    # The sample moves on between the two, by which the Jacobian changes a little.
    np.testing.assert_allclose(response[1], local.c @ local.b[:, 0], atol=0.005)
    np.testing.assert_allclose(response[2], local.c @ closed @ local.b[:, 0], atol=0.01)
    assert response[1, 0] < -0.1


def test_learning_settles_everywhere_with_one_lead_alone(places):
    for local in places:
        found = compute_spectrum(local, FREQUENCIES, PERIOD)
        assert [lead for lead in range(-2, 5) if found.least(lead) > 0.0] == [1]


def test_the_paper_learns_wrongly_above_some_20_hz(places):
    for local in places:
        found = compute_spectrum(local, FREQUENCIES, PERIOD)
        assert 20.0 <= FREQUENCIES[np.argmax(found.least_real(0) < 0.0)] <= 30.0
        assert found.least(1) >= 0.0


@pytest.mark.parametrize("delay", [1, 2])
def test_delay_of_the_actuator_asks_for_as_much_more_lead(make_config, delay):
    config = make_config("scenario=one_leg", "cycles=9", f"actuator.delay={delay}", "learning.lead=auto")
    (local,) = locals_along(config, 4, [MID_TRANSFER])
    late = compute_spectrum(local, FREQUENCIES, PERIOD)
    assert late.least(delay + 1) > 0.0 > late.least(delay)
