"""The protocol of plants, and what they return: a measurement, and the signals that a robot measures by itself.

Those signals are of encoders, of motors, and of an inertial unit; no place and no force.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from cmacexp.jit.compiler import copy_array, kernel
from cmacexp.models.leg import GRAVITY
from cmacexp.planning.plan import Setup
from cmacexp.plants.drives import Drives
from cmacexp.plants.kernels import PlantState
from cmacexp.plants.touch import Vector
from cmacexp.typing import Array, Clock, State, Status


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
    """Sampling period, s."""
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
    """Measure the torques of ``drives``, their means over the last sampling period; fills signals."""
    if instruments is not None and drives is not None:
        torque = instruments.signals.torque
        np.add(drives.acted[0], drives.acted[1], torque)
        torque += drives.acted[2]


class Measurement(NamedTuple):
    """State of a machine at the start of a step, of L legs with J joints each, whose feet move along J axes."""

    q: Array
    """(L, J): joint angles, rad; of a point mass its position, m."""
    dq: Array
    """(L, J): joint velocities, rad/s."""
    foot: Array
    """(L, J): foot in the frame of its hip, x forward, y down, where J = 3 z to the left, m."""
    velocity: Array
    """(L, J): of the foot in the frame of its hip, m/s."""
    force: Array
    """(L,): contact force, N, positive pressing on the ground."""
    body: Array
    """(3,): height of the body above the undepressed ground, m; pitch and roll, rad."""
    body_rate: Array
    """(3,): rates of height, m/s, of pitch and roll, rad/s; zero without a body."""
    travel: Array | None = None
    """(3,): position in the world of a body that the plant moves, x and y, m, and its yaw, rad, positive to the left;
    None if the body moves as planned."""
    signals: RobotSignals | None = None
    """What a robot measures by itself; None of plants that do not give it."""


STATE = Measurement._fields[:7]
"""Fields that every plant measures; only a plant that moves the body measures its travel, that of a robot signals."""


def get_state(state: tuple[Any, ...]) -> tuple[Array, ...]:
    """The arrays, with their shapes and units, in the order of STATE of a state whose first fields are these."""
    return state[: len(STATE)]


def view_state(state: tuple[Any, ...], travel: Array | None = None) -> Measurement:
    """A measurement of the arrays of ``state`` that STATE names, and of ``travel`` (3,), m and rad, themselves."""
    return Measurement._make((*get_state(state), travel, None))


def copy_state(state: Any, travel: Array | None = None, signals: RobotSignals | None = None) -> Measurement:
    """A measurement of copies of what :func:`view_state` has, ``travel`` (3,), m and rad, too, and of ``signals``."""
    own_signals = None if signals is None else RobotSignals(*map(np.ndarray.copy, signals))
    own_travel = None if travel is None else travel.copy()
    return Measurement._make((*map(np.ndarray.copy, get_state(state)), own_travel, own_signals))


def new_measurement(legs: int, axes: int = 2) -> Measurement:
    """A measurement of zeros of ``legs`` legs."""
    return Measurement._make((*np.zeros((4, legs, axes)), np.zeros(legs), *np.zeros((2, 3)), None, None))


class Plant(Protocol):
    """A machine on its ground.

    A plant that is not simulated also has ``end_run(is_safe)``: it comes to rest, however the run has ended, and only
    then files are written. It may have

    - ``describe()``, an entry of the manifest,
    - ``list_steps(start, stop)``: LIVE_SIGNALS of the body's trace, (stop - start,) by name,
    - ``takes_drives = True``: then ``step(torque, drive)`` also gets the
      :class:`cmacexp.control.protocol.Drive` of a controller that sends drives.
    """

    def reset(self, setup: Setup) -> Measurement:
        """Put the machine at the start of the plan and measure it."""
        ...

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (L, J), N m, over one sampling period; measure the state after it.

        Raises:
            Diverged: the engine of the plant reports that it has diverged (:class:`cmacexp.errors.Diverged`).
        """
        ...


def is_live(plant: Any) -> bool:
    """Whether a plant is not simulated: it has an ``end_run(is_safe)``."""
    return hasattr(plant, "end_run")


def lists_steps(plant: Any) -> bool:
    """Check whether a plant gives LIVE_SIGNALS: it has a ``list_steps(start, stop)``."""
    return hasattr(plant, "list_steps")


def come_to_rest(plant: Any, status: str) -> None:
    """Let a plant that is not simulated come to rest.

    It is safe if the walk has completed, or the user has interrupted it. Else a component has failed, the machine
    fell, or a limit was passed.
    """
    if is_live(plant):
        plant.end_run(status in (Status.COMPLETED, Status.INTERRUPTED))
