"""Replay and identification: derivatives, the truth of simulated logs, learners as laws, what a log does not show."""

from dataclasses import replace

import numpy as np
import pytest
from support.logs import COULOMB, DELAY, ROTORS, VISCOUS, make_problem, simulate_log

from cmacexp.addons.gap.identify import LEVELS, fit, regress
from cmacexp.addons.gap.learners import Both, Fixed, Iterative, predict_all
from cmacexp.addons.gap.replay import Expansion, JointParams, make_drive, replay
from cmacexp.addons.gap.signals import Signals, measure_lag


def replay_two(values, delay=0.0062, rows=60, derive=False):
    """Two joints that move each other and stick at times."""
    time = np.arange(rows) * 0.005
    mass = np.tile([[0.06, 0.02], [0.02, 0.05]], (rows, 1, 1))
    angle = np.sin(6.0 * time[:, None] + [0.0, 1.0])
    expansion = Expansion(angle, mass, 0.5 * np.cos(angle), np.tile([[0.3, 0.1], [0.1, 0.2]], (rows, 1, 1)))
    drive = make_drive(1.2 * angle, 0.0 * angle, 0.1 * angle, np.array([20.0, 15.0]), np.array([0.5, 0.4]))
    params = JointParams(values, np.array([[-1.0, -1.0], [1.0, 1.0]]), delay)
    return replay(expansion, drive, params, 0.005, (angle[0], np.zeros(2)), derive=derive)


def test_derivatives_of_a_replay_are_those_of_differences():
    values = np.array([[0.01, 0.2, 0.05, 0.1, 0.9, 0.3, 0.5], [0.02, 0.1, -0.05, -0.1, 0.4, 0.6, 0.2]])
    found, step = replay_two(values, derive=True), 1e-6
    assert (found.velocity == 0.0).any()  # a joint that sticks
    for k in range(values.size):
        ends = [values.copy(), values.copy()]
        ends[0].flat[k] += step
        ends[1].flat[k] -= step
        slope = (replay_two(ends[0]).angle - replay_two(ends[1]).angle) / (2.0 * step)
        np.testing.assert_allclose(found.angle_by[:, :, k], slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max() + 1e-8)
    slope = (replay_two(values, 0.0062 + step).angle - replay_two(values, 0.0062 - step).angle) / (2.0 * step)
    np.testing.assert_allclose(found.angle_by[:, :, -1], slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max())


def test_a_regression_of_a_log_finds_the_joints_that_made_it():
    problem = make_problem(simulate_log(delay=0.0))
    values = regress(problem, LEVELS[0], np.ones(len(problem.signals.log.time), dtype=bool))
    np.testing.assert_allclose(values[:, 0], ROTORS, rtol=0.3)
    np.testing.assert_allclose(values[:, 4], COULOMB, rtol=0.1)


def test_lag_is_that_of_a_shifted_command():
    log = simulate_log()
    shifted = replace(log, angle=np.roll(log.command, 7, axis=0))
    np.testing.assert_allclose(measure_lag(Signals(shifted))[1:], 0.07, atol=1e-3)


def test_strokes_of_a_log_follow_its_turns_and_other_motions_are_cut_evenly():
    log = simulate_log()
    signals = Signals(log)
    assert signals.repeats
    assert signals.fastest == signals.count
    assert (np.diff(signals.periods) < 0.0).all()
    drift = replace(log, command=np.cumsum(np.ones_like(log.command), axis=0))
    assert not Signals(drift).repeats


def test_learning_repeats_what_repeats_and_a_known_torque_is_not_learnt_again():
    signals = Signals(simulate_log())
    wave = np.sin(2.0 * np.pi * signals.phase)[:, None] * [1.0, 2.0]
    object.__setattr__(signals, "torque", wave)  # the cached property
    inside = slice(int(signals.bounds[1]), int(signals.bounds[-1]))
    np.testing.assert_allclose(predict_all(Iterative(signals), signals)[inside], wave[inside], atol=2e-2)
    known = Both(Fixed(wave), Iterative(signals))
    np.testing.assert_allclose(predict_all(known, signals)[inside], wave[inside], atol=1e-12)
    assert not predict_all(Iterative(signals), signals, last=0).any(), "frozen before the first stroke"


@pytest.mark.ci
def test_a_fit_finds_the_joints_and_the_delay(compiled):
    problem = make_problem(simulate_log(parts=50))
    found = fit(problem, LEVELS[0], np.arange(len(problem.signals.log.time)) >= 20)
    np.testing.assert_allclose(found.values[:, [0, 1, 4]].T, [ROTORS, VISCOUS, COULOMB], rtol=0.02)
    assert found.delay == pytest.approx(DELAY, abs=2e-4)


@pytest.mark.nightly
def test_parameters_and_delay_lie_in_their_intervals_in_95_percent_of_100_draws(compiled):
    truth, inside = np.column_stack([ROTORS, VISCOUS, COULOMB]), []
    for seed in range(100):
        log = simulate_log(noise=1e-3, seed=seed, parts=100)
        problem = make_problem(log)
        found = fit(problem, LEVELS[0], np.arange(len(log.time)) >= 20)
        inside += (np.abs(found.values[:, [0, 1, 4]] - truth) < 1.96 * found.deviation[:, [0, 1, 4]]).ravel().tolist()
        inside.append(abs(found.delay - DELAY) < 1.96 * found.delay_deviation)
    assert np.mean(inside) > 0.93
