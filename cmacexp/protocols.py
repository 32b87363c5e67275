"""Protocols of components: required methods, optional abilities, and the data that components exchange.

A run has a plant, sensors, a controller and a feedforward. Each is an object of any class that has the methods of its
protocol. Every optional ability has a separate protocol, which the loop looks for with :func:`offers`.
"""

from inspect import get_annotations
from typing import Any, NamedTuple, Protocol, TypeGuard, TypeVar

import numpy as np

from cmacexp.planning.plan import Reference, Setup
from cmacexp.typing import Array, Clock, State, Weights

Ability = TypeVar("Ability")


def offers(component: object, ability: type[Ability]) -> TypeGuard[Ability]:
    """Return True if ``component`` has all public methods and attributes of the protocol ``ability``.

    ``isinstance`` would miss attributes that a wrapper forwards by ``__getattr__``: since Python 3.12 it looks only
    at the class and the instance dictionary.
    """
    names = {*vars(ability), *get_annotations(ability)}
    return all(hasattr(component, name) for name in names if not name.startswith("_"))


# Data exchanged between components


class RobotSignals(NamedTuple):
    """Ideal onboard signals of a robot of L legs with J joints at the start of a step, from plant to sensors.

    The frame of the inertial unit coincides with the body frame: x forward, y left, z up.
    """

    q: State
    """(L, J): joint angles, rad."""
    dq: State
    """(L, J): joint velocities, rad/s."""
    torque: State
    """(L, J): torque that the motors held over the last sampling period, N m."""
    attitude: State
    """(3,): pitch, roll and yaw, rad; pitch positive nose down, roll right side down, yaw to the left."""
    gyroscope: State
    """(3,): angular velocity about the body axes, rad/s."""
    accelerometer: State
    """(3,): mean specific force (acceleration minus gravity) over the last sampling period, body axes, m/s^2."""
    tick: Clock
    """(1,): number of sampling periods since the start."""


class Measurement(NamedTuple):
    """State of a machine with L legs of J joints at the start of a step; feet move along J axes."""

    q: Array
    """(L, J): joint angles, rad; the position of a point mass, m."""
    dq: Array
    """(L, J): joint velocities, rad/s."""
    foot: Array
    """(L, J): position of the foot in its hip frame, m: x forward, y down, and z to the left if J = 3."""
    velocity: Array
    """(L, J): velocity of the foot in its hip frame, m/s."""
    force: Array
    """(L,): contact force, N, positive pressing on the ground."""
    body: Array
    """(3,): height of the body above the undepressed ground, m; pitch and roll, rad."""
    body_rate: Array
    """(3,): rates of height, m/s, and of pitch and roll, rad/s; zero without a body."""
    travel: Array | None = None
    """(3,): position x and y of the body in the world, m, and its yaw, rad, positive to the left; None if the plant
    does not move the body, which then follows the plan."""
    signals: RobotSignals | None = None
    """Onboard signals of a robot; None if the plant does not provide them."""


STATE = Measurement._fields[:7]
"""Names of the fields that every plant measures; ``travel`` and ``signals`` are optional."""


def get_state(state: tuple[Any, ...]) -> tuple[Array, ...]:
    """Return the first fields of ``state``, which are those named by STATE, with their shapes and units.

    For a Measurement, and for states of plant and sensors that begin with the same fields.
    """
    return state[: len(STATE)]


def view_state(state: tuple[Any, ...], travel: Array | None = None) -> Measurement:
    """Make a Measurement that shares the STATE arrays of ``state`` and ``travel`` (3,), m and rad, without copies."""
    return Measurement._make((*get_state(state), travel, None))


def copy_state(state: Any, travel: Array | None = None, signals: RobotSignals | None = None) -> Measurement:
    """Make a Measurement of copies of the STATE arrays of ``state``, ``travel`` (3,), m and rad, and ``signals``."""
    copied_signals = None if signals is None else RobotSignals(*map(np.ndarray.copy, signals))
    copied_travel = None if travel is None else travel.copy()
    return Measurement._make((*map(np.ndarray.copy, get_state(state)), copied_travel, copied_signals))


def new_measurement(legs: int, axes: int = 2) -> Measurement:
    """Make a Measurement of zeros for ``legs`` legs whose feet move along ``axes`` axes."""
    return Measurement._make((*np.zeros((4, legs, axes)), np.zeros(legs), *np.zeros((2, 3)), None, None))


class Drive(NamedTuple):
    """Command to motor drives with local PD loops, held until the next one.

    A drive applies torque + K (q - q_true) + D (dq - dq_true); the torque is that of the :class:`Action`.
    """

    q: Array
    """(L, J): joint angle setpoints, rad."""
    dq: Array
    """(L, J): joint velocity setpoints, rad/s."""
    stiffness: Array
    """(L, J): position gains K, N m/rad."""
    damping: Array
    """(L, J): velocity gains D, N m s/rad."""


class Action(NamedTuple):
    """Joint torques of one step; feedback and feedforward are separate so that the trace shows the share of each."""

    feedback: Array
    """(L, J): feedback torque, N m."""
    feedforward: Array
    """(L, J): feedforward torque, N m."""
    reference: Array | None = None
    """(L, J): position reference that the controller used, m; None: the planned one."""
    drive: Drive | None = None
    """Command to the drives, from a controller with ``sends_drives``; None: torques only."""
    learning_error: Array | None = None
    """(L, J): error signal that trains the feedforward, N m, which the guard evaluates; None: the feedback torque."""


# Required methods of components


class Plant(Protocol):
    """A machine on its ground.

    Optional abilities: :class:`Live`, :class:`ListsSteps`, :class:`Described`, :class:`TakesDrives`.
    """

    def reset(self, setup: Setup) -> Measurement:
        """Put the machine at the start of the plan and measure it."""
        ...

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (L, J), N m, over one sampling period, then measure the state.

        Raises:
            Diverged: the simulation has diverged (:class:`cmacexp.errors.Diverged`).
        """
        ...


class Sensors(Protocol):
    """Sensors between plant and controller.

    A measurement without ``travel`` leaves position and heading of the body unaltered. Optional abilities:
    :class:`Altering`, :class:`DelaysFeedback`, :class:`LagsFeedback`.
    """

    def reset(self, setup: Setup) -> None:
        """Prepare for a new run."""
        ...

    def measure(self, true: Measurement) -> Measurement:
        """Return the measurement of the state ``true``, which the controller gets."""
        ...


class Feedforward(Protocol):
    """Feedforward torque along the plan, improved by learning from the remaining feedback.

    Optional abilities: :class:`Observes`, :class:`Plays`, :class:`Learns`.
    """

    acts: bool
    """False if its torque is always zero; the references then need no correction for it."""

    def reset(self, setup: Setup) -> None:
        """Discard the learnt state and prepare for the plan of a new run."""
        ...

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the ``learning_error`` of the last step; return the torque of this step, (L, J) each, N m."""
        ...


class Controller(Protocol):
    """A controller, which computes joint torques from reference and measurement.

    Optional abilities: :class:`SendsDrives`, :class:`Answers`, :class:`WatchesForce`.
    """

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Prepare for a new run with ``feedforward``."""
        ...

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Compute the torques of one step, which are held over the sampling period."""
        ...


# Optional abilities of plants


class Live(Protocol):
    """A machine in real time, not simulated: files are written after the run, so that it never waits for them."""

    def end_run(self, is_safe: bool) -> None:
        """Bring the machine to rest after any outcome of the run.

        ``is_safe`` is True if the run has completed or the user has interrupted it; False if a component failed, the
        machine fell or a limit was exceeded.
        """
        ...


class ListsSteps(Protocol):
    """A plant that records the timing of its communication in each step."""

    def list_steps(self, start: int, stop: int) -> dict[str, Array]:
        """Return the LIVE_SIGNALS of steps ``start`` to ``stop``, exclusive, for the trace of the body.

        Arrays (stop - start,) by name, in the units of the table of signals (:mod:`cmacexp.data.signals`).
        """
        ...


class Described(Protocol):
    """A plant that adds an entry to the manifest of a run."""

    def describe(self) -> Any:
        """Return a JSON-serialisable description of the run that has ended."""
        ...


class TakesDrives(Protocol):
    """A plant with drives: ``step(torque, drive)`` also takes the :class:`Drive` of the controller."""

    takes_drives: bool


class HasSubsteps(Protocol):
    """The config of a plant that integrates in smaller steps than the sampling period."""

    substeps: int
    """Integration steps per sampling period."""


class HasEstimator(Protocol):
    """The config of a plant with an internal state estimator."""

    estimator: Any
    """Config of the estimator, with the fields of ``sensors=proprioceptive``."""


class HasReceiver(Protocol):
    """The config of a plant that declares how the receiver of commands computes the torques of its drives."""

    bus: Any
    """Config with the fields of ``ReceiverConfig`` (:mod:`cmacexp.plants.drives`)."""


# Optional abilities of sensors


SIGNALS = ("force", "position", "velocity", "height", "tilt", "height_rate", "tilt_rate")
"""Signals that sensors can alter: the first three of each leg, the others of the body."""
TRAVEL = "travel"
"""Position and heading of a body that the plant moves: estimators and external sensors can alter it."""


class Altering(Protocol):
    """Sensors that declare the signals they alter; without this, sensors are assumed to alter all SIGNALS."""

    alters: Any
    """Names of altered signals, of ``SIGNALS`` and ``TRAVEL``; each gets ``*_measured`` columns in the trace."""


class DelaysFeedback(Protocol):
    """Sensors that declare their delay, which ``learning.lead=auto`` counts."""

    def feedback_delay(self, uses_velocity: bool) -> int:
        """Return the delay of the feedback in samples; ``uses_velocity``: the controller uses measured velocities."""
        ...


class LagsFeedback(Protocol):
    """Sensors that declare the lag of their filters, which ``learning.lead=auto`` counts."""

    def feedback_lag(self, uses_velocity: bool) -> float:
        """Return the time constant of the lag, s; ``uses_velocity``: the controller uses measured velocities."""
        ...


# Optional abilities of controllers


class SendsDrives(Protocol):
    """A controller that commands drives: its actions contain a :class:`Drive`."""

    sends_drives: bool


class Answers(Protocol):
    """A controller that declares its response time, which ``learning.lead=auto`` counts."""

    response: Any
    """Samples, beyond delays and lags, until a torque shows in the learning error."""


class WatchesForce(Protocol):
    """A controller with fault detection for the force sensors."""

    force_trusted: Array
    """(L,): 1; 0 from the step at which the force sensor of the leg is considered faulty."""


# Optional abilities of feedforwards


class Observes(Protocol):
    """A feedforward that observes every step, before its prediction, including steps in which it does not act."""

    def observe(self, reference: Reference, measurement: Measurement, torque: Array) -> bool | None:
        """Observe the measurement, and the ``torque`` (L, J), N m, applied to the plant in the last step.

        A cycle begins where ``reference.sample`` is 0. Return False to observe no further steps of this run.
        """
        ...


class Plays(Protocol):
    """A feedforward that computes its torque in blocks: the loop calls :meth:`play` per block, not ``predict``."""

    block: int
    """Samples per block; the first block of a cycle begins at sample 0."""

    def play(self, sample: int, feedback: Array) -> Array:
        """Return the torque (N, L, J) of a whole cycle, N m, of which the loop applies the samples of this block.

        ``sample`` is the first sample of the block. ``feedback`` (N, L, J), N m, holds the last N steps, indexed by
        sample of the cycle; it is a read-only view of an array that the loop updates.
        """
        ...


class Learns(Protocol):
    """A feedforward whose weights can be saved and reused: ``reset`` finds saved ones in ``Setup.learnt``."""

    def learnt(self) -> Weights:
        """Return a copy of the weights, with everything that defines the inputs they belong to."""
        ...
