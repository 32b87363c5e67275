"""The map of the loop state over one cycle, and its directional derivative; the map runs the loop itself.

The state consists of all arrays that components declare as state (:mod:`cmacexp.typing`); of the weights only those
in use. Clocks are restored with the state, but are not part of it.
"""

from collections.abc import Callable

import numpy as np

from cmacexp.config import Config
from cmacexp.errors import CmacexpError
from cmacexp.feedforward.kernels import TABLE
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.loop.builtin import find_external
from cmacexp.loop.driver import Driver
from cmacexp.loop.samples import ALL_SAMPLES, make_samples
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.loop.state import Declared, Snapshot, list_arrays
from cmacexp.loop.stop import RUNNING
from cmacexp.plants.mujoco_plant import MujocoPlant
from cmacexp.typing import CLOCK, STATE, Array

NUDGE = 1e-6
"""Step length of finite differences; the loop is smooth except where feet touch and leave the ground."""


class NotPredictable(CmacexpError):
    """Raised where the loop cannot be linearised: custom components, no learning, or a run that ends too early."""


def _read(declared: Declared, step: int) -> Array:
    """Read a state array at a step as a vector (n,), with the samples of a ring buffer sorted by age."""
    axis = declared.role.ring_axis if declared.role else None
    return np.ravel(declared.array if axis is None else np.roll(declared.array, -step, axis))


def _write(declared: Declared, step: int, values: Array) -> None:
    """Set a state array from a vector (n,), as :func:`_read` returns it."""
    axis = declared.role.ring_axis if declared.role else None
    shaped = values.reshape(declared.array.shape)
    declared.array[...] = shaped if axis is None else np.roll(shaped, step, axis)


class RestorableLoop:
    """The closed loop of a new scenario, with a state that can be read and set.

    Raises NotPredictable if the scenario has custom components.
    """

    def __init__(self, scenario: Scenario):
        self.plant = scenario.plant if isinstance(scenario.plant, MujocoPlant) else None
        NotPredictable.unless(
            not any(find_external(scenario)) and scenario.fault is None,
            "only a loop of built-in components with a plant of the project can be linearised",
        )
        legs, self.joints = scenario.setup.mechanism.shape
        self.run = Driver(scenario)
        self.plan = scenario.setup.plan
        self.period = scenario.setup.config.steps_per_cycle
        self.samples, self.body = make_samples(self.period, legs, False, self.joints)
        self._list_state()

    def _list_state(self) -> None:
        feedforward = self.run.loop.feedforward
        assert feedforward is not None
        arrays = list_arrays(self.run.loop)
        log = feedforward.log
        self._weights = feedforward.weights
        states = [array for array in arrays if array.role is not None and array.role.name == STATE.name]
        if self.plant is not None:  # pack_state() of the plant replaces its measured state
            states = [array for array in states if not array.name.startswith("plant.state.")]
        self._arrays = [array for array in states if array.array is not self._weights]
        learns = feedforward.kind != TABLE
        self._in_use = [rows[:used] for rows, used in zip(log.rows, log.used, strict=True)] if learns else []
        self._clocks = Snapshot(array.array for array in arrays if array.role == CLOCK)

    @property
    def cycles(self) -> int:
        """Number of completed cycles."""
        return self.run.taken // self.period

    def advance(self, steps: int) -> bool:
        """Run ``steps`` steps, at most one cycle; return False if the run ended during them."""
        with interrupt_held_back():  # MuJoCo would drop an interrupt in a function that it calls
            return self.run.run(self.samples, self.body, steps=steps) == RUNNING

    def column(self, name: str) -> Array:
        """Return a torque of the last cycle, (N, L, J), N m; ``name`` is without the joint, e.g. ``tau_feedback``."""
        columns = [ALL_SAMPLES.index(f"{name}_{joint + 1}") for joint in range(self.joints)]
        return np.moveaxis(self.samples[columns], 0, 2)

    def play(self, torque: Array) -> None:
        """Replace the feedforward by the table ``torque`` (N, L, J), N m, which may change in place; end learning."""
        params = self.run.loop.feedforward
        assert params is not None
        self.run.loop = self.run.loop._replace(feedforward=params._replace(kind=TABLE, torque=torque))
        self._list_state()

    def hold(self) -> Array:
        """Store this step as the one that :meth:`put` returns to, and return its state, (n,)."""
        self._clocks = Snapshot(self._clocks.arrays)
        self._held = self.run.taken
        self._plant_size = 0 if self.plant is None else len(self.plant.hold())
        return self.state()

    def state(self) -> Array:
        """Return the state, (n,)."""
        weights = [self._weights[i, rows].ravel() for i, rows in enumerate(self._in_use)]
        plant = [] if self.plant is None else [self.plant.pack_state()]
        return np.concatenate([*(_read(declared, self.run.taken) for declared in self._arrays), *weights, *plant])

    def put(self, state: Array) -> None:
        """Return to the step of :meth:`hold`, with the state ``state`` (n,)."""
        if self.plant is not None:  # first, since this overwrites the measured state
            self.plant.put(state[-self._plant_size :])
        start = 0
        for declared in self._arrays:
            _write(declared, self._held, state[start : start + declared.array.size])
            start += declared.array.size
        for i, rows in enumerate(self._in_use):
            size = len(rows) * self._weights.shape[2]
            self._weights[i, rows] = state[start : start + size].reshape(len(rows), -1)
            start += size
        self._clocks.restore()
        self.run.taken = self._held

    def derivative(self, about: Array, along: Array, observe: Callable[[], Array], steps: int) -> tuple[Array, Array]:
        """Compute the derivatives of the state and of an observation after ``steps`` with respect to the held state.

        Central differences at the state ``about`` (n,) in the direction ``along`` (n,). Returns the derivative of the
        state (n,) and that of ``observe()``. Raises NotPredictable if the run ends during the steps.
        """
        size = NUDGE / float(np.linalg.norm(along))
        ends = []
        for sign in (1.0, -1.0):
            self.put(about + sign * size * along)
            NotPredictable.unless(self.advance(steps), "a run from a nearby state ends within a cycle")
            ends.append((self.state(), observe()))
        (state_plus, observed_plus), (state_minus, observed_minus) = ends
        return (state_plus - state_minus) / (2.0 * size), (observed_plus - observed_minus) / (2.0 * size)


def make_restorable_loop(config: Config) -> RestorableLoop:
    """Build the loop of a config, at the start of the run; raises NotPredictable."""
    return RestorableLoop(make_scenario(config))
