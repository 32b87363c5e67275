"""The hybrid law: one LEAD over position and force errors of each leg, and the posture of a body."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import signal
from scipy.spatial.transform import Rotation
from support.doors import Leg, joint_torque, make_pose, make_scenario, trigonometry

from cmacexp.control import Reference
from cmacexp.control.hybrid_kernels import METHODS, posture_rate_term, posture_term
from cmacexp.planning import ControlReference
from cmacexp.plants import Measurement

GAINS = (
    *("controller.position_gain=90", "controller.velocity_gain=4", "force_control.force_gain=70"),
    *("force_control.elasticity=0.05", "force_control.admittance=0.02", "posture.rate_gain=5"),
)
HIPS = np.array([(0.225, 0.225), (0.225, -0.225), (-0.225, 0.225), (-0.225, -0.225)])


@pytest.fixture
def controller_of(make_config):
    """A controller with gains of its own, ready to act, without a feedforward."""
    return lambda *overrides: make_scenario(make_config("feedforward=none", *GAINS, *overrides)).controller


def act(controller, support, values, foot, velocity, force, q=(0.0, 0.0), body=(0.5, 0.1, 0.1), rate=(0.1, 0.2, 0.3)):
    """Action of one step; arrays have a row for each leg."""
    followed = ControlReference(values[:, :2], values[:, 2:4], *values[:, 4:].T)
    joints = np.tile(q, (len(force), 1))
    return controller.act(
        Reference(0, 0, False, np.asarray(support), followed, *[None] * 3),
        Measurement(joints, joints, foot, velocity, force, np.array(body), np.array(rate)),
    )


def noise(columns, seed):
    return np.random.default_rng(seed).normal(size=(40, columns))


REFERENCE, FOOT, VELOCITY, FORCE = noise(7, 0), noise(2, 1), noise(2, 2), noise(1, 3)


def feedback(controller, support, reference=REFERENCE, **more):
    """Feedback of one leg step by step; a leg on a stand has no posture, whatever its body is said to do."""
    rows = zip(reference[:, None], FOOT[:, None], VELOCITY[:, None], FORCE, strict=True)
    return np.array([act(controller, [support], *row, **more).feedback[0] for row in rows])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("support", [False, True])
def test_feedback_is_one_bilinear_lead_each_over_position_and_velocity_errors(controller_of, method, support):
    """With force terms in support along y alone (eq. 21)."""
    reference = REFERENCE * [1, 1, 1, 1, 1, 0, 1]
    position_error, velocity_error = reference[:, :2] - FOOT, reference[:, 2:4] - VELOCITY
    gains = np.array([[90.0, 90.0], [4.0, 4.0]])  # K_ap, K_av along x and y
    if support:
        position_error[:, 1] -= 0.05 * FORCE[:, 0]
        velocity_error[:, 1] -= 0.02 * FORCE[:, 0]
        if method == "explicit":
            position_error[:, 1] = reference[:, 4] - FORCE[:, 0]
        gains[:, 1] = {"stiffness": (90, 0), "damping": (0, 4), "combined": (90, 4), "explicit": (70, 0)}[method]
    lead = [1.0 / 5.0, 1.0], [1.0 / (10.0 * 5.0), 1.0]
    numerator, denominator, _ = signal.cont2discrete(lead, 0.005, method="bilinear")
    errors = gains[0] * position_error + gains[1] * velocity_error
    expected = signal.lfilter(numerator.ravel(), denominator, errors, axis=0)
    controller = controller_of("scenario=force_step", f"force_control={method}")
    assert_allclose(feedback(controller, support, reference), expected, rtol=1e-9, atol=1e-9)


def test_feedback_torque_of_a_leg_is_jacobian_transposed_times_force_and_desired_force(controller_of):
    """What a feedforward learns from is without the desired force that is added."""
    q, leg = (1.9, -0.8), Leg(0.35, 0.3, 0.5, 0.5, -1.0)
    force = feedback(controller_of("scenario=force_step"), True, REFERENCE * [1, 1, 1, 1, 1, 0, 1])
    on_leg = controller_of("scenario=one_leg", "machine.leg.length_2=0.3")
    torque, trig = feedback(on_leg, True, q=q), trigonometry(*q)
    pressed = [joint_torque(leg, trig, u[0], u[1] + added) for u, added in zip(force, REFERENCE[:, 5], strict=True)]
    assert_allclose(torque, pressed, rtol=1e-9, atol=1e-12)
    assert_allclose(on_leg.state.learning_error[0], joint_torque(leg, trig, *force[-1]), rtol=1e-9)


tilts, rates = st.floats(-0.3, 0.3), st.floats(-1.0, 1.0)
SUPPORT = [True, True, True, False]


@pytest.fixture(scope="module")
def law(make_config):
    """The controller of a body, with gains of 4 and 4 s of its posture."""
    posture = ("posture.gain=4", "posture.rate_gain=4")
    return make_scenario(make_config("scenario=quadruped", "feedforward=none", *posture)).controller


@given(st.floats(0.3, 0.6), tilts, tilts)
def test_supporting_feet_are_sent_gain_times_what_their_hip_lacks_below_the_plan(law, height, pitch, roll):
    values, feet = noise(7, 0)[:4], np.zeros((4, 2))
    sent = act(law, SUPPORT, values, feet, feet, np.zeros(4), body=(height, pitch, roll)).reference
    hips = height + Rotation.from_euler("YX", [pitch, roll]).apply(np.column_stack([HIPS, np.zeros(4)]))[:, 2]
    assert_allclose(sent[:, 1], values[:, 1] + np.where(SUPPORT, 4.0 * (0.5 - hips), 0.0), atol=1e-12)
    assert_allclose(sent[:, 0], values[:, 0])


@given(st.floats(0.4, 0.6), tilts, tilts, st.tuples(rates, rates, rates), st.integers(0, 3))
def test_the_rate_term_is_the_derivative_of_the_posture_term(law, height, pitch, roll, rate, leg):
    body, rate, dt = np.array([height, pitch, roll]), np.array(rate), 1e-6
    later, before = (posture_term(law.params, leg, make_pose(body + t * rate)) for t in (dt, -dt))
    found = posture_rate_term(law.params, leg, make_pose(body), rate)
    assert found == pytest.approx((later - before) / (2.0 * dt), abs=1e-7)


@pytest.mark.parametrize(("method", "weight"), [("stiffness", 0), ("damping", 1), ("combined", 1), ("explicit", 0)])
def test_supporting_feet_resist_the_speed_of_a_sinking_hip_where_velocity_is_fed_back(controller_of, method, weight):
    """A level body sinks by 0.1 m/s and pitches its nose down by 0.2 rad/s: torques over those of a still one."""
    sinking, feet = 0.1 + 0.2 * HIPS[:, 0], np.zeros((4, 2))
    torques = []
    for rate in ((-0.1, 0.2, 0.0), (0.0, 0.0, 0.0)):
        controller = controller_of("scenario=quadruped", f"force_control={method}", "controller.lead_omega=10")
        at_rest = (np.zeros((4, 7)), feet, feet, np.zeros(4))
        torques.append(act(controller, SUPPORT, *at_rest, q=(0.3, 1.2), body=(0.5, 0, 0), rate=rate).feedback)
    lead = (1.0 + 2.0 / 0.005 / 10.0) / (1.0 + 2.0 / 0.005 / 100.0)  # the first output of the bilinear LEAD
    leg, trig = Leg(0.35, 0.35, 0.5, 0.5, -1.0), trigonometry(0.3, 1.2)
    expected = [joint_torque(leg, trig, 0.0, weight * lead * 4.0 * 5.0 * v) for v in np.where(SUPPORT, sinking, 0.0)]
    assert_allclose(torques[0] - torques[1], expected, rtol=1e-9, atol=1e-9)
