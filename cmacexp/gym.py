"""A scenario as a Gymnasium environment: the action is a feedforward torque beside the controller's feedback."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from cmacexp.engine.api import open_loop
from cmacexp.errors import BadOutput, format_install_command
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.loop.stepwise import LoopState, OpenLoop
from cmacexp.models.mechanism import has_body
from cmacexp.planning.columns import FORCE_DESIRED, REFERENCE_VZ, REFERENCE_Z, VX, VY, X, Y, Z
from cmacexp.typing import Array

try:
    from gymnasium import Env, spaces
except ImportError:
    raise ImportError(f"cmacexp.gym needs gymnasium: {format_install_command('gymnasium')}") from None

PLACE_SCALE = 0.01
"""Error of the place of a foot that costs 1, m."""
LARGEST_COST = 10.0
"""Of a leg in one step, and of each step that is left when the machine falls or diverges."""
BOUND = 2.0
"""Largest action over the largest torque of inverse dynamics along the plan, where nothing limits a joint."""
AXES = "xyz"
REFERENCES = {2: (X, Y, VX, VY, FORCE_DESIRED), 3: (X, Y, VX, VY, FORCE_DESIRED, REFERENCE_Z, REFERENCE_VZ)}
"""Columns of the reference that are observed, by the number of axes."""
REFERENCE_NAMES = ("x", "y", "vx", "vy", "force_desired", "z", "vz")


def _name_observations(legs: int, joints: int, body: bool) -> Iterator[str]:
    for leg in range(1, legs + 1):
        for name in ("q", "dq"):
            yield from (f"leg_{leg}.{name}{joint + 1}" for joint in range(joints))
        for name in ("", "v"):
            yield from (f"leg_{leg}.{name}{axis}" for axis in AXES[:joints])
        yield f"leg_{leg}.force"
        yield from (f"leg_{leg}.reference.{name}" for name in REFERENCE_NAMES[: len(REFERENCES[joints])])
        yield f"leg_{leg}.support"
        yield from (f"leg_{leg}.learning_error_{joint + 1}" for joint in range(joints))
    if body:
        yield from ("height", "pitch", "roll", "height_rate", "pitch_rate", "roll_rate")
    yield from ("cos_phase", "sin_phase")


def find_largest_torque(loop: OpenLoop) -> Array:
    """Largest action (L, J), N m: what limits a joint, else BOUND times what inverse dynamics need along the plan."""
    limits = np.broadcast_to(np.array(loop.torque_limits, dtype=float), loop.shape)
    if np.isfinite(limits).all():
        return limits.copy()
    model = InverseDynamics(InverseDynamics.Config(mass_factor=1.0, length_factor=1.0))
    needed = BOUND * np.abs(model.compute_torque(loop.setup)).max(axis=(0, 1))
    return np.where(np.isfinite(limits), limits, needed)


class LoopEnv(Env[Array, Array]):
    """A closed loop of a scenario; :func:`make` makes one.

    The action is the feedforward torque (L J,), N m, leg by leg. The observation is what the sensors show, the
    reference, the phase of the cycle, and what a feedforward would learn from; ``names`` says what stands where.

    The reward is minus the mean over the legs of a cost, at most 10, of the true state that the step has led to: the
    squared distance of the foot from its desired place, over 0.01 m, in support without the vertical axis; and in
    support the square of the error of the contact force over the largest desired force. A machine that falls or
    diverges pays 10 for each step that is left. An episode is ``truncated`` after the last cycle.

    Attributes:
        loop: see :class:`cmacexp.loop.stepwise.OpenLoop`.
        names: of the entries of an observation.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, loop: OpenLoop):
        self.loop, (legs, joints), mechanism = loop, loop.shape, loop.setup.mechanism
        self.has_body = bool(has_body(mechanism))
        self.names = tuple(_name_observations(legs, joints, self.has_body))
        largest = find_largest_torque(loop).ravel()
        self.action_space = spaces.Box(-largest, largest, dtype=np.float64)
        self.observation_space = spaces.Box(-np.inf, np.inf, (len(self.names),), dtype=np.float64)
        plan, (vertical, axes) = loop.setup.plan, (Y, [X, Y, Z][:joints])
        self._axes, self._columns = axes, list(REFERENCES[joints])
        self._counted = np.array([axis != vertical for axis in axes])
        self._values = np.zeros(len(self.names))
        of_legs = self._values[: len(self.names) - (8 if self.has_body else 2)].reshape(legs, -1)
        widths = (joints, joints, joints, joints, 1, len(self._columns), 1, joints)
        self._views = np.split(of_legs, np.cumsum(widths)[:-1], axis=1)
        self._force_scale = float(plan.force_desired.max()) or 1.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode; ``seed`` is that of the noise of the sensors, without it the next one is drawn."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**32))
        moment = self.loop.reset(drawn if seed is None else seed % 2**32)
        return self._observe(moment), self._inform(moment)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Take a step with a torque (L J,), N m, which is clipped to the action space."""
        space = self.action_space
        if np.shape(action) != space.shape:
            raise BadOutput(f"action of shape {np.shape(action)}: must have the shape {space.shape}")
        torque = np.minimum(np.maximum(action, space.low), space.high)  # type: ignore[attr-defined]
        moment = self.loop.step(torque.reshape(self.loop.shape))
        fails = moment.status not in ("running", "completed")
        left = self.loop.steps - moment.step + 1
        reward = -LARGEST_COST * left if fails else -self.compute_cost(moment)
        return self._observe(moment), reward, fails, moment.status == "completed", self._inform(moment)

    def compute_cost(self, moment: LoopState) -> float:
        """The cost of a state, see the class; 0 to 10."""
        off = (moment.state.foot - moment.desired[:, self._axes]) / PLACE_SCALE
        counted = np.where(moment.support[:, None], self._counted, True)
        force = (moment.state.force - moment.force_desired) / self._force_scale
        cost = (off * off * counted).sum(axis=1) + np.where(moment.support, force * force, 0.0)
        return float(np.fmin(cost, LARGEST_COST).mean())  # NaN after a divergence costs as much

    def _observe(self, moment: LoopState) -> Array:
        seen, angle = moment.observed, 2.0 * math.pi * moment.sample / self.loop.period
        parts = seen.q, seen.dq, seen.foot, seen.velocity, seen.force[:, None], moment.reference[:, self._columns]
        for view, part in zip(self._views, (*parts, moment.support[:, None], moment.learning_error), strict=True):
            view[...] = part
        if self.has_body:
            self._values[-8:-5], self._values[-5:-2] = seen.body, seen.body_rate
        self._values[-2], self._values[-1] = math.cos(angle), math.sin(angle)
        return self._values.copy() if moment.status == "running" else np.nan_to_num(self._values)

    def _inform(self, moment: LoopState) -> dict[str, Any]:
        return {"step": moment.step, "status": moment.status, "cause": moment.cause}


def make(scenario: str = "one_leg", overrides: Sequence[str] = ()) -> LoopEnv:
    """The environment of a scenario, with overrides such as ``["cycles=3"]``; raises CmacexpError."""
    return LoopEnv(open_loop([f"scenario={scenario}", *overrides]))
