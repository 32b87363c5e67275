"""Laws of the models of robots: geometry and inertia agree with MuJoCo, gains scale as their equations say."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.robots import MODELS, change, read

from cmacexp.models.chain import chain_kinematics
from cmacexp.models.leg import GRAVITY
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.robot import load_mujoco
from cmacexp.models.robot_gains import Basis, derive_basis, derive_gains

TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From the frame of the trunk (x forward, y left, z up) to that of a chain (x forward, y down, z left)."""
SOME = [name for name in MODELS if name in ("own", "hyqreal1", "mini_cheetah")]
"""Each has its own signs of the axes."""
BASIS = Basis(mass=12.0, foot_mass=0.3, hip_height=0.3, stiffness=1e4, damping=50.0)


def chains(robot):
    """Chains of the four legs, about the origin of the trunk."""
    hinges = np.concatenate([robot.hinges[..., :3] @ TURN.T, robot.hinges[..., 3:] @ TURN.T], axis=-1)
    return np.concatenate([hinges.reshape(4, 18), robot.feet_at_zero @ TURN.T], axis=-1)


@pytest.mark.ci
@pytest.mark.parametrize("name", SOME)
def test_feet_by_the_product_of_exponentials_are_those_of_mujoco(name):
    robot = read(MODELS[name])
    for q in np.random.default_rng(0).uniform(-3.0, 3.0, (20, 4, 3)):
        data = robot.at(q)
        feet = [chain_kinematics(chain, *angles).foot for chain, angles in zip(chains(robot), q, strict=True)]
        assert_allclose(feet @ TURN, data.geom_xpos[robot.legs.foot_geom], rtol=0, atol=1e-12)


@pytest.mark.ci
@pytest.mark.parametrize("name", SOME)
def test_no_motion_of_a_foot_takes_less_energy_than_the_mass_that_it_feels(name):
    mujoco, robot = load_mujoco(), read(MODELS[name])
    model, data, foot_mass = robot.model, robot.at(robot.home), derive_basis(robot).foot_mass
    mujoco.mj_fwdPosition(model, data)
    masses = []
    for dof, geom in zip(robot.legs.dof, robot.legs.foot_geom, strict=True):
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jacGeom(model, data, jacobian, None, int(geom))
        for velocity in np.random.default_rng(1).normal(size=(300, 3)):
            data.qvel[:] = 0.0
            data.qvel[dof] = np.linalg.solve(jacobian[:, dof], velocity)
            mujoco.mj_energyVel(model, data)
            masses.append(2.0 * data.energy[1] / (velocity @ velocity))
    assert foot_mass <= min(masses) <= 1.05 * foot_mass


@pytest.mark.parametrize("loop_delay", [LoopDelay(), LoopDelay(1), LoopDelay(1, (0.0002,))])
def test_the_body_stands_on_its_legs_as_on_a_damped_spring_whatever_delays_feedback(loop_delay):
    gains = derive_gains(BASIS, 0.001, 2.9, loop_delay)
    stiffness = 4.0 * gains.position_gain * (1.0 + gains.posture_gain)
    damping = 4.0 * gains.velocity_gain * (1.0 + gains.posture_rate_gain)
    assert np.sqrt(stiffness / BASIS.mass) == pytest.approx(27.0)
    assert damping == pytest.approx(2.0 * np.sqrt(stiffness * BASIS.mass))


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_robots_that_differ_in_scale_alone_differ_in_gains_alone_by_it(scale):
    heavier = BASIS._replace(mass=BASIS.mass * scale, foot_mass=BASIS.foot_mass * scale)
    one, other = (derive_gains(each, 0.002, 2.9) for each in (BASIS, heavier))
    assert_allclose(np.divide(other, one), [scale, scale, 1.0, 1.0, 1.0 / scale, 1.0 / scale])


def test_a_shorter_period_or_a_smaller_lead_allows_larger_gains():
    slow, fast, plain = (derive_gains(BASIS, *each) for each in ((0.002, 3.0), (0.001, 3.0), (0.001, 1.0)))
    assert slow.velocity_gain < fast.velocity_gain < plain.velocity_gain
    assert slow.position_gain / slow.velocity_gain == pytest.approx(plain.position_gain / plain.velocity_gain)


@pytest.mark.ci
def test_masses_limits_and_losses_of_the_own_model_are_those_of_its_file():
    robot, basis = read(), derive_basis(read())
    assert robot.mass == pytest.approx(6.7 + 4 * (0.6 + 0.8 + 0.15 + 0.05))
    assert basis.stiffness * 0.003 * 4 == pytest.approx(basis.mass * GRAVITY)
    assert_allclose(robot.torque_limits, [30.0, 30.0, 40.0])
    assert_allclose([robot.armature, robot.damping, robot.friction], np.outer([0.01, 0.5, 0.2], np.ones(3)))
    assert_allclose(robot.links, [0.2, np.hypot(0.21, 0.005)])
    assert_allclose(robot.ranges[2], [[-0.9, 0.9], [-1.5, 3.5], [-2.7, -0.5]])
    assert_allclose(robot.feet_at_zero[2], [-0.175, 0.13, -0.42])


LIMITS = [
    ('<motor ctrlrange="-40 40"/>', '<motor ctrlrange="-40 40" gear="2"/>', [30.0, 30.0, 80.0]),
    ('<motor ctrlrange="-40 40"/>', '<motor ctrlrange="-40 40" forcerange="-7 9" gear="2"/>', [30.0, 30.0, 14.0]),
    ('range="-2.7 -0.5"', 'range="-2.7 -0.5" actuatorfrcrange="-5 6"', [30.0, 30.0, 5.0]),
    ('<motor name="RL_calf" class="calf"', '<position name="RL_calf" kp="3" ctrlrange="-1 1"', [30.0, 30.0, 40.0]),
    ('<motor ctrlrange="-30 30"/>', "<motor/>", [np.inf, np.inf, 40.0]),
]


@pytest.mark.ci
@pytest.mark.parametrize(("old", "new", "limits"), LIMITS)
def test_the_least_limit_of_actuator_and_joint_counts(tmp_path, old, new, limits):
    assert_allclose(read(change(tmp_path, old, new)).torque_limits, limits)


SAME = [
    ('mass="6"', 'mass="6.00"'),
    ("<freejoint/>", '<freejoint/><body name="camera"><site name="lens"/></body>'),
    ('name="trunk" pos="0 0 0.32"', 'name="body of it" pos="0 0 1"'),
]
OTHER = [
    ('mass="6"', 'mass="6.001"'),
    ('armature="0.01"', 'armature="0.0101"'),
    ('<joint armature="0.01"', '<joint armature="0.01" stiffness="1"'),
    ('class="foot" pos="0.005 0 -0.21"', 'class="foot" pos="0.005 0 -0.2101"'),
]


@pytest.mark.ci
@pytest.mark.parametrize(("old", "new"), [*SAME, *OTHER])
def test_a_fingerprint_is_that_of_what_moves(tmp_path, old, new):
    same = read(change(tmp_path, old, new)).fingerprint == read().fingerprint
    assert same == ((old, new) in SAME)
