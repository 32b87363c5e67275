"""Laws of the leg: kinematics and dynamics."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from cmacexp.models import leg as model
from cmacexp.models.leg import GRAVITY, Leg

lengths, masses, angles = st.floats(0.1, 1.0), st.floats(0.1, 5.0), st.floats(-3.1, 3.1)
legs = st.tuples(lengths, lengths, masses, masses, st.sampled_from([-1.0, 1.0])).map(lambda fields: Leg(*fields))
postures = st.tuples(angles, angles)
bent = st.floats(0.1, 3.0)
"""|theta2| of a knee that is neither straight nor folded."""
speeds = st.tuples(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0))
torques = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))


def foot(leg, q):
    return np.array(model.foot_position(leg, model.trigonometry(*q)))


def knee(leg, q):
    return leg.length_1 * np.array([math.cos(q[0]), math.sin(q[0])])


def inertia(leg, q):
    m11, m12, m22 = model.inertia(leg, model.trigonometry(*q))
    return np.array([[m11, m12], [m12, m22]])


def bias(leg, q, dq):
    return np.array(model.bias_torque(leg, model.trigonometry(*q), *dq))


def jacobian(leg, q):
    return np.reshape(model.jacobian(leg, model.trigonometry(*q)), (2, 2))


def potential(leg, q):
    return -GRAVITY * (leg.mass_1 * knee(leg, q)[1] + leg.mass_2 * foot(leg, q)[1])


def gradient(function, q, h=1e-6):
    """Central differences of ``function`` along each joint, stacked last."""
    steps = np.eye(2) * h
    return np.stack([(function(q + step) - function(q - step)) / (2.0 * h) for step in steps], axis=-1)


@given(legs, postures, speeds)
def test_inertia_is_positive_and_gives_the_kinetic_energy_of_the_two_point_masses(leg, q, dq):
    velocities = [gradient(partial(place, leg), np.array(q)) @ dq for place in (knee, foot)]
    twice = leg.mass_1 * velocities[0] @ velocities[0] + leg.mass_2 * velocities[1] @ velocities[1]
    assert_allclose(dq @ inertia(leg, q) @ dq, twice, rtol=1e-7, atol=1e-7)
    assert np.linalg.eigvalsh(inertia(leg, q)).min() > 0.0


@given(legs, postures, speeds, torques, st.floats(0.0, 50.0))
def test_inverse_dynamics_inverts_forward_dynamics(leg, q, dq, tau, force):
    trig = model.trigonometry(*q)
    ddq = model.forward_dynamics(leg, trig, *dq, *tau, force)
    assert_allclose(model.inverse_dynamics(leg, trig, *dq, *ddq, force), tau, rtol=1e-9, atol=1e-8)


@given(legs, angles, bent)
def test_inverse_kinematics_inverts_forward_kinematics_on_the_side_of_the_knee(leg, q1, q2):
    q = q1, leg.knee * q2
    found = model.inverse_kinematics(leg, *foot(leg, q))
    assert math.copysign(1.0, found[1]) == leg.knee
    assert found[1] == pytest.approx(q[1], abs=1e-9)
    assert math.remainder(found[0] - q[0], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(legs, angles, st.floats(1.001, 10.0))
def test_inverse_kinematics_is_nan_out_of_reach(leg, direction, factor):
    heading = np.array([math.cos(direction), math.sin(direction)])
    too_far = factor * (leg.length_1 + leg.length_2) * heading
    too_near = abs(leg.length_1 - leg.length_2) / factor * heading
    assert np.isnan(model.inverse_kinematics(leg, *too_far)).all()
    if abs(leg.length_1 - leg.length_2) > 1e-3:
        assert np.isnan(model.inverse_kinematics(leg, *too_near)).all()


@given(legs, postures)
def test_jacobian_is_the_derivative_of_forward_kinematics(leg, q):
    assert_allclose(jacobian(leg, q), gradient(lambda p: foot(leg, p), np.array(q)), atol=1e-8)


@given(legs, postures, speeds, torques)
def test_power_at_the_foot_is_power_at_the_joints(leg, q, dq, force):
    trig = model.trigonometry(*q)
    at_joints = np.dot(model.joint_torque(leg, trig, *force), dq)
    assert at_joints == pytest.approx(np.dot(force, model.foot_velocity(leg, trig, *dq)), rel=1e-9, abs=1e-9)


@given(legs, postures, speeds, speeds)
def test_coriolis_torque_does_no_work_and_gravity_is_the_gradient_of_the_potential_energy(leg, q, dq, x):
    q, dq, x = np.array(q), np.array(dq), np.array(x)
    slope = gradient(lambda p: inertia(leg, p), q)  # slope[i, j, k] = dM_ij/dq_k
    christoffel = 0.5 * (slope + slope.transpose(0, 2, 1) - slope.transpose(2, 1, 0))
    coriolis = christoffel @ dq
    gravity = gradient(partial(potential, leg), q)
    assert_allclose(bias(leg, q, np.zeros(2)), gravity, rtol=1e-6, atol=1e-6)
    assert_allclose(coriolis @ dq + gravity, bias(leg, q, dq), rtol=1e-6, atol=1e-5)
    assert x @ (slope @ dq - 2.0 * coriolis) @ x == pytest.approx(0.0, abs=1e-4)
