"""The protocol of plants, and the measurement that they return."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from cmacexp.planning.setup import Setup
from cmacexp.plants.robot_signals import RobotSignals
from cmacexp.typing import Array


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
