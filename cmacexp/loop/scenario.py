"""The components of one run, made from its config: of the class that each names by ``_target_``, with its fields."""

import copy
import inspect
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from typing import Any

from cmacexp.cmac.rules import derive_rate, find_rule
from cmacexp.config import ComponentConfig, Config
from cmacexp.config.check import check_memory
from cmacexp.config.component import current_folder_importable, find_class, is_shipped
from cmacexp.config.machine import PointMassMachine, RobotMachine
from cmacexp.config.schema import AUTO, NONE
from cmacexp.control.controllers import HybridController
from cmacexp.data.records import RunEnd
from cmacexp.data.weights import read_weights
from cmacexp.errors import BadComponent, BadInput, CmacexpError, format_install_command, require
from cmacexp.jit.compiler import workload
from cmacexp.jit.interrupt import exits_caught
from cmacexp.loop.margin import check_margin
from cmacexp.loop.validation import (
    SIGNAL_NAMES,
    copy_measurement,
    copy_parts,
    make_measurement_targets,
    make_targets,
    require_finite_state,
)
from cmacexp.models.loop_delay import LoopDelay, add_delays
from cmacexp.planning import Plan, Recall, Setup, make_plan
from cmacexp.planning.machine import check_load_sharing, make_mechanism
from cmacexp.plants import AnalyticPlant
from cmacexp.plants.instruments import new_instruments
from cmacexp.protocols import (
    Answers,
    Controller,
    DelaysFeedback,
    Feedforward,
    LagsFeedback,
    Learns,
    Live,
    Measurement,
    Plant,
    RobotSignals,
    Sensors,
    new_measurement,
    offers,
)
from cmacexp.sensors.perfect import find_altered
from cmacexp.typing import Array, Status, Weights

PROTOCOLS = {"plant": Plant, "sensors": Sensors, "controller": Controller, "feedforward": Feedforward}


def require_members(group: str, target: object, component: object, members: Sequence[str] = ()) -> None:
    """Require that a component has ``members``, or all that its protocol names; raises BadInput."""
    protocol = PROTOCOLS[group]
    members = members or [name for name in (*vars(protocol), *protocol.__annotations__) if name[0] != "_"]
    missing = [name for name in members if not hasattr(component, name)]
    reason = f"is not a {group}: it has no {' and no '.join(missing)}"
    require(not missing, f"{group}._target_", target, reason)


def require_class(group: str, target: object, component: type[Any], given: tuple[str, ...]) -> None:
    """Require, before anything of a class is called, that it has the methods of its protocol; raises BadInput."""
    protocol, key = PROTOCOLS[group], f"{group}._target_"
    methods = [name for name, value in vars(protocol).items() if inspect.isfunction(value) and name[0] != "_"]
    require_members(group, target, component, methods)
    for name in methods:
        taken = list(inspect.signature(vars(protocol)[name]).parameters)
        fits = _takes(component, name, taken)
        require(fits, key, target, f"is not a {group}: {name} must take ({', '.join(taken[1:])})")
    try:
        inspect.signature(component).bind(**dict.fromkeys(given))
    except TypeError as error:
        raise BadInput(key, target, f"cannot be made of its fields: {error}") from error
    except ValueError:  # a class that is not written in Python
        return


def _takes(component: type[Any], name: str, given: list[str]) -> bool:
    """Whether a method can be called with ``given``, of which the first is the object itself."""
    declared = inspect.getattr_static(component, name)
    is_bound = hasattr(declared, "__get__") and not isinstance(declared, staticmethod | classmethod)
    try:
        inspect.signature(getattr(component, name)).bind(*(given if is_bound else given[1:]))
    except TypeError:
        return False
    except ValueError:  # it is not written in Python
        return True
    return True


def make_component(group: str, node: ComponentConfig | dict[str, Any]) -> Any:
    """Make a component: with its ``Config``, if its class carries one, else with its fields as keyword arguments.

    Raises BadInput; as :class:`BadComponent` with the traceback of what its own code raised.
    """
    if isinstance(node, ComponentConfig):
        target, given = node._target_, {"config": node}
    else:
        target, given = node["_target_"], {name: value for name, value in node.items() if name != "_target_"}
    key = f"{group}._target_"
    with current_folder_importable():
        component = find_class(key, target)
        if not is_shipped(component.__module__):
            require_class(group, target, component, tuple(given))
        try:
            with exits_caught():
                made = component(**given)
        except BadInput:
            raise
        except Exception as error:
            if isinstance(error, ModuleNotFoundError) and (command := format_install_command(error.name or "")):
                raise BadInput(key, target, f"needs {error.name}, which is not installed: {command}") from error
            reason = f"cannot be made: {type(error).__name__}: {' '.join(str(error).split())}"
            raise BadComponent(key, target, reason, error) from error
    require_members(group, target, made)
    return made


GUARDED_SHARE = 0.3
"""Share of its critical gain that learning has at most which is guarded."""


@dataclass
class Scenario:
    """One run, ready to start: every component is reset. A scenario runs once."""

    setup: Setup
    plant: Plant
    sensors: Sensors
    controller: Controller
    feedforward: Feedforward
    first: Measurement
    """What the plant measures at the start."""
    fault: Exception | None = None
    """Raised by a component when it was reset: the run fails before its first step."""
    warning: str = ""
    """Says that feedback bears little delay beyond what is counted; empty if it bears more."""
    is_live: bool = field(init=False)
    """Whether the plant is not simulated."""
    altered: frozenset[str] = field(init=False)
    """Signals that the sensors may change."""
    end: RunEnd = field(init=False)
    """How the run ended; before it has, as if it ended now."""
    kept: dict[int, Weights] = field(default_factory=dict, init=False)
    """Weights of an external feedforward at the end of the best cycle, by its number, and at the start, by 0."""
    used: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self.is_live = offers(self.plant, Live)
        self.altered = find_altered(self.sensors)
        self.end = RunEnd(Status.COMPLETED, learning_lead=self.setup.lead, learning_rate=self.setup.rate)

    def begin(self) -> None:
        """Note that the run begins; raises CmacexpError if it has run: components hold their last states."""
        if self.used:
            raise CmacexpError("this scenario has run, its components hold their last states: make a new one")
        self.used = True


def count_loop_delay(config: Config, sensors: Sensors) -> LoopDelay:
    """What delays the feedback: the actuator, the sensors, and what a robot declares besides.

    Raises BadInput if sensors declare what is no delay.
    """
    uses_velocity = config.gains is None or config.gains[1] > 0.0
    name = type(sensors).__name__
    delay, lag = 0, 0.0
    if offers(sensors, DelaysFeedback):
        declared: Any = sensors.feedback_delay(uses_velocity)
        is_valid = isinstance(declared, Integral) and 0 <= int(declared) <= config.steps_per_cycle
        allowed = f"declares {declared!r}: must be a whole number from 0 to {config.steps_per_cycle}"
        require(is_valid, "sensors", f"{name}.feedback_delay", allowed)
        delay = int(declared)
    if offers(sensors, LagsFeedback):
        declared = sensors.feedback_lag(uses_velocity)
        is_valid = isinstance(declared, Real) and 0.0 <= float(declared) <= config.gait.cycle_time
        allowed = f"declares {declared!r}: must be a number from 0 to {config.gait.cycle_time:g}"
        require(is_valid, "sensors", f"{name}.feedback_lag", allowed)
        lag = float(declared)
    latency = config.machine.latency if isinstance(config.machine, RobotMachine) else 0.0
    return add_delays((config.actuator.delay, config.actuator.lag), (delay, lag), latency=latency)


def resolve_lead(config: Config, loop_delay: LoopDelay, controller: Controller) -> int:
    """``learning.lead`` in samples; ``auto`` is their number from a torque to the feedback that it causes.

    Until the first estimate of ``estimate``, that is the same. A controller may have a ``response``, samples that
    pass besides.
    """
    if isinstance(config.learning.lead, str):
        response = controller.response if offers(controller, Answers) else 0
        response = response if isinstance(response, int) else 0  # an external one may use the name otherwise
        return 1 + response + loop_delay.count_samples(config.sampling_period)
    return int(config.learning.lead)


def resolve_rate(config: Config, loop_delay: LoopDelay, lead: int) -> float:
    """``learning.rate``; ``auto`` follows from the lead in samples, and the guard of learning limits it.

    Neighbouring samples share weights: within a cycle learning is a sampled integrator behind the lateness of the
    feedback. Above its critical gain it escapes in a few samples, too few to return.
    """
    rate = derive_rate(lead) if config.learning.rate == AUTO else float(config.learning.rate)
    if config.learning.guard == NONE:
        return rate
    return min(
        rate,
        GUARDED_SHARE * loop_delay._replace(delay=loop_delay.delay + 1).find_critical_gain(config.sampling_period),
    )


def _start(config: Config, plan: Plan) -> Array:
    """Planned joint angles; a point mass starts where its config says, above the ground."""
    start: Array = plan.joints.position[0].copy()
    if isinstance(config.machine, PointMassMachine):
        start[:, 1] = config.machine.hip_height - config.machine.start_clearance
    return start


def _own(setup: Setup, component: object) -> Setup:
    """The setup for a component: a copy if it is external, so that it can change nothing for the others."""
    return setup if is_shipped(type(component).__module__) else copy.deepcopy(setup)


@exits_caught()
def _reset(setup: Setup, components: dict[str, Any]) -> Measurement:
    """Reset all components, the plant at the start; raises BadInput, BadOutput, and whatever a component raises."""
    plant, sensors, controller, feedforward = (components[group] for group in PROTOCOLS)
    nominal = replace(setup, config=setup.config.nominal)
    try:
        feedforward.reset(_own(nominal, feedforward))
    except BadInput:
        raise
    except (LookupError, TypeError, ValueError) as error:
        if setup.learnt is None:
            raise
        reason = f"its weights do not fit this feedforward ({type(error).__name__}: {error})"
        raise BadInput("learning.start_from", setup.config.learning.start_from, reason) from error
    controller.reset(_own(nominal, controller), feedforward)
    sensors.reset(_own(nominal, sensors))
    first = new_measurement(*setup.mechanism.shape)
    measured = plant.reset(_own(setup, plant))
    copy_measurement(plant, "reset", measured, make_measurement_targets(first))
    if not isinstance(plant, AnalyticPlant):  # its body may have no equilibrium: it has fallen, which is a result
        require_finite_state(plant, "reset", first)
    signals = None
    if measured.signals is not None:
        signals = new_instruments(*setup.mechanism.shape, setup.config.sampling_period).signals
        targets = make_targets(SIGNAL_NAMES, signals)
        copy_parts(plant, "reset", measured.signals, RobotSignals, targets, "signals=")
    return first._replace(travel=measured.travel, signals=signals)


def _make_components(config: Config, given: dict[str, Any]) -> dict[str, Any]:
    """Components by the key of their group, those that are ``given`` and those that the config names.

    Raises BadInput if one cannot be made, or is to keep or to start from weights and learns none.
    """
    for group, component in given.items():
        if inspect.isclass(component):
            raise BadInput(group, component.__qualname__, f"is a class: give an object, {component.__name__}(...)")
        require_members(group, type(component).__qualname__, component)
    made = {group: make_component(group, vars(config)[group]) for group in PROTOCOLS if group not in given}
    components = {**made, **given}
    if not offers(feedforward := components["feedforward"], Learns):
        learns = f"{type(feedforward).__name__} learns no weights"
        require(not config.record.weights, "record.weights", True, f"must be false: {learns}")
        start = config.learning.start_from
        require(start is None, "learning.start_from", start, f"must be null: {learns}")
    return components


@exits_caught()  # of what is asked of components besides
def make_scenario(
    config: Config, learnt: Weights | None = None, recall: Recall | None = None, **given: Any
) -> Scenario:
    """Plan the run, make its components, but for those that are ``given`` by the key of their group, and reset them.

    The feedforward starts from what is ``learnt``; None: from ``learning.start_from``, if that names a run.
    ``recall`` has what earlier runs computed. Raises BadInput if a component cannot be made, there are no weights to
    start from, or the machine cannot follow the plan.
    """
    with workload(config.cycles * config.steps_per_cycle * config.legs):
        find_rule(config.learning.rule)  # also if no feedforward uses it
        check_load_sharing(config)
        check_memory(config)
        mechanism, components = make_mechanism(config.machine), _make_components(config, given)
        sensors, controller = components["sensors"], components["controller"]
        recall = recall or Recall()
        plan = make_plan(config.nominal, mechanism, components["feedforward"].acts, recall)
        loop_delay = count_loop_delay(config, sensors)
        lead = resolve_lead(config, loop_delay, controller)
        warning = ""
        if isinstance(config.machine, RobotMachine) and isinstance(controller, HybridController):
            warning = check_margin(config, controller.config, loop_delay)
        known = read_weights(config) if learnt is None else learnt
        rate = resolve_rate(config, loop_delay, lead)
        setup = Setup(config, mechanism, plan, _start(config, plan), known, lead, rate, recall)
        first, fault = new_measurement(*mechanism.shape), None
        try:
            first = _reset(setup, components)
        except BadInput:
            raise
        except Exception as error:
            fault = error
        return Scenario(setup, **components, first=first, fault=fault, warning=warning)
