"""The plan of a cycle: phases, desired motion and force of every foot, and the reference of the controller.

A :class:`Setup` holds it with all else that components know at the start of a run.
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
"""Forces depress the feet, which moves the masses that cause them: one pass reduces the error a thousandfold."""
SWAY_PASSES = 8
"""Each reduces the moments that are out of balance to a third, or to less."""
OUT_OF_BALANCE = 0.005
"""Mean distance of the centre of pressure from where it should be, over the height of the hips, that is too much."""
LEAST_LOAD = 0.1
"""Share of the planned load that the feet always share."""


class Plan(NamedTuple):
    """One cycle of N samples for L legs; it repeats. Frames and signs as in the trace."""

    support: Mask
    """(N, L): whether the foot is planned to support."""
    progress: Array
    """(N, L): 0 to 1 within the phase."""
    desired: Motion
    """Motion of the feet, each in the frame of its hip."""
    joints: Motion
    """The same motion in joint angles; of a point mass equal to ``desired``."""
    force_desired: Array
    """(N, L): desired contact force, N."""
    reference: ControlReference
    """What the controller follows, per stage."""
    load: BodyLoad
    """What the feet of a body share."""
    sway: Motion
    """Motion of a body beside its constant speed, (N, 2), forward and left."""
    margins: Array
    """(N, 3): stability margin, front and rear margin of a body over its planned support polygon, m; else NaN."""
    start_step: int
    """First step at which the feedforward learns and acts; beyond any run if there is none."""


class LoadEstimate(NamedTuple):
    """What a body met in a cycle that its plan did not know."""

    weight: float
    """Weight that its feet carried beyond the planned one, N."""
    x: float
    """How far forward of where the plan has it the centre of the load was, m."""
    y: float
    """How far to the left of it, m."""
    slope_x: float
    """Rise of the ground forward, m/m."""
    slope_y: float
    """Rise of the ground to the left, m/m."""


NOTHING = LoadEstimate(0.0, 0.0, 0.0, 0.0, 0.0)


class _Walk(NamedTuple):
    """Where body and feet are over a cycle, before the feet share a load."""

    config: Config
    mechanism: Mechanism
    timing: Timing
    forward: Motion
    """(N, L): of every foot in the frame of its hip, along x."""
    feet: Array
    """(N, L, 2): forward and left of the body's centre, m."""
    sway: Motion
    margins: Array
    """(N, 3): of the plan, before the body sways."""


def _start_walk(config: Config, mechanism: Mechanism) -> _Walk:
    """Start a walk without sway, which follows from machine and gait alone."""
    timing = make_timing(config.gait, config.steps_per_cycle)
    forward = plan_horizontal(config, timing)
    feet = np.zeros((*timing.support.shape, 2))
    feet[..., 0] = forward.position
    feet += mechanism.hips
    still = Motion(*np.zeros((3, len(feet), 2)))
    return _Walk(config, mechanism, timing, forward, feet, still, margins(feet, timing.support))


def _sway(walk: _Walk, load: BodyLoad) -> _Walk:
    """The body sways so that the feet can give the centre of pressure that the ``load`` needs."""
    config, sway = walk.config, walk.sway
    missing = find_pressure(walk.feet, plan_load_fraction(config, walk.timing)[0], load.centre) - load.centre
    more = find_sway(missing, walk.mechanism.hip_height, config.sampling_period)
    swaying = Motion(*(old + new for old, new in zip(sway, more, strict=True)))
    return walk._replace(feet=walk.feet - more.position[:, None], sway=swaying)


def _plan_under_load(walk: _Walk, load: BodyLoad, met: LoadEstimate = NOTHING) -> tuple[Motion, Motion, Array]:
    """Desired motion of feet that share a load, the same of joints, and desired forces (N, L), N."""
    config, mechanism, timing, forward, feet, sway, _ = walk
    force, rate = plan_force(config, timing, feet, load)
    desired = plan_motion(config, timing, mechanism, forward, force, rate)
    horizontal = [X, Z][: mechanism.shape[1] - 1]
    for values, swaying in zip(desired, sway, strict=True):
        values[..., horizontal] -= swaying[:, None, : len(horizontal)]
    desired.position[..., horizontal] += (met.x, met.y)[: len(horizontal)]
    desired.position[..., Y] -= met.slope_x * feet[..., 0] + met.slope_y * feet[..., 1]
    desired.velocity[..., Y] -= met.slope_x * desired.velocity[..., X]
    if isinstance(config.machine, RobotMachine):
        return desired, plan_robot(config, config.machine, mechanism, desired), force
    if mechanism.kind != POINT_MASS:
        check_reach(config, mechanism, desired.position)
    return desired, plan_joints(mechanism, desired), force


def _moving_load(walk: _Walk, desired: Motion, joints: Motion) -> BodyLoad:
    """Gravity and inertia of all masses of a machine with a body along its planned motion.

    Raises BadInput if legs that swing fast would lift it by their inertia.
    """
    config, machine = walk.config, walk.config.machine
    if isinstance(machine, RobotMachine):
        load = compute_load(config, joints, walk.sway)
    else:
        load = dynamic_load(walk.mechanism, machine.body_mass, desired, joints)
    if not load.force.min() > 0.0:
        reason = "swings the legs so fast that they would lift the body; use a longer one, or a lower gait.lift"
        raise BadInput("gait.cycle_time", config.gait.cycle_time, reason)
    return load


_READ = ("terrain", "gait", "controller", "force_control", "sampling_period", "reference", "machine")
_UNREAD: dict[str, Any] = {each.name: None for each in fields(Config) if each.name not in _READ}
"""Fields of a config that a plan does not follow from."""
MOST_RECALLED = 32
"""Results that a :class:`Recall` keeps."""


class Recall:
    """Results that many runs share, by the inputs that they follow from; nothing may change them.

    Whoever makes many runs, one after the other, keeps it, and hands it to each of them.
    """

    def __init__(self) -> None:
        self._results = deque[tuple[Any, Any]](maxlen=MOST_RECALLED)

    def get(self, inputs: Any, compute: Callable[[], Any]) -> Any:
        """Return the result for ``inputs``, as recalled or as ``compute`` gives it now."""
        result = next((result for other, result in self._results if other == inputs), None)
        if result is None:
            result = compute()
            self._results.appendleft((inputs, result))
        return result

    def __deepcopy__(self, memo: dict[int, Any]) -> "Recall":
        return Recall()


def make_plan(config: Config, mechanism: Mechanism, feedforward_acts: bool, recall: Recall | None = None) -> Plan:
    """Plan one cycle of a config, whose machine is given as ``mechanism``, too.

    Without a feedforward that acts it stays in the stage BEFORE. Raises BadInput if a foot path leaves the reach of
    its leg, or the gait is neither statically stable nor one in which a swaying body keeps its balance.
    """
    read = [vars(config)[name] for name in _READ]
    plan: Plan = (recall or Recall()).get(read, lambda: _make_plan(replace(config, **_UNREAD), mechanism))
    start = (config.first_learning - 1) * config.steps_per_cycle if feedforward_acts else NEVER
    return copy.deepcopy(plan)._replace(start_step=start)  # a run, or its user, may change its own


def _make_plan(config: Config, mechanism: Mechanism) -> Plan:
    """:func:`make_plan` of a config that has nothing but what is read here."""
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


def adapt_plan(config: Config, mechanism: Mechanism, plan: Plan, met: LoadEstimate) -> Plan:
    """The plan of a body that carries and meets what it ``met``, with the same steps; raises BadInput."""
    shift = np.array([met.x, met.y if mechanism.shape[1] == len(SPACE) else 0.0])
    walk = _start_walk(config, mechanism)
    walk = walk._replace(feet=walk.feet + shift - plan.sway.position[:, None], sway=plan.sway)
    weight = np.maximum(plan.load.force + met.weight, LEAST_LOAD * plan.load.force)
    centre, planned = plan.load.mean_centre, plan.load.force.mean()
    added = weight.mean() * (centre + np.array([met.x, met.y])) - planned * centre
    moment = plan.load.force[:, None] * plan.load.centre + added
    desired, joints, force = _plan_under_load(walk, BodyLoad(weight, moment / weight[:, None]), met)
    reference = plan_reference(config, plan.support, mechanism.hip_height, desired, force)
    forward, left = walk.feet[plan.support].T
    reference.position[:, plan.support, Y] -= met.slope_x * forward + met.slope_y * left
    reference.velocity[:, plan.support, Y] -= met.slope_x * desired.velocity[plan.support, X]
    return plan._replace(desired=desired, joints=joints, force_desired=force, reference=reference)


@dataclass(frozen=True)
class Setup:
    """Config, machine, plan and start of a run; those of the plant are true, all others get what is nominal."""

    config: Config
    """The config; all but the plant use :attr:`Config.nominal` of it."""
    mechanism: Mechanism
    plan: Plan
    start: Array
    """(L, 2): joint angles at the start, rad; of a point mass its position, m."""
    learnt: Weights | None = None
    """Weights of an earlier run that the feedforward starts from, by their names; None: it starts from nothing."""
    lead: int = 0
    """``learning.lead`` in samples: feedback trains the cells of so many samples before the last one."""
    rate: float = 0.0
    """``learning.rate``, beta."""
    recall: Recall = field(default_factory=Recall)
    """What earlier runs computed."""


class Reference(NamedTuple):
    """What the plan prescribes for one step; L is the number of legs."""

    step: int
    """Counts from 0 over the whole run."""
    sample: int
    """Counts from 0 within the cycle."""
    acting: bool
    """Whether the feedforward learns and acts in this step."""
    support: Mask
    """(L,): planned phase, true in support."""
    control: ControlReference
    """What the built-in controllers follow, (L, J) and (L,)."""
    foot_motion: Motion
    """Desired, (L, J)."""
    joint_motion: Motion
    """The same in joint angles, (L, J)."""
    force_desired: Array
    """(L,): N."""
