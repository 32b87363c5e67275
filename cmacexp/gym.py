"""Gymnasium environments of scenarios: the action is a feedforward torque, added to the controller's feedback.

Importing this module registers ``cmacexp/OneLeg-v0``, ``cmacexp/Quadruped-v0`` and ``cmacexp/Robot-v0``, whose
actions lie in [-1, 1]; ``gymnasium.make("cmacexp.gym:cmacexp/OneLeg-v0")`` imports it too. :func:`make` returns the
same environment with actions in N m.
"""

import copy
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.config.compose import list_texts
from cmacexp.engine.api import open_loop
from cmacexp.errors import BadOutput, format_install_command
from cmacexp.feedforward.inverse_dynamics import InverseDynamics
from cmacexp.loop.stepwise import LoopState, OpenLoop
from cmacexp.loop.stop import FASTEST_JOINT, STEEPEST
from cmacexp.models.chain import chain_points
from cmacexp.models.ground import height_at
from cmacexp.models.mechanism import POINT_MASS, get_leg, has_body
from cmacexp.planning.reference import BEFORE, ControlReference, Y, Z
from cmacexp.report.style import GROUND, MM, draw_machine
from cmacexp.typing import Array, Status

try:
    import gymnasium
    from gymnasium import Env, spaces
except ImportError:
    raise ImportError(f"cmacexp.gym needs gymnasium: {format_install_command('gymnasium')}") from None

PLACE_SCALE = 0.01
"""Position error of a foot with a cost of 1, m."""
LARGEST_COST = 10.0
"""Largest cost of a leg in one step, and cost of each remaining step after the machine falls or diverges."""
BOUND = 2.0
"""Bound of observed planned quantities relative to their largest planned values; also largest action of a joint
without torque limit, relative to its largest inverse dynamics torque along the plan."""
LARGEST_RATIO = 10.0
"""Bound of forces relative to the largest desired force, and of learning errors relative to the largest action."""
FASTEST_BODY = 10.0
"""Bound of the velocities of the body, m/s and rad/s."""
AXES = "xyz"
REFERENCE_NAMES = ("x", "y", "vx", "vy", "force_desired", "z", "vz")
"""Observed quantities of the reference; the last two only where feet move in three dimensions."""
SIZE = (640, 360)
"""Width and height of a rendered image, pixels."""
DPI = 100
"""Resolution of a rendered image, pixels per inch."""
VIEW_HEIGHT = 1.7
"""Height shown in an image, relative to that of the hips."""
GROUND_SHARE = 0.3
"""Fraction of the image height below the ground line."""
MARK_DISTANCE = 0.1
"""Distance of the marks on the ground, m."""


def find_largest_torque(loop: OpenLoop) -> Array:
    """Return the largest action (L, J), N m: the torque limit of each joint.

    For joints without limit it is BOUND times the largest inverse dynamics torque along the plan.
    """
    limits = np.broadcast_to(np.array(loop.torque_limits, dtype=float), loop.shape)
    if np.isfinite(limits).all():
        return limits.copy()
    model = InverseDynamics(InverseDynamics.Config(mass_factor=1.0, length_factor=1.0, advance=0.0))
    needed = BOUND * np.abs(model.compute_torque(loop.setup)).max(axis=(0, 1))
    return np.where(np.isfinite(limits), limits, needed)


def observe_reference(control: ControlReference) -> Array:
    """Arrange a reference as an array (..., L, n) in the order of REFERENCE_NAMES; in m, m/s and N.

    Position and velocity of ``control`` are (..., L, J), its forces (..., L).
    """
    return np.concatenate(
        [
            control.position[..., :Z],
            control.velocity[..., :Z],
            control.force_desired[..., None],
            control.position[..., Z:],
            control.velocity[..., Z:],
        ],
        axis=-1,
    )


def list_entries(loop: OpenLoop, largest: Array) -> Iterator[tuple[str, float]]:
    """Yield name and bound of every entry of an observation, in order; bounds are absolute values in its unit.

    ``largest`` (L, J) is the largest action, N m. Joint angles are bounded by pi, joint velocities by the limit at
    which a run counts as diverged, foot positions by twice the largest planned distance from the hip. Observations
    are clipped to their bounds.
    """
    legs, joints = loop.shape
    plan = loop.setup.plan
    mechanism = loop.setup.mechanism
    reach = BOUND * float(np.abs(plan.desired.position).max())
    planned = BOUND * np.abs(observe_reference(plan.reference)[BEFORE]).max(axis=(0, 1))
    for leg in range(legs):
        in_leg = {
            **{f"q{joint + 1}": math.pi for joint in range(joints)},
            **{f"dq{joint + 1}": FASTEST_JOINT for joint in range(joints)},
            **dict.fromkeys(AXES[:joints], reach),
            **{f"v{axis}": FASTEST_JOINT * reach for axis in AXES[:joints]},
            "force": LARGEST_RATIO * (float(plan.force_desired.max()) or 1.0),
            **{f"reference.{name}": max(bound, 1.0) for name, bound in zip(REFERENCE_NAMES, planned, strict=False)},
            "support": 1.0,
            **{f"learning_error_{joint + 1}": LARGEST_RATIO * largest[leg, joint] for joint in range(joints)},
        }
        yield from ((f"leg_{leg + 1}.{name}", bound) for name, bound in in_leg.items())
    if has_body(mechanism):
        yield from {"height": BOUND * mechanism.hip_height, "pitch": STEEPEST, "roll": STEEPEST}.items()
        yield from dict.fromkeys(("height_rate", "pitch_rate", "roll_rate"), FASTEST_BODY).items()
    yield from (("cos_phase", 1.0), ("sin_phase", 1.0))


class LoopEnv(Env[Array, Array]):
    """Gymnasium environment of the closed loop of a scenario, with overrides such as ``["cycles=3"]``.

    The action is the feedforward torque (L J,), leg by leg, in units of ``action_scale``: with ``normalised`` the
    largest torque of each joint, so that actions lie in [-1, 1]; otherwise 1 N m. The observation consists of the
    sensor readings, the reference, the phase of the cycle and the learning error of a feedforward; ``names`` lists
    its entries. Values outside ``observation_space`` are clipped to it.

    The reward is minus the mean over the legs of a cost, at most 10, of the true state after the step. The cost of a
    leg is its squared position error divided by (0.01 m)^2, in support without the vertical axis, plus, in support,
    its squared force error divided by the square of the largest desired force. When the machine falls or diverges,
    the reward is -10 for each remaining step. An episode is ``truncated`` after the last cycle.

    With ``render_mode="rgb_array"`` :meth:`render` draws the machine from its right side. A copied or unpickled
    environment continues at the same step with the same bits: it repeats the steps of the episode so far.

    Attributes:
        loop: the simulated loop, see :class:`cmacexp.loop.stepwise.OpenLoop`.
        names: names of the entries of an observation.
        action_scale: (L J,): torque of an action of 1, N m; also in ``metadata``.

    Raises:
        CmacexpError: the scenario cannot be run; a ``BadInput`` names the key, the value and what is allowed.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 200}  # noqa: RUF012

    def __init__(
        self,
        scenario: str = "one_leg",
        overrides: Sequence[str] = (),
        normalised: bool = True,
        render_mode: str | None = None,
    ):
        self._made = (scenario, list_texts(overrides), normalised, render_mode)
        self.render_mode = render_mode
        self.loop = loop = open_loop([f"scenario={scenario}", *self._made[1]])
        largest = find_largest_torque(loop)
        self.names, bounds = zip(*list_entries(loop, largest), strict=True)
        self.action_scale = largest.ravel() if normalised else np.ones(largest.size)
        self.metadata = self.metadata | {
            "render_fps": round(1.0 / loop.sampling_period),
            "action_scale": self.action_scale.tolist(),
        }
        self._bounds = np.array(bounds)
        limit = largest.ravel() / self.action_scale
        # float32, as learners expect; limits in N m would be rounded.
        number: Any = np.float32 if normalised else np.float64
        high = limit.astype(number)
        self.action_space = spaces.Box(-high, high, dtype=number)
        self.observation_space = spaces.Box(-self._bounds, self._bounds, dtype=np.float64)
        self._counted = np.arange(loop.shape[1]) != Y  # y is the vertical axis
        self._force_scale = float(loop.setup.plan.force_desired.max()) or 1.0
        self._start_seed: int | None = None
        self._torques: list[Array] = []

    def __getstate__(self) -> dict[str, Any]:
        """Return the arguments of the environment, its seeds, and the torques of the episode so far."""
        names = ("_made", "_start_seed", "_torques", "_np_random", "_np_random_seed", "action_space", "spec")
        return copy.deepcopy({name: getattr(self, name) for name in names})  # shallow copies must be independent, too

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(*state["_made"])  # type: ignore[misc]
        self.__dict__.update(state)
        self.loop.reset(self._start_seed)
        for torque in self._torques:
            self.loop.step(torque)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode; return its first observation and information.

        ``seed`` is that of the sensor noise; without it, it is drawn from the generator of the environment.
        """
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**32))
        self._start_seed = drawn if seed is None else seed % 2**32
        self._torques = []
        moment = self.loop.reset(self._start_seed)
        return self._observe(moment), self._inform(moment)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Take a step with an ``action`` (L J,), clipped to the action space.

        Returns observation, reward, whether the machine fell or diverged, whether the episode is truncated, and
        information. Raises BadOutput for an action of another shape.
        """
        space = self.action_space
        if np.shape(action) != space.shape:
            raise BadOutput(f"action of shape {np.shape(action)}: must have the shape {space.shape}")
        clipped = np.minimum(np.maximum(action, space.low), space.high)  # type: ignore[attr-defined]
        torque = (clipped * self.action_scale).reshape(self.loop.shape)
        moment = self.loop.step(torque)
        self._torques.append(torque)
        fails = moment.status not in ("running", Status.COMPLETED)
        remaining = self.loop.steps - moment.step + 1
        reward = -LARGEST_COST * remaining if fails else -self.compute_cost(moment)
        return self._observe(moment), reward, fails, moment.status == Status.COMPLETED, self._inform(moment)

    def compute_cost(self, moment: LoopState) -> float:
        """Compute the cost of a state, 0 to 10, without a unit; see the class."""
        error = (moment.state.foot - moment.foot_motion.position) / PLACE_SCALE
        counted = np.where(moment.support[:, None], self._counted, True)
        force = (moment.state.force - moment.force_desired) / self._force_scale
        cost = (error * error * counted).sum(axis=1) + np.where(moment.support, force * force, 0.0)
        return float(np.fmin(cost, LARGEST_COST).mean())  # NaN after a divergence gives the largest cost

    def _observe(self, moment: LoopState) -> Array:
        measured = moment.observed
        phase = 2.0 * math.pi * moment.sample / self.loop.period
        in_legs = (
            *(measured.q, measured.dq, measured.foot, measured.velocity, measured.force[:, None]),
            *(observe_reference(moment.control), moment.support[:, None], moment.learning_error),
        )
        body = (measured.body, measured.body_rate) if has_body(self.loop.setup.mechanism) else ()
        values = np.concatenate([np.hstack(in_legs).ravel(), *body, [math.cos(phase), math.sin(phase)]])
        if moment.status != "running":
            values = np.nan_to_num(values)
        return np.minimum(np.maximum(values, -self._bounds), self._bounds)

    def _inform(self, moment: LoopState) -> dict[str, Any]:
        return {"step": moment.step, "status": moment.status, "cause": moment.cause}

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Return an image (height, width, 3) of the current state of the machine; None without ``render_mode``."""
        return draw_loop(self.loop) if self.render_mode == "rgb_array" else None


def _find_legs(loop: OpenLoop) -> Array:
    """Compute joints and foot of each leg (L, points, 2): x forward of the body, z above the ground below it, m."""
    mechanism = loop.setup.mechanism
    state = loop.moment.state
    legs = []
    height, pitch, _ = state.body if has_body(mechanism) else (mechanism.hip_height, 0.0, 0.0)
    for leg in range(loop.shape[0]):
        foot = state.foot[leg, :2]
        if mechanism.chains is not None:
            points = chain_points(mechanism.chains[leg], state.q[leg])[:, :2]
        elif mechanism.kind == POINT_MASS:
            points = np.array([foot])
        else:
            angle = state.q[leg, 0]
            knee = get_leg(mechanism, leg).length_1 * np.array([math.cos(angle), math.sin(angle)])
            points = np.array([[0.0, 0.0], knee, foot])
        legs.append(points * [1.0, -1.0] + [mechanism.hips[leg, 0], 0.0])
    turn = np.array([[math.cos(pitch), -math.sin(pitch)], [math.sin(pitch), math.cos(pitch)]])
    return np.nan_to_num(np.array(legs) @ turn + np.array([0.0, height]))


def draw_loop(loop: OpenLoop) -> NDArray[np.uint8]:
    """Draw an image (height, width, 3) of a machine on the ground from its right side; the view follows the body.

    Legs without load are light blue; marks on the ground are 0.1 m apart.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    mechanism = loop.setup.mechanism
    config = loop.setup.config
    state = loop.moment.state
    at = (
        config.body_speed * loop.moment.step * loop.sampling_period
        if state.travel is None
        else float(state.travel[0])
    )
    high = VIEW_HEIGHT * mechanism.hip_height
    wide = high * SIZE[0] / SIZE[1]
    low = -GROUND_SHARE * high
    x = MARK_DISTANCE * np.arange(math.floor((at - wide) / MARK_DISTANCE), math.ceil((at + wide) / MARK_DISTANCE))
    ground = height_at(config.terrain.slope, config.terrain.slope_start, np.append(x, at))
    figure = Figure(figsize=(SIZE[0] / DPI, SIZE[1] / DPI), dpi=DPI)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.axis("off")
    axes.fill_between(MM * x, MM * (ground[:-1] - ground[-1]), MM * low, color=GROUND, alpha=0.3, lw=0.0)
    axes.plot(MM * x, MM * (ground[:-1] - ground[-1]), "|", color=GROUND)
    draw_machine(axes, MM * (_find_legs(loop) + np.array([at, 0.0])), mechanism.hips[:, 1] <= 0.0, state.force <= 0.0)
    axes.set(xlim=(MM * (at - wide / 2.0), MM * (at + wide / 2.0)), ylim=(MM * low, MM * (low + high)))
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def make(
    scenario: str = "one_leg",
    overrides: Sequence[str] = (),
    *,
    normalised: bool = False,
    render_mode: str | None = None,
) -> LoopEnv:
    """Make the environment of a scenario, with actions in N m, or in [-1, 1] if ``normalised``.

    The environments registered with Gymnasium are normalised. Raises CmacexpError if the scenario cannot be run.
    """
    return LoopEnv(scenario, overrides, normalised, render_mode)


for _name, _scenario in {"OneLeg": "one_leg", "Quadruped": "quadruped", "Robot": "robot"}.items():
    gymnasium.register(f"cmacexp/{_name}-v0", "cmacexp.gym:LoopEnv", kwargs={"scenario": _scenario})
