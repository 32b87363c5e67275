"""The plan of a cycle: phases, desired motion and force of every foot, and the reference of the controller.

A :class:`Setup` holds it with all other data that components get at the start of a run.
"""

import copy
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.config.gait import PATTERNS
from cmacexp.config.machine import RobotMachine
from cmacexp.errors import BadInput
from cmacexp.models.ground import NEVER
from cmacexp.models.mechanism import POINT_MASS, SPACE, Mechanism, has_body
from cmacexp.planning.body import BodyLoad, dynamic_load, find_pressure, find_sway, static_load
from cmacexp.planning.machine import compute_load, plan_robot
from cmacexp.planning.motion import (
    Timing,
    check_reach,
    make_timing,
    plan_force,
    plan_horizontal,
    plan_joints,
    plan_load_fraction,
    plan_motion,
)
from cmacexp.planning.reference import ControlReference, Motion, X, Y, Z, plan_reference
from cmacexp.planning.stability import check_stability, margins
from cmacexp.typing import Array, Mask, Weights

LOAD_PASSES = 2
"""Passes in which the load is computed. Forces depress the feet, which moves the masses that cause them: one pass
reduces the error a thousandfold."""
SWAY_PASSES = 8
"""Passes in which the sway is computed. Each reduces the residual moments to a third, or to less."""
OUT_OF_BALANCE = 0.005
"""Mean error of the centre of pressure, over the height of the hips, from which on a gait is refused."""
LEAST_LOAD = 0.1
"""Least load of the feet over the planned one."""


class Plan(NamedTuple):
    """One cycle of N samples for L legs, which repeats, with the frames and signs of the trace."""

    support: Mask
    """(N, L): True where the foot is planned to support."""
    progress: Array
    """(N, L): progress within the phase, 0 to 1."""
    desired: Motion
    """Motion of the feet, each in the frame of its hip."""
    joints: Motion
    """The same motion in joint angles; for a point mass equal to ``desired``."""
    force_desired: Array
    """(N, L): desired contact force, N."""
    reference: ControlReference
    """Reference of the controller, per stage."""
    load: BodyLoad
    """Load that the feet of a body share."""
    sway: Motion
    """Motion of a body besides its constant speed, (N, 2), forward and left."""
    margins: Array
    """(N, 3): stability margin, front and rear margin of a body over its planned support polygon, m; NaN without a
    body."""
    start_step: int
    """First step at which the feedforward learns and acts; beyond any run if there is none."""


class LoadEstimate(NamedTuple):
    """Estimated difference of load and ground from the plan, over a cycle."""

    weight: float
    """Weight that the feet carried beyond the planned one, N."""
    x: float
    """Distance of the centre of the load forward of the planned one, m."""
    y: float
    """Distance of the centre of the load to the left of the planned one, m."""
    slope_x: float
    """Rise of the ground forward, m/m."""
    slope_y: float
    """Rise of the ground to the left, m/m."""


NOTHING = LoadEstimate(0.0, 0.0, 0.0, 0.0, 0.0)


class _Walk(NamedTuple):
    """Motion of body and feet over a cycle, before the feet share a load."""

    config: Config
    mechanism: Mechanism
    timing: Timing
    forward: Motion
    """(N, L): motion of every foot along x in the frame of its hip."""
    feet: Array
    """(N, L, 2): positions of the feet, forward and left of the body's centre, m."""
    sway: Motion
    margins: Array
    """(N, 3): planned margins without the sway of the body, m."""


def _start_walk(config: Config, mechanism: Mechanism) -> _Walk:
    """Plan the walk without sway, which depends only on machine and gait."""
    timing = make_timing(config.gait, config.steps_per_cycle)
    forward = plan_horizontal(config, timing)
    feet = np.zeros((*timing.support.shape, 2))
    feet[..., 0] = forward.position
    feet += mechanism.hips
    still = Motion(*np.zeros((3, len(feet), 2)))
    return _Walk(config, mechanism, timing, forward, feet, still, margins(feet, timing.support))


def _sway(walk: _Walk, load: BodyLoad) -> _Walk:
    """Add sway to the body, so that the feet can give the centre of pressure that the ``load`` needs."""
    weight, _ = plan_load_fraction(walk.config, walk.timing)
    missing = find_pressure(walk.feet, weight, load.centre) - load.centre
    added = find_sway(missing, walk.mechanism.hip_height, walk.config.sampling_period)
    sway = Motion(*(old + new for old, new in zip(walk.sway, added, strict=True)))
    return walk._replace(feet=walk.feet - added.position[:, None], sway=sway)


def _plan_under_load(walk: _Walk, load: BodyLoad, estimate: LoadEstimate = NOTHING) -> tuple[Motion, Motion, Array]:
    """Plan the motion of feet that share ``load``, that of the joints, and the contact forces (N, L), N.

    ``estimate`` is the difference from the nominal load and ground for which the feet are moved.
    """
    config, mechanism, timing, forward, feet, sway, _ = walk
    force, rate = plan_force(config, timing, feet, load)
    desired = plan_motion(config, timing, mechanism, forward, force, rate)
    horizontal = [X, Z][: mechanism.shape[1] - 1]
    for values, swaying in zip(desired, sway, strict=True):
        values[..., horizontal] -= swaying[:, None, : len(horizontal)]
    desired.position[..., horizontal] += (estimate.x, estimate.y)[: len(horizontal)]
    desired.position[..., Y] -= estimate.slope_x * feet[..., 0] + estimate.slope_y * feet[..., 1]
    desired.velocity[..., Y] -= estimate.slope_x * desired.velocity[..., X]
    if isinstance(config.machine, RobotMachine):
        return desired, plan_robot(config, config.machine, mechanism, desired), force
    if mechanism.kind != POINT_MASS:
        check_reach(config, mechanism, desired.position, timing.support)
    return desired, plan_joints(mechanism, desired), force


def _moving_load(walk: _Walk, desired: Motion, joints: Motion) -> BodyLoad:
    """Compute the load from gravity and inertia of all masses of a machine with a body along its planned motion.

    Raises BadInput if legs that swing fast would lift it by their inertia.
    """
    config = walk.config
    machine = config.machine
    if isinstance(machine, RobotMachine):
        load = compute_load(config, joints, walk.sway)
    else:
        load = dynamic_load(walk.mechanism, machine.body_mass, desired, joints)
    if not load.force.min() > 0.0:
        reason = "swings the legs so fast that they would lift the body; use a longer one, or a lower gait.lift"
        raise BadInput("gait.cycle_time", config.gait.cycle_time, reason)
    return load


_READ = ("terrain", "gait", "controller", "force_control", "sampling_period", "reference", "machine")
_UNREAD: dict[str, Any] = {item.name: None for item in fields(Config) if item.name not in _READ}
"""Fields of a config that do not affect a plan, all set to None."""
MOST_RECALLED = 32
"""Number of results that a :class:`Recall` keeps."""


class Recall:
    """Cache of results that several runs share, by the inputs of their computation; do not change a cached result.

    A caller that makes several runs, one after the other, creates one and passes it to each of them.
    """

    def __init__(self) -> None:
        self._results = deque[tuple[Any, Any]](maxlen=MOST_RECALLED)

    def get(self, inputs: Any, compute: Callable[[], Any]) -> Any:
        """Return the cached result for equal ``inputs``, else call ``compute`` and cache its result."""
        result = next((result for other, result in self._results if other == inputs), None)
        if result is None:
            result = compute()
            self._results.appendleft((inputs, result))
        return result

    def __deepcopy__(self, memo: dict[int, Any]) -> "Recall":
        return Recall()


def make_plan(config: Config, mechanism: Mechanism, feedforward_acts: bool, recall: Recall | None = None) -> Plan:
    """Plan one cycle of a config for the ``mechanism`` of its machine.

    Unless ``feedforward_acts``, the run stays in the stage BEFORE. Raises BadInput if a foot path leaves the reach
    of its leg, or the gait is neither statically stable nor one in which a swaying body keeps its balance.
    """
    read = [vars(config)[name] for name in _READ]
    plan: Plan = (recall or Recall()).get(read, lambda: _make_plan(replace(config, **_UNREAD), mechanism))
    start = (config.first_learning - 1) * config.steps_per_cycle if feedforward_acts else NEVER
    return copy.deepcopy(plan)._replace(start_step=start)  # a run, or its user, may change the plan


def _make_plan(config: Config, mechanism: Mechanism) -> Plan:
    """Make the plan of a config that contains only the fields in ``_READ``; see :func:`make_plan`."""
    walk = _start_walk(config, mechanism)
    timing = walk.timing
    if has_body(mechanism):
        check_stability(config, timing.support, walk.margins)
    load = static_load(mechanism.weight, len(walk.feet))
    desired, joints, force = _plan_under_load(walk, load)
    if config.force_control.load_sharing != "static":
        dynamic = PATTERNS[config.gait.pattern].is_dynamic
        for _ in range(SWAY_PASSES if dynamic else LOAD_PASSES):
            load = _moving_load(walk, desired, joints)
            if dynamic:
                walk = _sway(walk, load)
            desired, joints, force = _plan_under_load(walk, load)
        if dynamic:
            centre = (force[..., None] * walk.feet).sum(axis=1) / force.sum(axis=1)[:, None]
            off = np.abs(centre - load.centre).mean()
            if not off < OUT_OF_BALANCE * mechanism.hip_height:
                tips = (
                    f"tips this body over: pressure would have to be {1e3 * off:.3g} mm outside its feet on average"
                )
                allowed = f"{tips}; use gait=wave, or a longer gait.duty_factor"
                raise BadInput("gait.pattern", config.gait.pattern, allowed)
    return Plan(
        support=timing.support,
        progress=timing.progress,
        desired=desired,
        joints=joints,
        force_desired=force,
        reference=plan_reference(config, timing.support, mechanism.hip_height, desired, force),
        load=load,
        sway=walk.sway,
        margins=walk.margins,
        start_step=NEVER,
    )


def adapt_plan(config: Config, mechanism: Mechanism, plan: Plan, estimate: LoadEstimate) -> Plan:
    """Adapt a plan to the load and ground of an ``estimate``, with the same phases and steps.

    Raises BadInput if the adapted plan is not feasible.
    """
    shift = np.array([estimate.x, estimate.y if mechanism.shape[1] == len(SPACE) else 0.0])
    walk = _start_walk(config, mechanism)
    walk = walk._replace(feet=walk.feet + shift - plan.sway.position[:, None], sway=plan.sway)
    weight = np.maximum(plan.load.force + estimate.weight, LEAST_LOAD * plan.load.force)
    centre = plan.load.mean_centre
    added = weight.mean() * (centre + np.array([estimate.x, estimate.y])) - plan.load.force.mean() * centre
    moment = plan.load.force[:, None] * plan.load.centre + added
    desired, joints, force = _plan_under_load(walk, BodyLoad(weight, moment / weight[:, None]), estimate)
    reference = plan_reference(config, plan.support, mechanism.hip_height, desired, force)
    forward, left = walk.feet[plan.support].T
    reference.position[:, plan.support, Y] -= estimate.slope_x * forward + estimate.slope_y * left
    reference.velocity[:, plan.support, Y] -= estimate.slope_x * desired.velocity[plan.support, X]
    return plan._replace(desired=desired, joints=joints, force_desired=force, reference=reference)


@dataclass(frozen=True)
class Setup:
    """Config, machine, plan and start of a run; true values for the plant, nominal ones for all other components."""

    config: Config
    """The config; all components but the plant use its :attr:`Config.nominal`."""
    mechanism: Mechanism
    plan: Plan
    start: Array
    """(L, 2): joint angles at the start, rad; of a point mass its position, m."""
    learnt: Weights | None = None
    """Weights of an earlier run, by name, with which the feedforward starts; None: it starts from zero."""
    lead: int = 0
    """``learning.lead`` in samples: feedback trains the cells of the sample that lies ``lead`` before the last
    one."""
    rate: float = 0.0
    """``learning.rate``, beta."""
    recall: Recall = field(default_factory=Recall)
    """Cache of results of earlier runs."""


class Reference(NamedTuple):
    """Planned values for one step; L is the number of legs."""

    step: int
    """Counts from 0 over the whole run."""
    sample: int
    """Counts from 0 within the cycle."""
    acting: bool
    """True if the feedforward learns and acts in this step."""
    support: Mask
    """(L,): planned phase, true in support."""
    control: ControlReference
    """Reference of the built-in controllers, (L, J) and (L,)."""
    foot_motion: Motion
    """Desired motion of the feet, (L, J)."""
    joint_motion: Motion
    """Desired motion of the joints, (L, J)."""
    force_desired: Array
    """(L,): desired contact force, N."""
