"""What a robot measures by itself, as kernels: encoders, torques of motors, an inertial unit; no place or force."""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import kernel
from cmacexp.models.leg import GRAVITY
from cmacexp.plants.drives import Drives
from cmacexp.plants.kernels import PlantState
from cmacexp.plants.touch import Vector
from cmacexp.typing import Array, Clock, State


class RobotSignals(NamedTuple):
    """What plants give to sensors of a robot of L legs with J joints, at the start of a step, without imperfections.

    The frame of the inertial unit is that of the body: x forward, y left, z up.
    """

    q: State
    """(L, J): joint angles, rad."""
    dq: State
    """(L, J): joint velocities, rad/s."""
    torque: State
    """(L, J): torque that the motors held over the last sampling period, N m."""
    attitude: State
    """(3,): pitch, roll and yaw, rad, signs as those of a body."""
    gyroscope: State
    """(3,): angular velocity about the axes of the body, rad/s."""
    accelerometer: State
    """(3,): mean acceleration of the body over the last sampling period, less gravity, along its axes, m/s^2."""
    tick: Clock
    """(1,): number of sampling periods since the start."""


class Instruments(NamedTuple):
    """Signals, and what it takes to measure them."""

    signals: RobotSignals
    period: float
    """Of sampling, s."""
    velocity: State
    """(3,): of the body in the world at the last measurement, m/s."""


def new_instruments(legs: int, joints: int, period: float) -> Instruments:
    """Instruments of ``legs`` legs with ``joints`` joints each before their first measurement; ``period`` in s."""
    signals = RobotSignals._make((*np.zeros((3, legs, joints)), *np.zeros((3, 3)), np.zeros(1)))
    return Instruments(signals, period, np.zeros(3))


@kernel
def read_instruments(
    instruments: Instruments | None,
    machine: PlantState,
    torque: Array,
    travel: Array | None,
    rotation: Array,
    spin: Array,
    velocity: Vector,
) -> None:
    """Measure a ``machine`` at ``travel`` (3,) whose motors held ``torque`` (L, J), N m; fills signals.

    ``rotation`` (9,) turns vectors of its body into the world; ``spin`` (3,), rad/s, is along the axes of the body,
    ``velocity`` (3,), m/s, along those of the world.
    """
    if instruments is not None and travel is not None:
        signals = instruments.signals
        before = instruments.velocity
        for i in range(torque.shape[0]):
            for j in range(torque.shape[1]):
                signals.q[i, j] = machine.q[i, j]
                signals.dq[i, j] = machine.dq[i, j]
                signals.torque[i, j] = torque[i, j]
        signals.attitude[0] = machine.body[1]
        signals.attitude[1] = machine.body[2]
        signals.attitude[2] = travel[2]
        x = (velocity[0] - before[0]) / instruments.period
        y = (velocity[1] - before[1]) / instruments.period
        z = (velocity[2] - before[2]) / instruments.period + GRAVITY
        for n in range(3):
            before[n] = velocity[n]
            signals.gyroscope[n] = spin[n]
            signals.accelerometer[n] = rotation[n] * x + rotation[n + 3] * y + rotation[n + 6] * z
        signals.tick[0] += 1.0


@kernel
def read_drives(instruments: Instruments | None, drives: Drives | None) -> None:
    """Measure the torques of ``drives``, their means over the last sampling period; fills signals."""
    if instruments is not None and drives is not None:
        torque = instruments.signals.torque
        for i in range(torque.shape[0]):
            for j in range(torque.shape[1]):
                torque[i, j] = drives.acted[0, i, j] + drives.acted[1, i, j] + drives.acted[2, i, j]
