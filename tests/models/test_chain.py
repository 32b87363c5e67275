"""Laws of a leg of three hinges."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from cmacexp.models.chain import (
    CHAIN_FIELDS,
    HINGE_FIELDS,
    HINGES,
    chain_angles,
    chain_kinematics,
    chain_motion,
    make_chains,
)
from cmacexp.models.leg import Leg, foot_position, jacobian, trigonometry
from cmacexp.models.mechanism import (
    CHAINS_UNDER_BODY,
    KINEMATICS_FIELDS,
    SPACE,
    Mechanism,
    apply_jacobian_transpose,
    compute_foot_velocity,
    update_kinematics,
)

angles = st.floats(-3.1, 3.1)
postures = st.tuples(angles, angles, angles)


@st.composite
def chains(draw):
    chain = draw(arrays(float, CHAIN_FIELDS, elements=st.floats(-1.0, 1.0)))
    for n in range(HINGES):
        axis = chain[HINGE_FIELDS * n + 3 : HINGE_FIELDS * (n + 1)]
        axis[:] = axis / np.linalg.norm(axis) if np.linalg.norm(axis) > 0.1 else [0.0, 0.0, 1.0]
    return chain


def planar_chain(leg):
    """A chain whose last two hinges are those of a planar leg, along x at joint angles of zero."""
    hinges = [[0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 0, 1], [leg.length_1, 0, 0, 0, 0, 1]]
    return np.array([*np.ravel(hinges), leg.length_1 + leg.length_2, 0, 0], dtype=float)


@given(chains(), postures)
def test_the_jacobian_is_the_derivative_of_the_foot(chain, q):
    h = 1e-6
    columns = np.array(chain_kinematics(chain, *q)[1:])
    steps = np.eye(HINGES) * h
    derivative = [
        (np.array(chain_kinematics(chain, *(q + step)).foot) - chain_kinematics(chain, *(q - step)).foot) / (2.0 * h)
        for step in steps
    ]
    assert_allclose(columns, derivative, atol=1e-8)


@given(chains(), postures, postures, postures)
def test_the_foot_gives_the_power_that_the_joints_take(chain, q, dq, push):
    """Velocity of the foot and torques of a force on it: F v = tau dq."""
    mechanism = Mechanism(CHAINS_UNDER_BODY, chain[None], 0.3, np.zeros((1, 2)), 1.0, SPACE, chains=chain[None])
    force, kinematics = np.array([push]), np.zeros((1, KINEMATICS_FIELDS[SPACE]))
    velocity, torque = np.zeros((1, 3)), np.zeros((1, 3))
    update_kinematics(mechanism, np.array([q]), kinematics)
    compute_foot_velocity(mechanism, 0, kinematics, np.array([dq]), velocity)
    apply_jacobian_transpose(mechanism, 0, kinematics, force, push[1], torque)
    assert_allclose((force * velocity).sum(), (torque * np.array([dq])).sum(), atol=1e-9)
    assert_allclose(velocity[0], np.array(chain_kinematics(chain, *q)[1:]).T @ dq, atol=1e-9)


def test_chains_are_in_the_frame_of_the_hip_forward_down_and_left():
    hinges = np.zeros((4, 3, 6))
    hinges[..., :3], hinges[..., 3:] = [0.3, 0.1, -0.2], [0.0, 1.0, 0.0]
    made = make_chains(hinges, np.tile([0.3, 0.1, -0.6], (4, 1)), np.tile([0.2, 0.1, 0.0], (4, 1)))
    assert_allclose(made, np.tile([*[0.1, 0.2, 0.0, 0.0, 0.0, 1.0] * 3, 0.1, 0.6, 0.0], (4, 1)))


@given(st.floats(0.1, 1.0), st.floats(0.1, 1.0), angles, angles)
def test_a_planar_leg_is_a_chain(length_1, length_2, q1, q2):
    leg = Leg(length_1, length_2, 1.0, 1.0, 1.0)
    trig, spatial = trigonometry(q1, q2), chain_kinematics(planar_chain(leg), 0.0, q1, q2)
    assert_allclose(spatial.foot, [*foot_position(leg, trig), 0.0], atol=1e-14)
    assert_allclose(np.transpose([spatial.thigh, spatial.calf])[:2].ravel(), jacobian(leg, trig), atol=1e-14)


DOG = np.array([0, 0, 0, 1, 0, 0, 0, 0, 0.08, 0, 0, 1, 0, 0.2, 0.08, 0, 0, 1, 0, 0.42, 0.08], dtype=float)
"""A leg like that of a robot: hip turns about x, thigh and calf about z, links down."""


def test_angles_put_the_foot_where_it_was_and_one_out_of_reach_has_none():
    q = np.random.default_rng(0).uniform([-0.5, 0.2, -2.4], [0.5, 1.2, -0.6], (50, 3))
    feet = [chain_kinematics(DOG, *posture).foot for posture in q]
    found = chain_angles(DOG, np.array([*feet, [0.0, 1.0, 0.0]]), np.array([0.0, 0.7, -1.5]))
    assert_allclose(found[:-1], q, atol=1e-9)
    assert np.isnan(found[-1]).all()


def test_joints_move_as_their_foot_does():
    t = np.linspace(0.0, 1.0, 2001)
    w = 2.0 * np.pi
    x, z = 0.1 * np.sin(w * t), 0.08 + 0.02 * np.cos(w * t)
    feet = np.stack([x, 0.3 + 0.05 * x, z], axis=1)
    velocity, acceleration = np.gradient(feet, t, axis=0), np.gradient(np.gradient(feet, t, axis=0), t, axis=0)
    q = chain_angles(DOG, feet, np.array([0.0, 0.7, -1.5]))
    dq, ddq = chain_motion(DOG, q, velocity, acceleration)
    inside = slice(5, -5)
    assert_allclose(dq[inside], np.gradient(q, t, axis=0)[inside], atol=2e-5)
    assert_allclose(ddq[inside], np.gradient(np.gradient(q, t, axis=0), t, axis=0)[inside], atol=2e-3)
