"""A loop stepped from outside: the bits of a run, a start to return to, and the Gymnasium environment."""

import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from support.doors import BadInput, CmacexpError, compose_config, make_scenario, roll_out
from support.robots import needs_models

import cmacexp

NOISY = ("sensors=real", "sensors.force.noise=0.1", "sensors.position.delay=1")
LEG = ["scenario=one_leg", "gait.cycle_time=0.2", "gait.lift=0.005", "cycles=2"]
"""A cycle of 40 samples."""
RUNS = {
    "leg": LEG,
    "leg, noisy and late": [*LEG, *NOISY, "actuator.delay=2", "actuator.lag=0.004", "seed=7"],
    "quadruped that falls": ["scenario=quadruped", "gait.cycle_time=0.2", "gait.lift=0.005", "cycles=3"],
    "leg in MuJoCo": [*LEG, "plant=mujoco_leg"],
    "robot that adapts": ["scenario=robot", "cycles=2", "plant.mass_factor=1.2", "gait.cycle_time=0.4"],
}


def play(loop, torque=0.0, steps=10**9):
    """Step to the end, or so many steps; states and feedback of every step, and the last moment."""
    rows, moment = [], loop.moment
    while moment.status == "running" and len(rows) < steps:
        body = moment.state.body if loop.shape[0] > 1 else []
        before = np.concatenate([moment.state.q.ravel(), moment.state.force, body])
        moment = loop.step(np.full(loop.shape, torque))
        rows.append(np.append(before, moment.feedback))
    return np.array(rows), moment


def reference_run(overrides):
    run = roll_out(make_scenario(compose_config([*overrides, "feedforward=none"])))
    columns, body = run.columns(), run.body_columns()
    joints = range(1, 4 if "q3" in columns else 3)
    q, feedback = (np.stack([columns[f"{name}{j}"] for j in joints], axis=2) for name in ("q", "tau_feedback_"))
    tilt = [body[name][:, None] for name in ("height", "pitch", "roll") if body]
    parts = q.reshape(len(q), -1), columns["force"], *tilt, feedback.reshape(len(q), -1)
    return run, np.concatenate(parts, axis=1)


@pytest.mark.parametrize(
    "name",
    [*[*RUNS][:3], pytest.param("leg in MuJoCo", marks=pytest.mark.ci),
     pytest.param("robot that adapts", marks=[pytest.mark.ci, needs_models])],
)  # fmt: skip
def test_without_torque_it_has_the_bits_of_a_run_and_so_it_has_after_a_return(name):
    run, wanted = reference_run(RUNS[name])
    loop = cmacexp.open_loop(RUNS[name])
    play(loop, 0.01, steps=loop.period + 30)  # what it leaves behind must not show
    assert loop.reset().step == 0
    rows, end = play(loop)
    assert (end.status, end.cause, end.step) == (run.status, run.cause, run.steps)
    assert rows.tobytes() == wanted.tobytes()


def test_another_seed_gives_other_bits_until_the_first_one_returns():
    loop, found = cmacexp.open_loop([*LEG, *NOISY]), []
    for seed in (7, 8, 7):
        loop.reset(seed)
        found.append(play(loop)[0].tobytes())
    assert found[0] == found[2] != found[1]
    assert found[0] == reference_run([*LEG, *NOISY, "seed=7"])[1].tobytes()


def test_what_a_user_writes_into_a_plan_does_not_reach_the_next_run():
    desired = cmacexp.open_loop(LEG).setup.plan.desired.position
    before, desired[...] = desired.copy(), 0.0
    assert_array_equal(cmacexp.open_loop(LEG).setup.plan.desired.position, before)


def test_the_torque_acts_teaches_and_ends_the_loop_when_it_diverges():
    loop = cmacexp.open_loop(LEG)
    still, _ = play(loop)
    loop.reset()
    moved, _ = play(loop, 0.05)
    assert_array_equal(moved[0, :2], still[0, :2])
    assert (moved[1, :2] != still[1, :2]).any()
    assert loop.moment.learning_error.any()
    loop.reset()
    _, end = play(loop, 1e5)
    assert end.status == "diverged"
    assert f"step {end.step} " in end.cause
    with pytest.raises(CmacexpError):
        loop.step(np.zeros(loop.shape))
    loop.reset()
    assert play(loop)[1].status == "completed"


def test_what_steps_it_takes_the_place_of_a_feedforward_and_gives_a_torque_that_fits():
    loop = cmacexp.open_loop(LEG)
    for torque in (np.zeros(2), np.full((1, 2), np.nan)):
        with pytest.raises(CmacexpError, match="shape"):
            loop.step(torque)
    assert loop.moment.step == 0
    with pytest.raises(BadInput, match="feedforward=cmac"):
        cmacexp.open_loop([*LEG, "feedforward=cmac"])
    with pytest.warns(UserWarning, match=r"cmac\.layers"):
        cmacexp.open_loop([*LEG, "cmac.layers=8"])


def make_env(*overrides):
    return cmacexp.gym.make("one_leg", [*LEG[1:], *overrides])


@pytest.mark.parametrize("overrides", [(), NOISY], ids=str)
def test_gymnasium_finds_nothing_wrong(overrides, recwarn):
    import gymnasium

    env = gymnasium.make("cmacexp.gym:cmacexp/OneLeg-v0", overrides=[*LEG[1:], *overrides]).unwrapped
    from gymnasium.utils.env_checker import check_env

    check_env(env)  # draws, too
    assert not recwarn.list
    assert len(env.names) == len(set(env.names)) == len(env.reset(seed=0)[0])
    assert (env.action_space.high.tolist(), env.action_space.dtype) == ([1.0, 1.0], np.float32)
    in_newtons = make_env(*overrides)
    in_newtons.reset(seed=0)
    assert_array_equal(env.step(np.array([0.5, -2.0]))[0], in_newtons.step(env.action_scale * [0.5, -1.0])[0])


def test_a_copy_of_an_environment_goes_on_with_the_same_bits():
    env, torque, found = make_env(*NOISY), np.full(2, 0.05), []
    env.reset(seed=3)
    for _ in range(50):  # more than a cycle
        env.step(torque)
    for each in (copy.copy(env), copy.deepcopy(env), pickle.loads(pickle.dumps(env)), env):
        steps = [each.step(torque)[0].tobytes() for _ in range(20)]
        found.append([*steps, each.reset()[0].tobytes()])
    assert found[0] == found[1] == found[2]


def play_env(env, action, **start):
    """Observations and rewards of an episode, and how it ended."""
    found, ends = [(env.reset(**start)[0], 0.0)], (False, False)
    while not any(ends):
        observation, reward, *ends, _ = env.step(action)
        found.append((observation, reward))
    observations, rewards = zip(*found, strict=True)
    return np.array(observations), np.array(rewards[1:]), tuple(ends)


def test_an_episode_without_action_is_a_run_of_feedback_only_with_its_seed():
    env = make_env(*NOISY)
    observations, rewards, ends = play_env(env, np.zeros(2), seed=3)
    run, _ = reference_run([*LEG, *NOISY, "seed=3"])
    columns, plan = run.columns(), run.plan
    for name, column in {"leg_1.force": "force_measured", "leg_1.x": "x_measured", "leg_1.q1": "q1_measured"}.items():
        assert_array_equal(observations[:-1, env.names.index(name)], columns[column][:, 0])
    assert ends == (False, True)
    for k in range(1, 40):
        off = [columns[name][k, 0] - plan.desired.position[k, 0, j] for j, name in enumerate("xy")]
        force = (columns["force"][k, 0] - plan.force_desired[k, 0]) / plan.force_desired.max()
        cost = off[0] ** 2 / 0.01**2 + (force**2 if plan.support[k, 0] else off[1] ** 2 / 0.01**2)
        assert rewards[k - 1] == pytest.approx(-min(cost, 10.0), rel=1e-12)
    other, again = (play_env(env, np.zeros(2), **start)[0] for start in ({}, {"seed": 3}))
    assert (other != observations).any()
    assert_array_equal(again, observations)


def test_whoever_makes_it_fall_pays_for_all_steps_that_are_left():
    env = make_env()
    env.action_space = type(env.action_space)(-1e5, 1e5, (2,), dtype=np.float64)
    observations, rewards, ends = play_env(env, np.full(2, 1e5), seed=0)
    assert ends == (True, False)
    assert np.isfinite(observations).all()
    assert rewards.min() == rewards[-1] == -10.0 * (80 - len(rewards) + 1)
