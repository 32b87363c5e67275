"""Laws of control: LEAD compensator, force control methods and their references, loop design."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import signal
from support.rollout import roll_out

from cmacexp.control.fault_detection import FaultDetection
from cmacexp.control.hybrid_kernels import METHODS, HybridParams, hybrid_feedback, new_hybrid_state
from cmacexp.loop.scenario import make_scenario
from cmacexp.models.ground import NEVER
from cmacexp.models.lead import discretise, lead_step
from cmacexp.models.leg import Leg, joint_torque, trigonometry
from cmacexp.models.mechanism import legs_on_stand, point_mass
from cmacexp.planning.columns import ACTING, BEFORE
from cmacexp.planning.reference import Gains, compute_support_reference, keeps_static_load
from cmacexp.sensors.kernels import new_observation
from pipelines.lead_design import EFFECTIVE_MASS, closed_loop, open_loop_bandwidth

corners = st.floats(0.5, 50.0)
ratios = st.floats(1.0, 30.0)
periods = st.floats(1e-4, 2e-2)


def analogue(omega, alpha, frequency):
    s = 1j * frequency
    return (1.0 + s / omega) / (1.0 + s / (alpha * omega))


def discrete(lead, frequency, period):
    delay = np.exp(-1j * frequency * period)
    return (lead.b0 + lead.b1 * delay) / (1.0 + lead.a1 * delay)


def compensate(lead, errors):
    """Output of the difference equation, from rest."""
    outputs, last_error, last_output = [], 0.0, 0.0
    for error in errors:
        last_output = lead_step(lead, error, last_error, last_output)
        last_error = error
        outputs.append(last_output)
    return np.array(outputs)


# LEAD


@given(corners, ratios, periods, st.floats(0.01, 0.9))
def test_discrete_lead_at_a_frequency_is_the_analogue_at_the_warped_frequency(omega, alpha, period, of_nyquist):
    frequency = of_nyquist * math.pi / period
    warped = 2.0 / period * math.tan(frequency * period / 2.0)
    found = discrete(discretise(omega, alpha, period), frequency, period)
    assert found == pytest.approx(analogue(omega, alpha, warped), rel=1e-9)


@pytest.mark.parametrize(("omega", "alpha"), [(5.0, 10.0), (10.0, 10.0), (20.0, 4.0)])
def test_discrete_lead_has_phase_and_gain_of_the_analogue_at_the_design_frequency(omega, alpha):
    period, design = 0.005, math.sqrt(alpha) * omega
    found = discrete(discretise(omega, alpha, period), design, period)
    warping = (design * period) ** 2 / 12.0
    assert np.angle(found) == pytest.approx(math.asin((alpha - 1.0) / (alpha + 1.0)), abs=warping)
    assert abs(found) == pytest.approx(math.sqrt(alpha), rel=2.0 * warping)


@pytest.mark.parametrize(("omega", "alpha", "period"), [(5.0, 10.0, 0.005), (10.0, 3.0, 0.002), (7.0, 1.0, 0.01)])
def test_difference_equation_is_the_bilinear_filter(omega, alpha, period):
    continuous = [1.0 / omega, 1.0], [1.0 / (alpha * omega), 1.0]
    numerator, denominator, _ = signal.cont2discrete(continuous, period, method="bilinear")
    errors = np.random.default_rng(0).normal(size=200)
    expected = signal.lfilter(numerator.ravel(), denominator, errors)
    assert_allclose(compensate(discretise(omega, alpha, period), errors), expected, rtol=1e-9, atol=1e-12)


# Hybrid law


def feedback(params, support, reference, foot, velocity, force, q=(0.0, 0.0)):
    """U and feedback torque of each step of one leg; rows of arrays are steps."""
    state, us, torques, trig = new_hybrid_state(1), [], [], np.array([trigonometry(*q)])
    for k in range(len(foot)):
        rows = {"foot": foot[k : k + 1], "velocity": velocity[k : k + 1], "force": force[k : k + 1]}
        observed = new_observation(1)._replace(geometry=trig, **rows)
        hybrid_feedback(params, state, np.array([support]), reference[k : k + 1], observed)
        us.append(state.learning_error[0].copy())
        torques.append(state.feedback[0].copy())
    return np.array(us), np.array(torques)


NO_DETECTION = FaultDetection(False, 0.0, 0.0, 1.0)
"""Force sensors that are believed, whatever they tell."""


def make_law(method="combined", mechanism=None, period=0.005):
    lead = discretise(5.0, 10.0, period)
    mechanism = mechanism or point_mass(0.5, 0.5)
    gains = Gains(90.0, 4.0, 70.0, 0.05, 0.02, 10.0)
    return HybridParams(mechanism, METHODS[method], gains, lead, 0.0, 0.0, NO_DETECTION)


def noise(columns, seed):
    return np.random.default_rng(seed).normal(size=(40, columns))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("support", [False, True])
def test_feedback_is_one_lead_each_over_position_and_velocity_errors(method, support):
    params, reference = make_law(method), noise(7, 0)
    reference[:, 5] = 0.0
    foot, velocity, force = noise(2, 1), noise(2, 2), noise(1, 3)[:, 0]
    position_error, velocity_error = reference[:, :2] - foot, reference[:, 2:4] - velocity
    gains = np.array([[90.0, 90.0], [4.0, 4.0]])  # K_ap, K_av along x and y
    if support:  # force terms along y alone (eq. 21)
        position_error[:, 1] -= 0.05 * force
        velocity_error[:, 1] -= 0.02 * force
        if method == "explicit":
            position_error[:, 1] = reference[:, 4] - force
        gains[:, 1] = {"stiffness": (90, 0), "damping": (0, 4), "combined": (90, 4), "explicit": (70, 0)}[method]
    expected = [
        gains[0, axis] * compensate(params.lead, position_error[:, axis])
        + gains[1, axis] * compensate(params.lead, velocity_error[:, axis])
        for axis in (0, 1)
    ]
    assert_allclose(feedback(params, support, reference, foot, velocity, force)[0].T, expected, rtol=1e-9, atol=1e-9)


def test_feedback_torque_of_a_leg_is_jacobian_transposed_times_force_and_desired_force():
    leg, q = Leg(0.35, 0.3, 0.5, 0.5, -1.0), (1.9, -0.8)
    at_foot, on_leg = make_law(), make_law(mechanism=legs_on_stand([leg], 0.5))
    motion = noise(7, 0), noise(2, 1), noise(2, 2), noise(1, 3)[:, 0]
    force, _ = feedback(at_foot, True, *motion)
    learning_error, torque = feedback(on_leg, True, *motion, q=q)
    trig = trigonometry(*q)
    for k in range(len(force)):
        assert_allclose(learning_error[k], joint_torque(leg, trig, *force[k]), rtol=1e-9)
        pressed = force[k] + (0.0, motion[0][k, 5])
        assert_allclose(torque[k], joint_torque(leg, trig, *pressed), rtol=1e-9, atol=1e-12)


# Force control methods


def steady_force(method, fed, position_gain, velocity_gain, force_gain, elasticity, admittance, stiffness):
    """Eq. 8, 10, 12, 14: force at rest for the D_r, dY_r or F_r that is fed."""
    if method == "stiffness":
        softness = 1.0 / stiffness + 1.0 / position_gain + elasticity
        return fed / softness
    if method == "damping":
        return velocity_gain * fed / (1.0 + velocity_gain * admittance)
    if method == "combined":
        rest = 1.0 + position_gain / stiffness + position_gain * elasticity + velocity_gain * admittance
        return position_gain * fed / rest
    return force_gain * fed / (1.0 + force_gain)


GAINS = {
    "paper": {},
    "firm": {"position_gain": 150.0, "velocity_gain": 8.0, "elasticity": 0.05, "admittance": 0.2},
    "mild": {"position_gain": 60.0, "velocity_gain": 6.0, "force_gain": 40.0, "stiffness": 20.0},
    "wrong ground": {"force_gain": 40.0, "stiffness": 20.0, "assumed_stiffness": 10.0},
}
KEYS = {
    "position_gain": "controller", "velocity_gain": "controller", "force_gain": "force_control",
    "elasticity": "force_control", "admittance": "force_control",
    "stiffness": "terrain", "assumed_stiffness": "terrain",
}  # fmt: skip


@pytest.mark.parametrize("gains", GAINS)
@pytest.mark.parametrize("method", METHODS)
def test_force_settles_at_the_steady_state_of_its_own_equation(make_config, method, gains):
    mass = ["machine.mass=1.0"] if method == "explicit" else []
    overrides = [f"{KEYS[name]}.{name}={value}" for name, value in GAINS[gains].items()]
    config = make_config(
        "scenario=force_step", f"force_control={method}", "force_control.desired_force=1.3",
        "gait.cycle_time=40", *mass, *overrides,
    )  # fmt: skip
    rollout = roll_out(make_scenario(config))
    row = rollout.plan.reference[0, 0, 0]
    fed = {"damping": row[3], "explicit": row[4]}.get(method, row[1] - config.machine.hip_height)
    control, params = config.controller, config.force_control
    expected = steady_force(
        method, fed, control.position_gain, control.velocity_gain,
        params.force_gain, params.elasticity, params.admittance, config.terrain.stiffness,
    )  # fmt: skip
    force = rollout.columns()["force"][:, 0]
    assert rollout.status == "completed"
    assert_allclose(force[-200:], expected, rtol=1e-3)
    if gains != "wrong ground" or method in ("damping", "explicit"):
        assert expected == pytest.approx(1.3, rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_force_settles_as_desired_where_the_desired_force_is_fed_forward(make_config, method):
    overrides = f"force_control={method}", "reference=force_feedforward", "force_control.desired_force=1.3"
    config = make_config("scenario=force_step", *overrides, "gait.cycle_time=40", "machine.mass=1.0")
    assert_allclose(roll_out(make_scenario(config)).columns()["force"][-200:], 1.3, rtol=1e-3)


positive = st.floats(1e-3, 1e3)
gains_of_any_size = st.builds(Gains, positive, positive, positive, positive, positive, positive)


@given(st.sampled_from(sorted(METHODS)), gains_of_any_size, positive)
def test_references_invert_the_steady_states(method, gains, force):
    reference = compute_support_reference(method, gains, True)
    per_newton = {"damping": reference.velocity, "explicit": reference.force}.get(method, reference.depression)
    assert steady_force(method, force * per_newton, *gains) == pytest.approx(force, rel=1e-12)


@given(st.sampled_from(sorted(METHODS)), gains_of_any_size)
def test_without_static_load_a_reference_lacks_exactly_its_gain_term(method, gains):
    held, dropped = (np.array(compute_support_reference(method, gains, keep)) for keep in (True, False))
    used = {"damping": 1, "explicit": 2}.get(method, 0)
    gain = {"damping": gains.velocity_gain, "explicit": gains.force_gain}.get(method, gains.position_gain)
    assert held[used] - dropped[used] == pytest.approx(1.0 / gain, rel=1e-6, abs=1e-9)
    assert np.array_equal(np.delete(held, used), np.delete(dropped, used), equal_nan=True)


@pytest.mark.parametrize(
    ("reference", "before", "acting"),
    [("literal", True, True), ("aware", True, False), ("force_feedforward", False, False)],
)
def test_static_load_is_kept_by_the_rule_of_the_reference(make_config, reference, before, acting):
    assert keeps_static_load(reference, False) is before
    assert keeps_static_load(reference, True) is acting
    plan = make_scenario(make_config("scenario=one_leg", f"reference={reference}")).setup.plan
    depth = plan.reference[:, plan.support[:, 0], 0, 1] - 0.5
    assert_allclose(depth[BEFORE], 0.215 if before else 0.205)
    assert_allclose(depth[ACTING], 0.215 if acting else 0.205)
    added = plan.force_desired if reference == "force_feedforward" else np.zeros_like(plan.force_desired)
    assert_allclose(plan.reference[..., 5], [added, added])
    assert plan.start_step == 600


def test_feedback_alone_never_leaves_its_first_references(make_config):
    assert make_scenario(make_config("feedforward=none", "reference=aware")).setup.plan.start_step == NEVER


# Design of the loop


@pytest.mark.parametrize(
    ("position_gain", "omega", "resonance"),
    [(100.0, 5.0, 1.08), (100.0, 10.0, 1.18), (100.0, 20.0, 1.35), (50.0, 10.0, 1.19)],
)
def test_resonance_of_the_shipped_compensators(position_gain, omega, resonance):
    loop = closed_loop(position_gain, 5.0, EFFECTIVE_MASS, omega, 10.0)
    assert loop.stable
    assert loop.resonance == pytest.approx(resonance, abs=0.005)


def test_closed_loop_is_faster_than_the_objective():
    assert closed_loop(100.0, 5.0, EFFECTIVE_MASS, 5.0, 10.0).bandwidth == pytest.approx(33.0, abs=0.5)
    assert open_loop_bandwidth(100.0, EFFECTIVE_MASS) == pytest.approx(11.5, abs=0.1)


@pytest.mark.parametrize("omega", [2.0, 5.0, 10.0, 40.0])
@pytest.mark.parametrize(("alpha", "mass"), [(10.0, 0.75), (3.0, 1.5), (30.0, 0.3)])
def test_closed_loop_agrees_with_a_frequency_response_computed_otherwise(omega, alpha, mass):
    compensator = signal.ZerosPolesGain([-omega], [-alpha * omega], alpha)
    controlled = signal.ZerosPolesGain([-20.0], [0.0, 0.0], 5.0 / mass)  # (100 + 5 s) / (mass s^2)
    frequencies = np.geomspace(0.1, 1e4, 200_001)
    opened = signal.freqresp(compensator, frequencies)[1] * signal.freqresp(controlled, frequencies)[1]
    magnitude = np.abs(opened / (1.0 + opened))
    loop = closed_loop(100.0, 5.0, mass, omega, alpha)
    assert loop.resonance == pytest.approx(magnitude.max(), rel=1e-4)
    assert loop.bandwidth == pytest.approx(frequencies[magnitude >= math.sqrt(0.5)].max(), rel=3e-3)


def test_an_unstable_loop_is_called_so():
    assert not closed_loop(100.0, 0.0, 0.75, 5.0, 0.5).stable
