"""Readings of LowState, and the limits at which a run on a robot stops."""

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
"""Consecutive states with the same angle of a joint after which its encoder is stuck, if its command has changed."""
LEAST_MOVE = 0.02
"""Least change of the commanded angle for that conclusion, rad."""
UNIT = 0.1
"""Tolerance of the squared norm of a quaternion: an inertial unit without power gives zeros."""
LONG = 250
"""Consecutive states after which it is stuck whatever its command, if most joints move."""
FAR = 10
"""Consecutive states for which a joint may be far from its command."""
FAST = 5
"""Consecutive states in which a joint is faster than its limit: a foot that hits the ground is so in one or two."""
LOSS_WINDOW = 500
"""Number of states over which gaps are counted."""
LEAP = 0.1
"""Largest difference of an angle from what the velocities before and after explain, rad."""
STOP = ((2, 1 << 5), (3, 1 << 1))
"""Byte and bit of the buttons L2 and B in ``wireless_remote``: together the emergency stop of Unitree's programs."""


class Unsafe(Diverged):
    """The robot, or the wire to it, is beyond a limit: it is damped, and the run ends.

    ``trouble`` is a format string for ``values``; it is formatted only when the error is raised, since states are
    checked in every step.
    """

    def __init__(self, trouble: str, *values: object):
        super().__init__(trouble.format(*values))


class Reading(NamedTuple):
    """The content of one LowState, for L legs with J joints."""

    signals: RobotSignals
    """Sensor signals; the yaw is that of the inertial unit, torques are estimates of the motors."""
    temperature: float
    """Temperature of the hottest motor, degrees Celsius."""
    voltage: float
    """Voltage of the battery, V."""
    lost: int
    """Number of packets that the buses of all motors have lost so far."""
    stop: bool
    """True while L2 and B of the remote control are pressed."""


def read_state(message: Message) -> Reading:
    """Return the reading of a LowState; its pitch is NaN if the quaternion is not a unit one."""
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
    remote = message["wireless_remote"]
    return Reading(
        signals,
        temperature=float(motors["temperature"].max()),
        voltage=float(message["power_v"]),
        lost=int(motors["lost"].sum()),
        stop=all(remote[byte] & bit for byte, bit in STOP),
    )


@dataclass(kw_only=True)
class LimitsConfig:
    """Limits at which a run on a robot ends."""

    silence: float = number("s", above=0, at_most=10)
    """Longest time from one state to the next, and, beyond ``plant.guardian``, from one command to the next."""
    lost: float = number("", at_least=0, at_most=1)
    """Largest share of LOSS_WINDOW states before which others, or packets to the motors, were lost. 1: no limit, and
    ticks need not grow, for a simulator that does not count its states."""
    tilt: float = number("rad", above=0, at_most=3)
    """Largest pitch and roll."""
    speed: float = number("rad/s", above=0, at_most=100)
    """Largest velocity of a joint that may last for FAST states; in one state twice as much."""
    deviation: float = number("rad", above=0, at_most=3)
    """Largest difference of a joint angle from its command that may last for FAR states."""
    torque: float = number("N m", above=0, at_most=1000)
    """Largest commanded torque of a motor, alone and with its feedback; the run continues at the limit."""
    stiffness: float = number("N m/rad", above=0, at_most=1000)
    """Largest stiffness that may be commanded."""
    damping: float = number("N m s/rad", above=0, at_most=100)
    """Largest damping that may be commanded."""
    temperature: float = number("degrees Celsius", above=0, at_most=150)
    """Largest temperature of a motor."""
    voltage: float = number("V", at_least=0, at_most=100)
    """Least voltage of the battery."""
    overvoltage: float = number("V", above=0, at_most=1000)
    """Largest voltage of the battery; a larger robot has more."""


class StateWatch:
    """Monitor that compares every state with the limits and with earlier states."""

    def __init__(self, limits: LimitsConfig, joints: tuple[int, int], tick: int):
        """Watch L legs with J ``joints`` (L, J); ``tick`` is the increment of the counter from state to state."""
        self.limits = limits
        self.tick = tick
        self.missed = 0
        """Number of states that have not arrived so far."""
        self._last: Reading | None = None
        self._lost = deque[bool](maxlen=LOSS_WINDOW)
        self._far = np.zeros(joints, dtype=int)
        self._speeds = deque([np.zeros(joints)] * FAST, maxlen=FAST)
        self._still = np.zeros(joints, dtype=int)
        self._commanded = np.zeros(joints)
        """Commanded angles when each joint last moved, rad."""

    def find_leap(self, reading: Reading, elapsed: float, period: float) -> str:
        """Return the trouble of a state in which an angle has moved as no velocity explains; empty: none.

        It arrived ``elapsed`` seconds after the last one. A robot that stood still meanwhile, as a simulator on a
        busy computer does, moved for a sampling ``period`` only.
        """
        if self._last is None:
            return ""
        before, now = self._last.signals, reading.signals
        moves = np.stack([rate * time for rate in (before.dq, now.dq) for time in (period, max(period, elapsed))])
        off = np.abs(now.q - np.clip(now.q, before.q + moves.min(axis=0), before.q + moves.max(axis=0)))
        if not off.max() > LEAP:
            return ""
        return f"the angle of {_largest(off)} leaps by {off.max():.2g} rad more than its velocity explains"

    def repeats(self, reading: Reading) -> bool:
        """Return True if a state has the signals of the last one, except for its tick, as if no time had passed."""
        last = self._last
        return last is not None and all(map(np.array_equal, reading.signals[:-1], last.signals[:-1]))

    def check(self, reading: Reading, commanded: Array) -> None:
        """Compare a state with the limits, and with the commanded angles (L, J), rad; raise Unsafe."""
        limits = self.limits
        last = self._last
        signals = reading.signals
        is_finite = all(np.isfinite(values).all() for values in (*signals, reading.voltage))
        Unsafe.unless(is_finite, "a state has a number that is not finite, or no attitude")
        for name, value, limit, unit in (
            ("tilt", np.abs(signals.attitude[:2]).max(), limits.tilt, "rad"),
            ("speed", self._find_lasting_speed(signals.dq), limits.speed, "rad/s"),
            ("temperature", reading.temperature, limits.temperature, "degrees Celsius"),
        ):
            trouble = "{} of {:.3g} {} is above plant.limits.{}={:g}"
            Unsafe.unless(value <= limit, trouble, name, value, unit, name, limit)
        Unsafe.unless(
            limits.voltage <= reading.voltage <= limits.overvoltage,
            "voltage of {:.3g} V is not from plant.limits.voltage={:g} to overvoltage={:g}, as of a Go2",
            reading.voltage,
            limits.voltage,
            limits.overvoltage,
        )
        Unsafe.unless(not reading.stop, "the remote control asks for a stop: L2 and B are pressed")
        off = np.abs(commanded - signals.q)
        self._far = np.where(off > limits.deviation, self._far + 1, 0)
        Unsafe.unless(
            (self._far <= FAR).all(),
            "{} is {:.2g} rad from its command, beyond plant.limits.deviation={:g}",
            _largest(self._far),
            off.max(),
            limits.deviation,
        )
        if last is not None:
            self._compare(reading, last, commanded)
        else:
            self._commanded[...] = commanded
        self._last = reading

    def _find_lasting_speed(self, velocity: Array) -> float:
        """Return the largest speed of a joint in all of the last FAST states, or half of the present one, rad/s."""
        self._speeds.append(np.abs(velocity))
        return float(max(np.min(self._speeds, axis=0).max(), 0.5 * np.abs(velocity).max()))

    def _compare(self, reading: Reading, last: Reading, commanded: Array) -> None:
        """Check for lost and frozen states, and for stuck encoders; raise Unsafe."""
        tick, before = (int(state.signals.tick[0]) for state in (reading, last))
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
        self._lost.append(gap > 0 or reading.lost > last.lost)
        share = sum(self._lost) / LOSS_WINDOW
        Unsafe.unless(
            share <= self.limits.lost,
            "packets lost before {:.2g} % of {} states: plant.limits.lost={:g}",
            100 * share,
            LOSS_WINDOW,
            self.limits.lost,
        )
        moved = reading.signals.q != last.signals.q
        self._still = np.where(moved, 0, self._still + 1)
        self._commanded = np.where(moved, commanded, self._commanded)
        asleep = (self._still >= LONG) & (np.median(self._still) < STILL)
        stuck = asleep | ((self._still >= STILL) & (np.abs(commanded - self._commanded) > LEAST_MOVE))
        states = (self._still * stuck).max()
        trouble = "the encoder of {} is stuck: the same angle in {} states"
        Unsafe.unless(not stuck.any(), trouble, _largest(stuck), states)


def name_joint(leg: int, joint: int) -> str:
    """Return the name of a leg and its joint, from their numbers, which count from 0."""
    return f"{LEG_NAMES[leg]} {('hip', 'thigh', 'calf')[joint]}"


def _largest(values: NDArray[Any]) -> str:
    """Return the name of the joint with the largest of ``values`` (L, J)."""
    return name_joint(*divmod(int(np.argmax(values)), values.shape[1]))
