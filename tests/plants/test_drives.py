"""Drives with loops of their own: the command that they follow, and what they make of it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmacexp.plants.drives import (
    ANGLE,
    DAMPING,
    DRIVE,
    STIFFNESS,
    TORQUE,
    VELOCITY,
    BusConfig,
    drive_joints,
    new_drives,
    send_command,
)

PERIOD, SUBSTEPS = 0.002, 8
ONE = np.zeros((1, 1), dtype=int)


def drive(config, bus, steps=6, limit=np.inf, velocity=0.0):
    """Parts of the torque (steps, 3) and the sum of one drive whose commands have the torque 1, 2, ... N m."""
    drives = new_drives(config, bus, PERIOD, SUBSTEPS, (limit,), 1)
    parts = []
    for step in range(steps):
        drives.command[[ANGLE, VELOCITY, STIFFNESS, DAMPING]] = np.reshape([0.5, 0.0, 4.0, 1.0], (4, 1, 1))
        send_command(drives, step, np.full((1, 1), step + 1.0), np.zeros((1, 1)))
        for _ in range(SUBSTEPS):
            drive_joints(drives, ONE, ONE, np.zeros(1), np.full(1, velocity))
        parts.append(drives.acted[:, 0, 0].copy())
    return np.array(parts), drives.torque[0, 0]


@pytest.fixture(scope="module")
def actuator(make_config):
    """Of drives that do nothing late."""
    return make_config().actuator


def test_a_drive_follows_the_newest_command_that_has_arrived(actuator):
    late, _ = drive(replace(actuator, delay=2), BusConfig())
    assert_allclose(late[:, TORQUE], [1, 1, 1, 2, 3, 4])
    assert_allclose(late[:, DRIVE], 4.0 * 0.5)
    half, _ = drive(actuator, BusConfig(jitter=PERIOD, seed=3), steps=200)
    behind = np.arange(1, 201) - half[:, TORQUE]
    assert -1e-9 < behind.min() < 0.1 < 0.8 < behind.max() < 0.9  # of 0 to 7 inner steps of 8
    lost, _ = drive(actuator, BusConfig(loss=0.25, seed=1), steps=1000)
    assert 0.2 < np.mean(np.diff(lost[:, TORQUE]) == 0.0) < 0.3


def test_the_sum_is_limited_and_lags(actuator):
    parts, torque = drive(actuator, BusConfig(), limit=5.0, velocity=1.0)
    assert_allclose(parts.sum(axis=1), np.minimum(np.arange(1, 7) + 2.0 - 1.0, 5.0))
    _, torque = drive(replace(actuator, lag=10.0), BusConfig(), velocity=1.0)
    assert 0.0 < torque < 0.01 * parts.sum()
    filtered, _ = drive(actuator, BusConfig(velocity_lag=10.0), velocity=1.0)
    assert_allclose(filtered[:, DRIVE], 2.0, atol=0.01)


def swing(actuator, damping, sampled, steps=400):
    """Largest velocity, rad/s, in the last tenth of ``steps`` of a free rotor of 0.01 kg m^2 under a drive."""
    drives = new_drives(actuator, BusConfig(sampled=sampled), PERIOD, SUBSTEPS, (np.inf,), 1)
    q, dq, rates = np.zeros(1), np.ones(1), []
    zero = np.zeros((1, 1), dtype=int)
    for step in range(steps):
        drives.command[DAMPING] = damping
        send_command(drives, step, np.zeros((1, 1)), np.zeros((1, 1)))
        for _ in range(SUBSTEPS):
            drive_joints(drives, zero, zero, q, dq)
            dq += drives.torque[0] / 0.01 * PERIOD / SUBSTEPS
            q += dq * PERIOD / SUBSTEPS
        rates.append(abs(dq[0]))
    return max(rates[-steps // 10 :])


def test_a_drive_that_computes_once_a_command_shakes_from_the_damping_that_the_rule_stays_below(actuator):
    critical = 0.01 / PERIOD  # z^2 - z + D T/J: its roots leave the unit circle at 1
    assert swing(actuator, 0.9 * critical, sampled=True) < 1e-3
    assert swing(actuator, 1.1 * critical, sampled=True) > 10.0
    assert swing(actuator, 1.1 * critical, sampled=False) < 1e-3
