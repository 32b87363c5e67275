"""Scenarios: the components of one run, made from its config by the class and the fields that each group names."""

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
from cmacexp.control.controllers import DriveController, HybridController
from cmacexp.data.records import RunEnd
from cmacexp.data.weights import read_weights
from cmacexp.errors import BadComponent, BadInput, CmacexpError, format_install_command, require
from cmacexp.jit.compiler import workload
from cmacexp.jit.interrupt import exits_caught
from cmacexp.loop.margin import check_drives, check_margin, judge_walk
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
"""Protocol of each group of components, by key of the config."""


def require_members(group: str, target: object, component: object, members: Sequence[str] = ()) -> None:
    """Check that a component has ``members``, or all members of the protocol of its group; raises BadInput."""
    protocol = PROTOCOLS[group]
    members = members or [name for name in (*vars(protocol), *protocol.__annotations__) if name[0] != "_"]
    missing = [name for name in members if not hasattr(component, name)]
    reason = f"is not a {group}: it has no {' and no '.join(missing)}"
    require(not missing, f"{group}._target_", target, reason)


def require_class(group: str, target: object, component: type[Any], fields: tuple[str, ...]) -> None:
    """Check a component class before any of its code runs; raises BadInput.

    Its methods must have the signatures of the protocol of ``group``, and its constructor must accept ``fields`` as
    keyword arguments. ``target`` is its name for messages.
    """
    protocol = PROTOCOLS[group]
    key = f"{group}._target_"
    methods = [name for name, value in vars(protocol).items() if inspect.isfunction(value) and name[0] != "_"]
    require_members(group, target, component, methods)
    for name in methods:
        parameters = list(inspect.signature(vars(protocol)[name]).parameters)
        fits = _accepts(component, name, parameters)
        require(fits, key, target, f"is not a {group}: {name} must take ({', '.join(parameters[1:])})")
    try:
        inspect.signature(component).bind(**dict.fromkeys(fields))
    except TypeError as error:
        raise BadInput(key, target, f"cannot be made of its fields: {error}") from error
    except ValueError:  # a class that is not written in Python
        return


def _accepts(component: type[Any], name: str, parameters: list[str]) -> bool:
    """Return True if method ``name`` accepts ``parameters`` by position, the first of which is ``self``."""
    declared = inspect.getattr_static(component, name)
    is_bound = hasattr(declared, "__get__") and not isinstance(declared, staticmethod | classmethod)
    try:
        inspect.signature(getattr(component, name)).bind(*(parameters if is_bound else parameters[1:]))
    except TypeError:
        return False
    except ValueError:  # it is not written in Python
        return True
    return True


def make_component(group: str, node: ComponentConfig | dict[str, Any]) -> Any:
    """Make the component of ``group`` that ``node`` of the config describes.

    Its class gets the keyword argument ``config`` if the node is a ComponentConfig, else the fields of the node.

    Raises BadInput; if the code of the component raised an exception, as :class:`BadComponent` with its traceback.
    """
    fields: dict[str, Any] = (
        {"_target_": node._target_, "config": node} if isinstance(node, ComponentConfig) else dict(node)
    )
    target = fields.pop("_target_")
    key = f"{group}._target_"
    with current_folder_importable():
        component_class = find_class(key, target)
        if not is_shipped(component_class.__module__):
            require_class(group, target, component_class, tuple(fields))
        try:
            with exits_caught():
                component = component_class(**fields)
        except BadInput:
            raise
        except Exception as error:
            if isinstance(error, ModuleNotFoundError) and (command := format_install_command(error.name or "")):
                raise BadInput(key, target, f"needs {error.name}, which is not installed: {command}") from error
            reason = f"cannot be made: {type(error).__name__}: {' '.join(str(error).split())}"
            raise BadComponent(key, target, reason, error) from error
    require_members(group, target, component)
    return component


GUARDED_SHARE = 0.3
"""Largest learning rate of guarded learning relative to the critical gain."""


@dataclass
class Scenario:
    """The components of one run, reset and ready to start. A scenario can run only once."""

    setup: Setup
    plant: Plant
    sensors: Sensors
    controller: Controller
    feedforward: Feedforward
    first: Measurement
    """Measurement of the plant at the start."""
    fault: Exception | None = None
    """Exception that a component raised when it was reset: the run fails before its first step."""
    warnings: Sequence[str] = ()
    """Reasons why a robot may fall: too little torque, or a small margin of delay, damping or roll stiffness."""
    is_live: bool = field(init=False)
    """True if the plant is not simulated."""
    altered: frozenset[str] = field(init=False)
    """Names of the signals that the sensors may alter."""
    end: RunEnd = field(init=False)
    """Outcome of the run; during the run, the outcome if it ended now."""
    kept: dict[int, Weights] = field(default_factory=dict, init=False)
    """Weights of an external feedforward by cycle: at the end of the best cycle, and at the start of the run (0)."""
    used: bool = field(default=False, init=False)
    """True once the run has begun."""

    def __post_init__(self) -> None:
        self.is_live = offers(self.plant, Live)
        self.altered = find_altered(self.sensors)
        self.end = RunEnd(Status.COMPLETED, learning_lead=self.setup.lead, learning_rate=self.setup.rate)

    def begin(self) -> None:
        """Mark the scenario as used; raises CmacexpError if it has run, since its components keep their states."""
        if self.used:
            raise CmacexpError("this scenario has run, its components hold their last states: make a new one")
        self.used = True


def count_loop_delay(config: Config, sensors: Sensors) -> LoopDelay:
    """Add up the declared delays and lags of the loop: actuator, sensors, and latency of a robot.

    Raises BadInput if the sensors declare an invalid delay or lag.
    """
    uses_velocity = config.gains is None or config.gains[1] > 0.0
    name = type(sensors).__name__
    delay = 0
    lag = 0.0
    if offers(sensors, DelaysFeedback):
        declared: Any = sensors.feedback_delay(uses_velocity)
        is_valid = isinstance(declared, Integral) and 0 <= int(declared) <= config.steps_per_cycle
        require(
            is_valid,
            "sensors",
            f"{name}.feedback_delay",
            f"declares {declared!r}: must be a whole number from 0 to {config.steps_per_cycle}",
        )
        delay = int(declared)
    if offers(sensors, LagsFeedback):
        declared = sensors.feedback_lag(uses_velocity)
        is_valid = isinstance(declared, Real) and 0.0 <= float(declared) <= config.gait.cycle_time
        require(
            is_valid,
            "sensors",
            f"{name}.feedback_lag",
            f"declares {declared!r}: must be a number from 0 to {config.gait.cycle_time:g}",
        )
        lag = float(declared)
    latency = config.machine.latency if isinstance(config.machine, RobotMachine) else 0.0
    return add_delays((config.actuator.delay, config.actuator.lag), (delay, lag), latency=latency)


def resolve_lead(config: Config, loop_delay: LoopDelay, controller: Controller) -> int:
    """Return ``learning.lead`` as a number of samples.

    ``auto`` counts the samples from a torque to the feedback that it causes, by the declared delays and the
    ``response`` of the controller, if it has one. ``estimate`` starts with the same value.
    """
    if isinstance(config.learning.lead, str):
        response = controller.response if offers(controller, Answers) else 0
        if not isinstance(response, int):  # a custom controller may use the name for something else
            response = 0
        return 1 + response + loop_delay.count_samples(config.sampling_period)
    return int(config.learning.lead)


def resolve_rate(config: Config, loop_delay: LoopDelay, lead: int) -> float:
    """Return ``learning.rate`` as a number.

    ``auto`` derives it from ``lead``, in samples; a guard limits any rate to GUARDED_SHARE of the critical gain.
    Neighbouring samples share weights, so that learning within a cycle acts as a sampled integrator with the delay of
    the feedback. Above its critical gain it diverges within a few samples, too fast for the guard.
    """
    rate = derive_rate(lead) if config.learning.rate == AUTO else float(config.learning.rate)
    if config.learning.guard == NONE:
        return rate
    return min(
        rate,
        GUARDED_SHARE * loop_delay._replace(delay=loop_delay.delay + 1).find_critical_gain(config.sampling_period),
    )


def _start(config: Config, plan: Plan) -> Array:
    """Return the initial joint angles (L, J), rad: the planned ones; a point mass starts at its clearance, m."""
    start: Array = plan.joints.position[0].copy()
    if isinstance(config.machine, PointMassMachine):
        start[:, 1] = config.machine.hip_height - config.machine.start_clearance
    return start


def _isolate(setup: Setup, component: object) -> Setup:
    """Return the setup for a component: a copy for an external one, which could modify it."""
    return setup if is_shipped(type(component).__module__) else copy.deepcopy(setup)


@exits_caught()
def _reset(setup: Setup, components: dict[str, Any]) -> Measurement:
    """Reset all components and return the first measurement of the plant.

    Components other than the plant get the nominal config. Raises BadInput, BadOutput, and any exception of a
    component.
    """
    plant, sensors, controller, feedforward = (components[group] for group in PROTOCOLS)
    nominal = replace(setup, config=setup.config.nominal)
    try:
        feedforward.reset(_isolate(nominal, feedforward))
    except BadInput:
        raise
    except (LookupError, TypeError, ValueError) as error:
        if setup.learnt is None:
            raise
        reason = f"its weights do not fit this feedforward ({type(error).__name__}: {error})"
        raise BadInput("learning.start_from", setup.config.learning.start_from, reason) from error
    controller.reset(_isolate(nominal, controller), feedforward)
    sensors.reset(_isolate(nominal, sensors))
    first = new_measurement(*setup.mechanism.shape)
    measured = plant.reset(_isolate(setup, plant))
    copy_measurement(plant, "reset", measured, make_measurement_targets(first))
    if not isinstance(plant, AnalyticPlant):  # without an equilibrium its body has fallen: a valid result
        require_finite_state(plant, "reset", first)
    signals = None
    if measured.signals is not None:
        signals = new_instruments(*setup.mechanism.shape, setup.config.sampling_period).signals
        targets = make_targets(SIGNAL_NAMES, signals)
        copy_parts(plant, "reset", measured.signals, RobotSignals, targets, "signals=")
    return first._replace(travel=measured.travel, signals=signals)


def _make_components(config: Config, objects: dict[str, Any]) -> dict[str, Any]:
    """Return all components by group: ``objects`` passed by the caller, and the others made from the config.

    Raises BadInput if one cannot be made, or if weights are to be recorded or loaded for a feedforward without any.
    """
    for group, component in objects.items():
        if inspect.isclass(component):
            raise BadInput(group, component.__qualname__, f"is a class: give an object, {component.__name__}(...)")
        require_members(group, type(component).__qualname__, component)
    groups = [group for group in PROTOCOLS if group not in objects]
    components = {group: make_component(group, vars(config)[group]) for group in groups} | objects
    if not offers(feedforward := components["feedforward"], Learns):
        learns = f"{type(feedforward).__name__} learns no weights"
        require(not config.record.weights, "record.weights", True, f"must be false: {learns}")
        start = config.learning.start_from
        require(start is None, "learning.start_from", start, f"must be null: {learns}")
    return components


@exits_caught()  # of the optional methods of components
def make_scenario(
    config: Config, learnt: Weights | None = None, recall: Recall | None = None, **objects: Any
) -> Scenario:
    """Plan a run, make its components and reset them.

    Args:
        config: config of the run.
        learnt: initial weights of the feedforward; None: those of the run that ``learning.start_from`` names, if any.
        recall: cache of plans and other results of earlier runs.
        objects: components by the key of their group; the others are made from the config.

    Raises:
        BadInput: a component cannot be made, the initial weights do not exist, or the machine cannot follow the plan.
    """
    with workload(config.cycles * config.steps_per_cycle * config.legs):
        find_rule(config.learning.rule)  # to refuse a bad rule, even if no feedforward uses it
        check_load_sharing(config)
        check_memory(config)
        mechanism = make_mechanism(config.machine)
        components = _make_components(config, objects)
        controller = components["controller"]
        recall = recall or Recall()
        plan = make_plan(config.nominal, mechanism, components["feedforward"].acts, recall)
        loop_delay = count_loop_delay(config, components["sensors"])
        lead = resolve_lead(config, loop_delay, controller)
        warnings = list[str]()
        if isinstance(config.machine, RobotMachine) and isinstance(controller, HybridController):
            warnings.append(check_margin(config, controller.config, loop_delay))
        if isinstance(config.machine, RobotMachine) and isinstance(controller, DriveController):
            warnings.append(check_drives(config, controller.config))
        if isinstance(config.machine, RobotMachine) and config.warn:
            warnings += judge_walk(config, mechanism, plan).list_warnings()
        weights = read_weights(config) if learnt is None else learnt
        rate = resolve_rate(config, loop_delay, lead)
        setup = Setup(config, mechanism, plan, _start(config, plan), weights, lead, rate, recall)
        fault = None
        try:
            first = _reset(setup, components)
        except BadInput:
            raise
        except Exception as error:
            first = new_measurement(*mechanism.shape)
            fault = error
        warnings = [text for text in warnings if text]
        return Scenario(setup, **components, first=first, fault=fault, warnings=warnings)
