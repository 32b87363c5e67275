"""The built-in components of a scenario, and the loop made of them."""

import copy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from cmacexp.config.component import find_option
from cmacexp.config.schema import ESTIMATE, NONE, REFINE, ActuatorConfig, read_component
from cmacexp.control import DriveController, HybridController
from cmacexp.control.actuator import new_actuator
from cmacexp.control.hybrid_kernels import new_hybrid_state
from cmacexp.control.load_meter import new_load_meter
from cmacexp.errors import require
from cmacexp.feedforward import Learns, Plays
from cmacexp.feedforward.kernels import TABLE
from cmacexp.feedforward.network import BuiltInFeedforward, known_torque
from cmacexp.loop.guard import Guard
from cmacexp.loop.probe import FIRST_LEARNING
from cmacexp.loop.saved_weights import CustomWeights, NetworkWeights, SavedWeights
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.step import Loop, Torques
from cmacexp.loop.stop import new_limits
from cmacexp.planning.stability import STABILITY
from cmacexp.plants.analytic import AnalyticPlant
from cmacexp.plants.as_built import AsBuiltConfig
from cmacexp.plants.drives import BusConfig, Drives, new_drives
from cmacexp.plants.kernels import new_state
from cmacexp.plants.mujoco_leg import MujocoLeg
from cmacexp.plants.mujoco_quadruped import MujocoQuadruped
from cmacexp.plants.mujoco_robot import MujocoRobot
from cmacexp.protocols import TRAVEL, SendsDrives, TakesDrives, get_state, offers
from cmacexp.sensors import PerfectSensors, ProprioceptiveSensors, RealSensors
from cmacexp.sensors.estimator import Proprioception
from cmacexp.sensors.kernels import Observation, new_observation
from cmacexp.typing import KernelParts

BUILT_IN = "needs feedforward=cmac, rbf or ilc, and the built-in controller"


COMPILED: tuple[type[Any], ...] = (
    AnalyticPlant,
    MujocoLeg,
    MujocoQuadruped,
    MujocoRobot,
    PerfectSensors,
    ProprioceptiveSensors,
    RealSensors,
    HybridController,
    DriveController,
)
"""Classes whose steps the loop has compiled."""


class External(NamedTuple):
    """Which components are external."""

    plant: bool
    sensors: bool
    controller: bool
    feedforward: bool
    """Whether that of a built-in controller is; an external controller calls its feedforward itself."""


def find_external(scenario: Scenario) -> External:
    """The components that the loop has to call.

    It runs those of :data:`COMPILED` by itself; a subclass may do something else in a step. Of a built-in feedforward
    a subclass may declare other params, but not another ``predict``.
    """
    plant, sensors, controller = (
        type(component) not in COMPILED for component in (scenario.plant, scenario.sensors, scenario.controller)
    )
    feedforward = scenario.feedforward
    known = isinstance(feedforward, BuiltInFeedforward) and type(feedforward).predict is BuiltInFeedforward.predict
    return External(plant, sensors, controller, feedforward=not controller and not known)


def _get_parts(component: Any) -> KernelParts:
    return component.kernel_parts()  # type: ignore[no-any-return]


def make_guard(scenario: Scenario) -> Guard | None:
    """The guard of learning of a scenario, None if nothing learns or nothing is to be guarded.

    Raises BadInput if it is to improve the torque of a feedforward whose weights it does not know, or to estimate the
    lead of one whose lead it cannot set, or in a run that ends before.
    """
    setup, feedforward, external = scenario.setup, scenario.feedforward, find_external(scenario)
    config = setup.config
    mode = config.learning.guard
    estimates = config.learning.lead == ESTIMATE
    known = isinstance(feedforward, BuiltInFeedforward) and not (external.controller or external.feedforward)
    if not feedforward.acts or (isinstance(feedforward, BuiltInFeedforward) and feedforward.params.kind == TABLE):
        return None
    if estimates:
        is_guarded = mode != NONE
        require(is_guarded, "learning.lead", ESTIMATE, "needs learning.guard=freeze or refine; use that, or auto")
        require(known, "learning.lead", ESTIMATE, f"{BUILT_IN}; use that, or auto")
        least = f"must be at least {FIRST_LEARNING} with learning.lead=estimate, which learns from that cycle on"
        require(config.cycles >= FIRST_LEARNING, "cycles", config.cycles, f"{least}; use that, or learning.lead=auto")
    if mode == NONE:
        return None
    require(known or mode != REFINE, "learning.guard", mode, f"{BUILT_IN}; use that, or freeze")
    weights = SavedWeights()
    if known and isinstance(feedforward, BuiltInFeedforward):
        weights = NetworkWeights(feedforward.params)
    elif config.record.weights and offers(feedforward, Learns):
        weights = CustomWeights(scenario)
    return Guard(setup, weights)


def _make_drives(scenario: Scenario, external: External, actuator: ActuatorConfig) -> Drives | None:
    """The drives that a controller commands, with the delay and lag of ``actuator``; None: it gives torques.

    An external plant with ``takes_drives`` has drives of its own: these hold what is sent to it.

    Raises BadInput if the plant has none.
    """
    controller, plant = scenario.controller, scenario.plant
    if not (offers(controller, SendsDrives) and controller.sends_drives):
        return None
    built = scenario.setup.config.plant
    mechanism, period = scenario.setup.mechanism, scenario.setup.config.sampling_period
    limits, legs = mechanism.torque_limits, mechanism.shape[0]
    if external.plant and offers(plant, TakesDrives) and plant.takes_drives:
        return new_drives(replace(actuator, delay=0, lag=0.0), BusConfig(), period, 1, limits, legs)
    has_drives = isinstance(built, MujocoRobot.Config) and not external.plant
    option = find_option("plant", read_component(built)["_target_"])
    require(has_drives, "plant", option, "must be mujoco_robot or mujoco_robot_rigid with controller=drives")
    return new_drives(actuator, built.bus, period, built.substeps, limits, legs)


def make_loop(scenario: Scenario, external: External, guard: Guard | None = None) -> Loop:
    """The loop of a scenario: states of built-in components; of external ones only new states for their output.

    Raises BadInput if controller or sensors need drives or signals that the plant does not have.
    """
    setup = scenario.setup
    mechanism = setup.mechanism
    actuator = setup.config.actuator
    built = setup.config.plant
    if isinstance(built, AsBuiltConfig):
        actuator = replace(actuator, delay=actuator.delay + built.delay)
    drives = _make_drives(scenario, external, actuator)
    if drives is not None:  # which delay their commands themselves
        actuator = replace(actuator, delay=0, lag=0.0)
    if external.plant:  # a state for its output, as it measured itself at the start
        machine, first = new_state(mechanism.shape[0], mechanism.axes), scenario.first
        for values, start in zip(get_state(machine), get_state(first), strict=True):
            values[...] = start
        signals = copy.deepcopy(first.signals)
        parts: dict[str, Any] = {"plant_state": machine, "travel": copy.copy(first.travel), "signals": signals}
    else:
        parts = dict(_get_parts(scenario.plant))
    if external.sensors:
        parts["observation"] = new_observation(mechanism.shape[0], mechanism.axes)._replace(
            travel=copy.copy(parts.get("travel"))
        )
    else:  # with perfect sensors the controller sees the arrays of the plant
        machine = parts["plant_state"]
        parts["observation"] = Observation._make((*get_state(machine), machine.kinematics, None))
        parts |= _get_parts(scenario.sensors)
        has_signals = not isinstance(parts.get("sensing"), Proprioception) or parts.get("signals") is not None
        reason = "needs a plant that gives RobotSignals; use plant=mujoco_robot"
        require(has_signals, "sensors", "proprioceptive", reason)
        if TRAVEL not in scenario.altered:
            parts["observation"] = parts["observation"]._replace(travel=parts.get("travel"))
    parts["control_state"] = new_hybrid_state(*mechanism.shape)
    if not external.controller:
        parts |= _get_parts(scenario.controller)
        if not external.feedforward:
            parts |= _get_parts(scenario.feedforward)
        elif offers(player := scenario.feedforward, Plays):
            torque, feedback = np.zeros((2, *setup.plan.support.shape, mechanism.shape[1]))
            parts["feedforward"] = known_torque(setup, torque)._replace(feedback=feedback, block=player.block)
    return Loop(
        support=setup.plan.support,
        reference=setup.plan.reference,
        start_step=setup.plan.start_step,
        mechanism=mechanism,
        actuator=new_actuator(actuator, setup.config.sampling_period, mechanism.shape[0], mechanism.torque_limits),
        torques=Torques(feedforward=np.zeros(mechanism.shape), total=np.zeros(mechanism.shape)),
        limits=new_limits(mechanism, setup.plan.margins[:, STABILITY], setup.config.sampling_period),
        shows=np.ones(1, dtype=np.int64),
        guard=None if guard is None else guard.state,
        meter=new_load_meter(setup.config, mechanism),
        drives=drives,
        **parts,
    )
