"""Assembly of the loop of a scenario from its built-in components; choice of guard and drives."""

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
from cmacexp.feedforward.kernels import TABLE, FeedforwardParams
from cmacexp.feedforward.network import BuiltInFeedforward, known_torque
from cmacexp.loop.guard import CustomWeights, Guard, NetworkWeights, SavedWeights
from cmacexp.loop.parts import ControlPart, Loop, LoopPlan, PlantPart, SensorPart, Torques
from cmacexp.loop.probe import FIRST_LEARNING
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.stop import new_limits
from cmacexp.planning.stability import STABILITY
from cmacexp.plants.analytic import AnalyticPlant
from cmacexp.plants.as_built import AsBuiltConfig
from cmacexp.plants.drives import BusConfig, Drives, new_drives
from cmacexp.plants.kernels import new_state
from cmacexp.plants.mujoco_leg import MujocoLeg
from cmacexp.plants.mujoco_plant import MujocoPlant
from cmacexp.plants.mujoco_quadruped import MujocoQuadruped
from cmacexp.plants.mujoco_robot import MujocoRobot
from cmacexp.protocols import TRAVEL, SendsDrives, TakesDrives, get_state, offers
from cmacexp.sensors import PerfectSensors, ProprioceptiveSensors, RealSensors
from cmacexp.sensors.estimator import Proprioception
from cmacexp.sensors.kernels import Observation, new_observation

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
"""Classes of built-in components, whose steps the compiled loop contains."""


class External(NamedTuple):
    """Flags of the external components of a scenario, which the loop has to call."""

    plant: bool
    sensors: bool
    controller: bool
    feedforward: bool
    """False with an external controller, which calls the feedforward itself."""


def find_external(scenario: Scenario) -> External:
    """Find the components of a scenario that the loop has to call.

    Components of the classes in :data:`COMPILED` are built in; their subclasses, which may change the step, are
    external. A subclass of a built-in feedforward is external if it overrides ``predict``; other parameters are fine.
    """
    plant, sensors, controller = (
        type(component) not in COMPILED for component in (scenario.plant, scenario.sensors, scenario.controller)
    )
    feedforward = scenario.feedforward
    is_built_in = (
        isinstance(feedforward, BuiltInFeedforward) and type(feedforward).predict is BuiltInFeedforward.predict
    )
    return External(plant, sensors, controller, feedforward=not controller and not is_built_in)


def _make_plant_part(scenario: Scenario, external: External) -> PlantPart:
    plant = scenario.plant
    if not external.plant and isinstance(plant, AnalyticPlant):
        return PlantPart(plant.state, plant.params)
    if not external.plant and isinstance(plant, MujocoPlant):
        return PlantPart(plant.state, plant.engine, plant.engine.travel, plant.signals)
    mechanism = scenario.setup.mechanism
    first = copy.deepcopy(scenario.first)
    state = new_state(mechanism.shape[0], mechanism.axes)
    for values, start in zip(get_state(state), get_state(first), strict=True):
        values[...] = start
    return PlantPart(state, travel=first.travel, signals=first.signals)


def _make_sensor_part(scenario: Scenario, external: External, plant: PlantPart) -> SensorPart:
    """Make the part of the sensors; raises BadInput if they need signals that the plant does not have."""
    sensors = scenario.sensors
    if external.sensors:
        mechanism = scenario.setup.mechanism
        observation = new_observation(mechanism.shape[0], mechanism.axes)
        return SensorPart(observation._replace(travel=copy.copy(plant.travel)))
    if isinstance(sensors, ProprioceptiveSensors):
        need = "needs a plant that gives RobotSignals; use plant=mujoco_robot"
        require(plant.signals is not None, "sensors", "proprioceptive", need)
        part = SensorPart(sensors.observation, Proprioception(sensors.sensing, sensors.estimator))
    elif isinstance(sensors, RealSensors) and sensors.sensing is not None:
        part = SensorPart(sensors.observation, sensors.sensing)
    else:
        part = SensorPart(Observation._make((*get_state(plant.state), plant.state.kinematics, None)))
    if TRAVEL in scenario.altered:
        return part
    return part._replace(observation=part.observation._replace(travel=plant.travel))


def _make_control_part(scenario: Scenario, external: External) -> ControlPart:
    controller = scenario.controller
    if not external.controller and isinstance(controller, HybridController | DriveController):
        return ControlPart(controller.state, controller.params)
    return ControlPart(new_hybrid_state(*scenario.setup.mechanism.shape))


def _find_feedforward_params(scenario: Scenario, external: External) -> FeedforwardParams | None:
    """Find the parameters of the feedforward; those of one that plays blocks are a table for its torque, N m."""
    feedforward = scenario.feedforward
    if external.controller:
        return None
    if not external.feedforward and isinstance(feedforward, BuiltInFeedforward):
        return feedforward.params
    if not offers(feedforward, Plays):
        return None
    setup = scenario.setup
    torque, feedback = np.zeros((2, *setup.plan.support.shape, setup.mechanism.shape[1]))
    return known_torque(setup, torque)._replace(feedback=feedback, block=feedforward.block)


def make_guard(scenario: Scenario) -> Guard | None:
    """Make the guard of learning for a scenario; None if nothing learns or ``learning.guard`` is ``none``.

    Raises BadInput if ``learning.guard=refine`` or ``learning.lead=estimate`` is set for custom components, which
    support neither, if the lead is to be estimated without a guard, or if the run is too short for the estimate.
    """
    feedforward = scenario.feedforward
    external = find_external(scenario)
    config = scenario.setup.config
    mode = config.learning.guard
    estimates = config.learning.lead == ESTIMATE
    is_built_in = isinstance(feedforward, BuiltInFeedforward) and not (external.controller or external.feedforward)
    if not feedforward.acts or (isinstance(feedforward, BuiltInFeedforward) and feedforward.params.kind == TABLE):
        return None
    if estimates:
        require(
            mode != NONE,
            "learning.lead",
            ESTIMATE,
            "needs learning.guard=freeze or refine; use that, or auto",
        )
        require(is_built_in, "learning.lead", ESTIMATE, f"{BUILT_IN}; use that, or auto")
        least = f"must be at least {FIRST_LEARNING} with learning.lead=estimate, which learns from that cycle on"
        require(config.cycles >= FIRST_LEARNING, "cycles", config.cycles, f"{least}; use that, or learning.lead=auto")
    if mode == NONE:
        return None
    require(is_built_in or mode != REFINE, "learning.guard", mode, f"{BUILT_IN}; use that, or freeze")
    weights = SavedWeights()
    if is_built_in and isinstance(feedforward, BuiltInFeedforward):
        weights = NetworkWeights(feedforward.params)
    elif config.record.weights and offers(feedforward, Learns):
        weights = CustomWeights(scenario)
    return Guard(scenario.setup, weights)


def _make_drives(scenario: Scenario, external: External, actuator: ActuatorConfig) -> Drives | None:
    """Make the drives that a controller commands, with delay and lag of ``actuator``; None if it gives torques only.

    An external plant with ``takes_drives`` contains the drives; those made here only hold the commands sent to it.

    Raises BadInput if the plant has no drives.
    """
    controller = scenario.controller
    plant = scenario.plant
    if not (offers(controller, SendsDrives) and controller.sends_drives):
        return None
    built = scenario.setup.config.plant
    period = scenario.setup.config.sampling_period
    limits = scenario.setup.mechanism.torque_limits
    legs = scenario.setup.mechanism.shape[0]
    if external.plant and offers(plant, TakesDrives) and plant.takes_drives:
        return new_drives(replace(actuator, delay=0, lag=0.0), BusConfig(), period, 1, limits, legs)
    has_drives = isinstance(built, MujocoRobot.Config) and not external.plant
    option = find_option("plant", read_component(built)["_target_"])
    require(has_drives, "plant", option, "must be mujoco_robot or mujoco_robot_rigid with controller=drives")
    return new_drives(actuator, built.bus, period, built.substeps, limits, legs)


def make_loop(scenario: Scenario, external: External, guard: Guard | None = None) -> Loop:
    """Make the loop of a scenario.

    It contains the parameters and states of built-in components; external ones get new arrays for their output.

    Raises BadInput if the controller needs drives, or the sensors need signals, that the plant does not have.
    """
    setup = scenario.setup
    mechanism = setup.mechanism
    actuator = setup.config.actuator
    built = setup.config.plant
    if isinstance(built, AsBuiltConfig):
        actuator = replace(actuator, delay=actuator.delay + built.delay)
    drives = _make_drives(scenario, external, actuator)
    if drives is not None:  # these contain delay and lag
        actuator = replace(actuator, delay=0, lag=0.0)
    plant = _make_plant_part(scenario, external)
    return Loop(
        plan=LoopPlan(setup.plan.support, setup.plan.reference, setup.plan.start_step),
        mechanism=mechanism,
        plant=plant,
        sensors=_make_sensor_part(scenario, external, plant),
        controller=_make_control_part(scenario, external),
        feedforward=_find_feedforward_params(scenario, external),
        guard=None if guard is None else guard.state,
        actuator=new_actuator(actuator, setup.config.sampling_period, mechanism.shape[0], mechanism.torque_limits),
        drives=drives,
        torques=Torques(feedforward=np.zeros(mechanism.shape), total=np.zeros(mechanism.shape)),
        limits=new_limits(mechanism, setup.plan.margins[:, STABILITY], setup.config.sampling_period),
        meter=new_load_meter(setup.config, mechanism),
        shows=np.ones(1, dtype=np.int64),
    )
