"""One cycle of a run as a map from state to state, and its derivative; the map uses the run's own loop.

The state is every array that a component declares as such (:mod:`cmacexp.typing`); of weights, those in use. Clocks
return with the state, but are not part of it.
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
"""Length of the steps of finite differences; the loop is smooth except where feet touch and leave the ground."""


class NotPredictable(CmacexpError):
    """The loop cannot be linearised: external components, no learning, or a run that ends at once."""


def _read(part: Declared, step: int) -> Array:
    """The values of a state array, (n,); samples of a ring buffer are sorted by age."""
    axis = part.role.ring_axis if part.role else None
    return np.ravel(part.array if axis is None else np.roll(part.array, -step, axis))


def _write(part: Declared, step: int, values: Array) -> None:
    axis = part.role.ring_axis if part.role else None
    shaped = values.reshape(part.array.shape)
    part.array[...] = shaped if axis is None else np.roll(shaped, step, axis)


class RestorableLoop:
    """A fresh scenario of built-in components, else NotPredictable, in the loop whose state can be read and set."""

    def __init__(self, scenario: Scenario):
        self.plant = scenario.plant if isinstance(scenario.plant, MujocoPlant) else None
        NotPredictable.unless(
            not any(find_external(scenario)) and scenario.fault is None,
            "only a loop of built-in components with a plant of the project can be linearised",
        )
        setup = scenario.setup
        config, (legs, self.joints) = setup.config, setup.mechanism.shape
        self.run = Driver(scenario)
        self.plan = setup.plan
        self.period = config.steps_per_cycle
        self.samples, self.body = make_samples(self.period, legs, False, self.joints)
        self._list_state()

    def _list_state(self) -> None:
        feedforward = self.run.loop.feedforward
        assert feedforward is not None
        arrays = list_arrays(self.run.loop)
        learns = feedforward.kind != TABLE
        self._weights, log = feedforward.weights, feedforward.log
        states = [each for each in arrays if each.role is not None and each.role.name == STATE.name]
        if self.plant is not None:  # its own state stands for what is measured of it
            states = [each for each in states if not each.name.startswith("plant_state.")]
        self._parts = [each for each in states if each.array is not self._weights]
        self._in_use = [rows[:used] for rows, used in zip(log.rows, log.used, strict=True)] if learns else []
        self._clocks = Snapshot(each.array for each in arrays if each.role == CLOCK)

    @property
    def cycles(self) -> int:
        """Completed cycles."""
        return self.run.taken // self.period

    def advance(self, steps: int) -> bool:
        """Run some steps, at most a cycle; False if the run ended in them."""
        with interrupt_held_back():  # MuJoCo would drop an interrupt in a function that it calls
            return self.run.run(self.samples, self.body, steps=steps) == RUNNING

    def column(self, name: str) -> Array:
        """Torques (N, L, J) of the last cycle's samples by the name of the joints', e.g. ``tau_feedback``."""
        columns = [ALL_SAMPLES.index(f"{name}_{joint + 1}") for joint in range(self.joints)]
        return np.moveaxis(self.samples[columns], 0, 2)

    def play(self, torque: Array) -> None:
        """From now on the feedforward is ``torque`` (N, L, J), N m, which may change in place; it learns no more."""
        params = self.run.loop.feedforward
        assert params is not None
        self.run.loop = self.run.loop._replace(feedforward=params._replace(kind=TABLE, torque=torque))
        self._list_state()

    def hold(self) -> Array:
        """Remember this step as the one that :meth:`put` returns to; its state, (n,)."""
        self._clocks = Snapshot(self._clocks.arrays)
        self._held = self.run.taken
        self._plant_size = 0 if self.plant is None else len(self.plant.hold())
        return self.state()

    def state(self) -> Array:
        """The state, (n,)."""
        weights = [self._weights[i, rows].ravel() for i, rows in enumerate(self._in_use)]
        plant = [] if self.plant is None else [self.plant.pack_state()]
        return np.concatenate([*(_read(part, self.run.taken) for part in self._parts), *weights, *plant])

    def put(self, state: Array) -> None:
        """Return to the step of :meth:`hold`, with this state (n,)."""
        if self.plant is not None:  # which measures, as if nothing had moved before: what was measured then follows
            self.plant.put(state[-self._plant_size :])
        done = 0
        for part in self._parts:
            _write(part, self._held, state[done : done + part.array.size])
            done += part.array.size
        for i, rows in enumerate(self._in_use):
            size = len(rows) * self._weights.shape[2]
            self._weights[i, rows] = state[done : done + size].reshape(len(rows), -1)
            done += size
        self._clocks.restore()
        self.run.taken = self._held

    def derivative(self, about: Array, along: Array, observe: Callable[[], Array], steps: int) -> tuple[Array, Array]:
        """Directional derivative of the state (n,), and of an observation, after steps that must not end the run."""
        size = NUDGE / float(np.linalg.norm(along))
        ends = []
        for sign in (1.0, -1.0):
            self.put(about + sign * size * along)
            NotPredictable.unless(self.advance(steps), "a run from a nearby state ends within a cycle")
            ends.append((self.state(), observe()))
        (state, observed), (other, observed_other) = ends
        return (state - other) / (2.0 * size), (observed - observed_other) / (2.0 * size)


def make_restorable_loop(config: Config) -> RestorableLoop:
    """The loop of a config, at its start."""
    return RestorableLoop(make_scenario(config))
