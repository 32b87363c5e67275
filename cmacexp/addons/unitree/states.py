"""What a LowState says of a robot, and the limits beyond which a run on it stops."""

import math
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.unitree.messages import Message, get_motors
from cmacexp.config import number
from cmacexp.config.machine import LEG_NAMES
from cmacexp.errors import Diverged
from cmacexp.protocols import RobotSignals
from cmacexp.typing import Array

STILL = 25
"""States in a row with the same angle of a joint, after which its encoder is stuck if it was to move."""
LEAST_MOVE = 0.02
"""Change of the commanded angle that says so, rad."""
UNIT = 0.1
"""Largest difference of the square of a quaternion from 1: an inertial unit that is off gives zeros."""
LONG = 250
"""States in a row after which it is stuck whatever it was to do, if most joints move."""
FAR = 10
"""States in a row for which a joint may be far from its command."""
WINDOW = 500
"""States over which those that are lost are counted."""


class Unsafe(Diverged):
    """The robot, or the wire to it, is beyond a limit: it is damped, and the run ends.

    The ``trouble`` has places for ``values``, which are written only when it is raised: a state is checked in every
    step.
    """

    def __init__(self, trouble: str, *values: object):
        super().__init__(trouble.format(*values))


class Reading(NamedTuple):
    """One LowState, for L legs with J joints."""

    signals: RobotSignals
    """What sensors of a robot take: its yaw is that of the inertial unit, torques are as the motors estimate them."""
    temperature: float
    """Temperature of the hottest motor, degrees Celsius."""
    voltage: float
    """V."""
    lost: int
    """Packets that the buses of all motors have lost so far."""


def read_state(message: Message) -> Reading:
    """The reading of a LowState."""
    imu, motors = message["imu_state"], message["motor_state"]
    w, x, y, z = imu["quaternion"].tolist()
    is_turn = abs(w * w + x * x + y * y + z * z - 1.0) < UNIT
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x)))) if is_turn else math.nan
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    signals = RobotSignals(
        q=get_motors(motors["q"]),
        dq=get_motors(motors["dq"]),
        torque=get_motors(motors["tau_est"]),
        attitude=np.array([pitch, roll, yaw]),
        gyroscope=imu["gyroscope"].astype(float),
        accelerometer=imu["accelerometer"].astype(float),
        tick=np.array([float(message["tick"])]),
    )
    temperature, voltage = float(motors["temperature"].max()), float(message["power_v"])
    return Reading(signals, temperature, voltage, int(motors["lost"].sum()))


@dataclass(kw_only=True)
class LimitsConfig:
    """What ends a run on a robot."""

    silence: float = number("s", above=0, at_most=10)
    """Longest time from one state to the next."""
    lost: float = number("", at_least=0, at_most=1)
    """Largest share of states, or of packets to the motors, that may be lost within WINDOW states; 1: all of them,
    and ticks need not grow, as those of a simulator that does not count its states."""
    tilt: float = number("rad", above=0, at_most=3)
    """Largest pitch and roll."""
    speed: float = number("rad/s", above=0, at_most=100)
    """Largest velocity of a joint."""
    deviation: float = number("rad", above=0, at_most=3)
    """Largest difference of a joint from its command, for FAR states."""
    torque: float = number("N m", above=0, at_most=1000)
    """Largest torque that a motor is asked for, drive included; it is held there, and the run goes on."""
    temperature: float = number("degrees Celsius", above=0, at_most=150)
    """Temperature of the hottest motor."""
    voltage: float = number("V", at_least=0, at_most=100)
    """Least voltage of the battery."""


class StateWatch:
    """Compares every state with the limits, and with the states before it."""

    def __init__(self, limits: LimitsConfig, joints: tuple[int, int], tick: int):
        """Joints are (L, J); ``tick`` is by how much the counter of a state is larger than that of the one before."""
        self.limits, self.tick = limits, tick
        self.missed = 0
        """States that have not arrived, so far."""
        self._last: Reading | None = None
        self._lost = deque[int](maxlen=WINDOW)
        self._far = np.zeros(joints, dtype=int)
        self._still = np.zeros(joints, dtype=int)
        self._asked = np.zeros(joints)
        """Commanded angles when each joint last moved, rad."""

    def check(self, reading: Reading, asked: Array) -> None:
        """Compare a state with the limits; ``asked`` are the commanded angles (L, J), rad. Raises Unsafe."""
        limits, last, signals = self.limits, self._last, reading.signals
        is_finite = all(np.isfinite(values).all() for values in (*signals, reading.voltage))
        Unsafe.unless(is_finite, "a state has a number that is not finite, or no attitude")
        tilt, speed = np.abs(signals.attitude[:2]).max(), np.abs(signals.dq).max()
        for name, value, limit, unit in (
            ("tilt", tilt, limits.tilt, "rad"),
            ("speed", speed, limits.speed, "rad/s"),
            ("temperature", reading.temperature, limits.temperature, "degrees Celsius"),
        ):
            trouble = "{} of {:.3g} {} is above plant.limits.{}={:g}"
            Unsafe.unless(value <= limit, trouble, name, value, unit, name, limit)
        Unsafe.unless(
            reading.voltage >= limits.voltage,
            "voltage of {:.3g} V is below plant.limits.voltage={:g}",
            reading.voltage,
            limits.voltage,
        )
        off = np.abs(asked - signals.q)
        self._far = np.where(off > limits.deviation, self._far + 1, 0)
        Unsafe.unless(
            (self._far <= FAR).all(),
            "{} is {:.2g} rad from its command, beyond plant.limits.deviation={:g}",
            _largest(self._far),
            off.max(),
            limits.deviation,
        )
        if last is not None:
            self._compare(reading, last, asked)
        else:
            self._asked[...] = asked
        self._last = reading

    def _compare(self, reading: Reading, last: Reading, asked: Array) -> None:
        """Find lost and frozen states, and stuck encoders; raises Unsafe."""
        tick, before = (int(each.signals.tick[0]) for each in (reading, last))
        passed = (tick - before) / self.tick
        Unsafe.unless(
            passed > 0 or self.limits.lost >= 1.0,
            "states are frozen, or from another sender: tick {} follows {}; with a simulator that does not count its "
            "states set plant.limits.lost=1",
            tick,
            before,
        )
        gap = max(0, round(passed) - 1)
        self.missed += gap
        self._lost.append(max(gap, reading.lost - last.lost))
        share = sum(self._lost) / WINDOW
        Unsafe.unless(
            share <= self.limits.lost,
            "{:.2g} % of packets lost within {} states: plant.limits.lost={:g}",
            100 * share,
            WINDOW,
            self.limits.lost,
        )
        moved = reading.signals.q != last.signals.q
        self._still = np.where(moved, 0, self._still + 1)
        self._asked = np.where(moved, asked, self._asked)
        asleep = (self._still >= LONG) & (np.median(self._still) < STILL)
        stuck = asleep | ((self._still >= STILL) & (np.abs(asked - self._asked) > LEAST_MOVE))
        states = (self._still * stuck).max()
        trouble = "the encoder of {} is stuck: the same angle in {} states"
        Unsafe.unless(not stuck.any(), trouble, _largest(stuck), states)


def name_joint(leg: int, joint: int) -> str:
    """The leg and joint of these numbers, from 0."""
    return f"{LEG_NAMES[leg]} {('hip', 'thigh', 'calf')[joint]}"


def _largest(values: NDArray[Any]) -> str:
    """The leg and joint of the largest of values (L, J)."""
    return name_joint(*divmod(int(np.argmax(values)), values.shape[1]))
