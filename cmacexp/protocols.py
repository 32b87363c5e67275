"""What components must do, what they may do besides, and what they exchange.

A run has a plant, sensors, a controller and a feedforward. Each is an object of any class that has the methods of its
protocol here. What it may do besides has a protocol of its own, which the loop looks for by :func:`offers`.
"""

from inspect import get_annotations
from typing import Any, NamedTuple, Protocol, TypeGuard, TypeVar

import numpy as np

from cmacexp.planning.plan import Reference, Setup
from cmacexp.typing import Array, Clock, State, Weights

Ability = TypeVar("Ability")


def offers(component: object, ability: type[Ability]) -> TypeGuard[Ability]:
    """Return whether a component has the methods and attributes of a protocol of what it may do besides.

    ``isinstance`` would not find them in a wrapper that hands attributes on by ``__getattr__``: since Python 3.12 it
    looks only at what the class and the object themselves hold.
    """
    names = {*vars(ability), *get_annotations(ability)}
    return all(hasattr(component, name) for name in names if not name.startswith("_"))


# What components exchange


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


class Drive(NamedTuple):
    """What drives with loops of their own are to do until the next command: torque + K (q - q_true) + D (...)."""

    q: Array
    """(L, J): angles, rad."""
    dq: Array
    """(L, J): velocities, rad/s."""
    stiffness: Array
    """(L, J): K, N m/rad."""
    damping: Array
    """(L, J): D, N m s/rad."""


class Action(NamedTuple):
    """Joint torques of feedback and feedforward, apart, so that the trace shows the share of each."""

    feedback: Array
    """(L, J), N m."""
    feedforward: Array
    """(L, J), N m."""
    reference: Array | None = None
    """(L, J): position that the controller used, m; None: those of the plan."""
    drive: Drive | None = None
    """What drives get from a controller with ``sends_drives``, beside its torques; None: torques alone."""
    learning_error: Array | None = None
    """(L, J): what teaches, for the guard of learning, N m; None: the feedback."""


# What components must do


class Plant(Protocol):
    """A machine on its ground; it may also be :class:`Live`, :class:`Described`, :class:`TakesDrives`."""

    def reset(self, setup: Setup) -> Measurement:
        """Put the machine at the start of the plan and measure it."""
        ...

    def step(self, torque: Array) -> Measurement:
        """Hold ``torque`` (L, J), N m, over one sampling period; measure the state after it.

        Raises:
            Diverged: the engine of the plant reports that it has diverged (:class:`cmacexp.errors.Diverged`).
        """
        ...


class Sensors(Protocol):
    """Measure the true state; the measurement is the input of the controller.

    A measurement without ``travel`` leaves place and heading as they are. Sensors may also be :class:`Altering`,
    :class:`DelaysFeedback` and :class:`LagsFeedback`.
    """

    def reset(self, setup: Setup) -> None:
        """Start a run."""
        ...

    def measure(self, true: Measurement) -> Measurement:
        """The measurement of the state ``true``."""
        ...


class Feedforward(Protocol):
    """Torque known from the plan, and improved by the feedback that is still needed."""

    acts: bool
    """False if its torque is always zero, so that references need not allow for it."""

    def reset(self, setup: Setup) -> None:
        """Start a run: forget everything, prepare for the plan."""
        ...

    def predict(self, reference: Reference, learning_error: Array) -> Array:
        """Learn from the last step's feedback (L, J), N m, then return this step's torque (L, J), N m."""
        ...


class Controller(Protocol):
    """Computes joint torques from reference and measurement; it may be :class:`SendsDrives` or :class:`Answers`."""

    def reset(self, setup: Setup, feedforward: Feedforward) -> None:
        """Start a run."""
        ...

    def act(self, reference: Reference, measurement: Measurement) -> Action:
        """Torques of one step, held over the sampling period."""
        ...


# What plants may do besides


class Live(Protocol):
    """A plant that is not simulated: it must not wait for files, which are written after the run."""

    def end_run(self, is_safe: bool) -> None:
        """Come to rest, however the run has ended.

        It is safe if the run has completed, or the user has interrupted it. Else a component has failed, the machine
        fell, or a limit was passed.
        """
        ...


class ListsSteps(Protocol):
    """A plant that knows how each step was answered."""

    def list_steps(self, start: int, stop: int) -> dict[str, Array]:
        """List LIVE_SIGNALS of the body's trace, (stop - start,) by name, in the units of the table of signals."""
        ...


class Described(Protocol):
    """A plant that says something of the run in its manifest."""

    def describe(self) -> Any:
        """Describe the run that has ended, as JSON can hold it."""
        ...


class TakesDrives(Protocol):
    """A plant whose ``step(torque, drive)`` also gets the :class:`Drive` of a controller that sends drives."""

    takes_drives: bool


class HasSubsteps(Protocol):
    """The config of a plant that integrates in smaller steps than the sampling period."""

    substeps: int
    """Steps in a sampling period."""


class HasEstimator(Protocol):
    """The config of a plant that estimates its state by itself."""

    estimator: Any
    """Config of the estimator, as of ``sensors=proprioceptive``."""


# What sensors may do besides


SIGNALS = ("force", "position", "velocity", "height", "tilt", "height_rate", "tilt_rate")
"""What sensors can alter: the first three of every leg, the rest of a body."""
TRAVEL = "travel"
"""Place and heading of a body that the plant moves: what an estimator, or external sensors, can alter besides."""


class Altering(Protocol):
    """Sensors that say what they can change; others may change all SIGNALS."""

    alters: Any
    """Names of the ``SIGNALS`` that they can change, and ``TRAVEL`` if they do; these get ``*_measured`` columns."""


class DelaysFeedback(Protocol):
    """Sensors that say by how much they delay the feedback, which ``learning.lead=auto`` counts."""

    def feedback_delay(self, uses_velocity: bool) -> int:
        """Return the samples by which the feedback is delayed, of a controller that uses velocities or not."""
        ...


class LagsFeedback(Protocol):
    """Sensors that say by how much they filter the feedback, which ``learning.lead=auto`` counts."""

    def feedback_lag(self, uses_velocity: bool) -> float:
        """Return the time constant by which the feedback lags, s, of a controller that uses velocities or not."""
        ...


# What controllers may do besides


class SendsDrives(Protocol):
    """A controller whose actions have a :class:`Drive`."""

    sends_drives: bool


class Answers(Protocol):
    """A controller that says how late its answer shows."""

    response: Any
    """Samples that pass beyond delays and lags until a torque shows in what teaches."""


class WatchesForce(Protocol):
    """A controller that supervises its force sensors."""

    force_trusted: Array
    """(L,): 1, or 0 since the force sensor of the leg is no longer trusted."""


# What feedforwards may do besides


class Observes(Protocol):
    """A feedforward that is shown every step of a run, before it predicts and also where it does not act."""

    def observe(self, reference: Reference, measurement: Measurement, torque: Array) -> bool | None:
        """See what the sensors show, and the torque (L, J), N m, that the plant took in the last step.

        A cycle begins where ``reference.sample`` is 0. After False it is shown no more of this run.
        """
        ...


class Plays(Protocol):
    """A feedforward that knows its torque some samples ahead: it is asked for that instead of :meth:`predict`."""

    block: int
    """Samples from one call to the next; the first block of a cycle begins with it."""

    def play(self, sample: int, feedback: Array) -> Array:
        """The torque (N, L, J), N m, of all samples of the cycle, of which those of this block are played.

        ``sample`` is the first one of the block; ``feedback`` (N, L, J), N m, that of the last N steps by sample, is
        read-only, and the loop goes on filling it.
        """
        ...


class Learns(Protocol):
    """A feedforward whose weights can be saved, and started from: ``reset`` finds them in ``Setup.learnt``."""

    def learnt(self) -> Weights:
        """A copy of its weights, with all that defines which inputs they belong to."""
        ...
