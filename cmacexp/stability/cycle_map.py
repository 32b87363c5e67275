"""One cycle of a run as a map from state to state, and its derivative; the loop is the run's own, not restated.

The state is all that the loop changes: weights in use, joints, what the controller and every other part carries over.
Which numbers those are is seen, not listed, so that a new rule, sensor or actuator is covered as it comes.
"""

import copy
import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.errors import CmacexpError
from cmacexp.feedforward.kernels import TABLE
from cmacexp.loop.builtin import FusedRun, external_components, fused_parts
from cmacexp.loop.samples import SAMPLES, make_samples
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.loop.stop import RUNNING, new_guard
from cmacexp.typing import Array

CLOCKS = ("plant_state.travel", "guard.tumble", "feedforward.log.values")
"""Arrays that only tell how far a run is: way walked, steps without balance, log. Learning cannot amplify them."""
RINGS = {"actuator.line": 0, "sensing.line": 1}
"""Delay lines that are written round and round, each with the axis of its samples: step k stands at k % length."""
NUDGE = 1e-6
"""Length of the steps that differences are taken over; the loop is smooth but where feet touch and leave ground."""


class NotPredictable(CmacexpError):
    """The loop cannot be linearised: parts of another's making, nothing that learns, or a run that ends at once."""


def _arrays_below(node: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(node, np.ndarray):
        yield path, node
    elif isinstance(node, tuple):
        names = getattr(node, "_fields", None) or [str(index) for index in range(len(node))]
        for inner, part in zip(names, node, strict=True):
            yield from _arrays_below(part, f"{path}.{inner}" if path else inner)


def arrays_of(node: Any) -> list[tuple[str, Any]]:
    """All arrays below a tuple of tuples, each once, with the names of the fields on the way to it."""
    found = {id(array): (path, array) for path, array in reversed(list(_arrays_below(node, "")))}
    return list(reversed(found.values()))


def _changed(now: Any, before: Any) -> Any:
    return (now != before) & ~((now != now) & (before != before))


class Place(NamedTuple):
    """Numbers of one array that belong to the state."""

    name: str
    """Fields on the way to it."""
    flat: Array
    """The array, flat, as a view."""
    index: Any
    """Of the numbers."""
    ring: tuple[int, int] | None
    """Samples of a delay line and how many numbers lie from one to the next; None for what is no such line."""

    def at(self, step: int) -> Any:
        """Index of the numbers at the start of ``step``: the samples of a delay line go by their age."""
        if self.ring is None:
            return self.index
        length, apart = self.ring
        slot = self.index // apart % length
        return self.index + apart * ((slot + step) % length - slot)


class Loop:
    """A scenario in the fused loop that can be put back to where it was.

    Args:
        scenario: fresh; of parts that the fused loop knows.

    Raises:
        NotPredictable: it has other parts.
    """

    def __init__(self, scenario: Scenario):
        external = external_components(scenario)
        if any(external) or scenario.fault is not None:
            raise NotPredictable("parts that the compiled loop does not know cannot be linearised")
        setup = scenario.setup
        config, legs = setup.config, setup.mechanism.legs.shape[0]
        guard = new_guard(setup.mechanism, setup.plan.margins[:, 0], config.sampling_period)
        self.run = FusedRun(fused_parts(scenario, external, guard))
        self.plan = setup.plan
        self.config = config
        self.period = config.steps_per_cycle
        self.samples, self.body = make_samples(self.period, legs, False)
        self.places: list[Place] = []
        self._first = [(array, array.copy()) for _, array in arrays_of(self.run.loop)]
        self._others: list[tuple[Any, Any]] = []
        self._taken = 0

    @property
    def cycles(self) -> int:
        """Whole cycles done so far."""
        return self.run.taken // self.period

    def advance(self, steps: int) -> bool:
        """Run some steps, a cycle at the most; whether none of them ended the run."""
        return self.run.run(self.samples[:steps], self.body[:steps]) == RUNNING

    def column(self, name: str) -> Array:
        """Torques (N, L, 2) of the last cycle's samples by the name of their pair, e.g. ``tau_feedback``."""
        first = SAMPLES.index(f"{name}_1")
        return self.samples[:, :, first : first + 2].copy()

    def play(self, torque: Array) -> None:
        """From now on the feedforward is ``torque`` (N, L, 2), N m, changed in place or not, and learns no more."""
        params = self.run.loop.feedforward
        self.run.loop = self.run.loop._replace(feedforward=params._replace(kind=TABLE, torque=torque))
        self._first = [(array, array.copy()) for _, array in arrays_of(self.run.loop)]

    def hold(self, steps: int) -> Array:
        """Take the state as it is now for that about which the loop is looked at, over so many steps.

        Returns:
            The state after those steps, in the order of :meth:`state`.

        Raises:
            NotPredictable: the run ends in them.
        """
        named = arrays_of(self.run.loop)
        before = [array.copy() for _, array in named]
        self._taken = self.run.taken
        if not self.advance(steps):
            raise NotPredictable(f"the run ends in cycle {self._taken // self.period + 1}")
        self.places, self._others = [], []
        for (name, array), old, (_, first) in zip(named, before, self._first, strict=True):
            moved = _changed(array, old) | _changed(old, first)
            if not moved.any():
                continue
            if array.dtype != np.float64 or name in CLOCKS:
                self._others.append((array, old))
                continue
            axis = RINGS.get(name)
            ring = None if axis is None else (array.shape[axis], math.prod(array.shape[axis + 1 :]))
            index = np.flatnonzero(moved if ring is None else np.ones_like(moved))
            self.places.append(Place(name, array.reshape(-1), index, ring))
        after = self.state()
        for (_, array), old in zip(named, before, strict=True):
            array[...] = old
        self.run.taken = self._taken
        return after

    def state(self) -> Array:
        """The numbers that change, (n,)."""
        return np.concatenate([place.flat[place.at(self.run.taken)] for place in self.places])

    def put(self, state: Array) -> None:
        """Go back to where :meth:`hold` was called, with another state."""
        done = 0
        for place in self.places:
            place.flat[place.at(self._taken)] = state[done : done + len(place.index)]
            done += len(place.index)
        for array, old in self._others:
            array[...] = old
        self.run.taken = self._taken

    def derivative(self, about: Array, along: Array, look: Callable[[], Array], steps: int) -> tuple[Array, Array]:
        """How the state after some steps, and something seen of them, change along a direction.

        Args:
            about: (n,): the state to linearise about.
            along: (n,): direction, not zero.
            look: gives what is to be seen, after the steps.
            steps: how many.

        Raises:
            NotPredictable: a run from nearby ends in those steps.
        """
        size = NUDGE / float(np.linalg.norm(along))
        ends = []
        for sign in (1.0, -1.0):
            self.put(about + sign * size * along)
            if not self.advance(steps):
                raise NotPredictable("a run from a state nearby ends within a cycle")
            ends.append((self.state(), look()))
        (state, seen), (other, seen_other) = ends
        return (state - other) / (2.0 * size), (seen - seen_other) / (2.0 * size)


def open_loop(config: Config, prepared: Scenario | None = None) -> Loop:
    """The loop of a config, at its start; see :class:`Loop`.

    Args:
        config: a checked config.
        prepared: its scenario if it is already made and has not run; it is left as it is.
    """
    if prepared is None:
        return Loop(make_scenario(config))
    return Loop(copy.deepcopy(prepared) if not any(external_components(prepared)) else prepared)
