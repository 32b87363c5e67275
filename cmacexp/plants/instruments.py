"""Proprioceptive measurements of a robot, as plants simulate them: encoders, motor torques and inertial unit."""

from typing import NamedTuple

import numpy as np

from cmacexp.jit.compiler import copy_array, kernel
from cmacexp.models.leg import GRAVITY
from cmacexp.plants.drives import Drives
from cmacexp.plants.kernels import PlantState
from cmacexp.plants.touch import Vector
from cmacexp.protocols import RobotSignals
from cmacexp.typing import Array, State


class Instruments(NamedTuple):
    """Signals of a robot, with the data needed to measure them."""

    signals: RobotSignals
    period: float
    """Sampling period, s."""
    velocity: State
    """(3,): velocity of the body in the world at the last measurement, m/s."""


def new_instruments(legs: int, joints: int, period: float) -> Instruments:
    """Make the instruments of ``legs`` legs with ``joints`` joints each before their first measurement.

    ``period`` is the sampling period, s.
    """
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
    """Measure a ``machine`` at world pose ``travel`` (3,) whose motors held ``torque`` (L, J), N m; fill the signals.

    ``rotation`` (9,) rotates vectors from body axes to the world; ``spin`` (3,), rad/s, is the angular velocity in
    body axes, ``velocity`` (3,), m/s, that of the body in the world.
    """
    if instruments is not None and travel is not None:
        signals = instruments.signals
        before = instruments.velocity
        copy_array(machine.q, signals.q)
        copy_array(machine.dq, signals.dq)
        copy_array(torque, signals.torque)
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
    """Measure the torques of ``drives``, averaged over the last sampling period; fill the signals."""
    if instruments is not None and drives is not None:
        torque = instruments.signals.torque
        np.add(drives.acted[0], drives.acted[1], torque)
        torque += drives.acted[2]
