"""The built-in components of a scenario, and the loop made of them."""

import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cmacexp.config.schema import ESTIMATE, NONE, REFINE
from cmacexp.control import HybridController
from cmacexp.control.actuator import new_actuator
from cmacexp.control.hybrid_kernels import new_hybrid_state
from cmacexp.control.load_meter import new_load_meter
from cmacexp.errors import BadInput
from cmacexp.feedforward import Learns
from cmacexp.feedforward.kernels import TABLE
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.loop.guard import Guard
from cmacexp.loop.guard_kernels import GuardState
from cmacexp.loop.probe import FIRST_LEARNING
from cmacexp.loop.saved_weights import CustomWeights, NetworkWeights, NoWeights, SavedWeights
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.step import Loop, Torques
from cmacexp.loop.stop import StopLimits
from cmacexp.plants import AnalyticPlant
from cmacexp.plants.as_built import AsBuiltConfig
from cmacexp.plants.kernels import PlantState, new_state
from cmacexp.plants.mujoco_leg import MujocoLeg
from cmacexp.plants.mujoco_plant import MujocoPlant
from cmacexp.plants.mujoco_quadruped import MujocoQuadruped
from cmacexp.plants.mujoco_robot import MujocoRobot
from cmacexp.plants.protocol import get_state
from cmacexp.sensors import PerfectSensors, RealSensors
from cmacexp.sensors.channel import Sensing
from cmacexp.sensors.kernels import Observation, new_observation

BUILT_IN = "needs feedforward=cmac, rbf or ilc, and the built-in controller"


class External(NamedTuple):
    """Which components are external."""

    plant: bool
    sensors: bool
    controller: bool
    feedforward: bool
    """Of a built-in controller; an external controller calls its feedforward itself."""


def find_external(scenario: Scenario) -> External:
    """The components that are not built in; an object of a subclass of a built-in class is external."""
    controller, feedforward = type(scenario.controller) is not HybridController, scenario.feedforward
    known = isinstance(feedforward, BuiltInFeedforward) and type(feedforward).predict is BuiltInFeedforward.predict
    return External(
        type(scenario.plant) not in (AnalyticPlant, MujocoLeg, MujocoQuadruped, MujocoRobot),
        type(scenario.sensors) not in (PerfectSensors, RealSensors),
        controller,
        not controller and not known,
    )


def _make_observation(
    scenario: Scenario, external: External, machine: PlantState
) -> tuple[Sensing | None, Observation]:
    """Channels of the sensors, and the input of the controller: with perfect sensors the arrays of the plant."""
    sensors = scenario.sensors
    if external.sensors:
        return None, new_observation(len(machine.force), scenario.setup.mechanism.axes)
    if isinstance(sensors, RealSensors) and sensors.sensing is not None:
        return sensors.sensing, sensors.observation
    return None, Observation(*(getattr(machine, name) for name in Observation._fields))


def make_guard(scenario: Scenario, external: External) -> Guard | None:
    """The guard of learning of a scenario, None if nothing learns or nothing is to be guarded.

    Raises BadInput if it is to improve the torque of a feedforward whose weights it does not know, or to estimate the
    lead of one whose lead it cannot set, or in a run that ends before.
    """
    setup, feedforward = scenario.setup, scenario.feedforward
    config, mode, estimates = setup.config, setup.config.learning.guard, setup.config.learning.lead == ESTIMATE
    known = isinstance(feedforward, BuiltInFeedforward) and not (external.controller or external.feedforward)
    if not feedforward.acts or (isinstance(feedforward, BuiltInFeedforward) and feedforward.params.kind == TABLE):
        return None
    if estimates and mode == NONE:
        raise BadInput("learning.lead", ESTIMATE, "needs learning.guard=freeze or refine; use that, or auto")
    if estimates and not known:
        raise BadInput("learning.lead", ESTIMATE, f"{BUILT_IN}; use that, or auto")
    if estimates and config.cycles < FIRST_LEARNING:
        least = f"must be at least {FIRST_LEARNING} with learning.lead=estimate, which learns from that cycle on"
        raise BadInput("cycles", config.cycles, f"{least}; use that, or learning.lead=auto")
    if mode == NONE:
        return None
    if mode == REFINE and not known:
        raise BadInput("learning.guard", mode, f"{BUILT_IN}; use that, or freeze")
    weights: SavedWeights = NoWeights()
    if known and isinstance(feedforward, BuiltInFeedforward):
        weights = NetworkWeights(feedforward.params)
    elif config.record.weights and isinstance(feedforward, Learns):
        weights = CustomWeights(scenario)
    return Guard(setup, weights)


def make_loop(scenario: Scenario, external: External, limits: StopLimits, guard: GuardState | None = None) -> Loop:
    """The loop of a scenario: states of built-in components; of external ones only new states for their output."""
    setup, plant, controller, feedforward = (
        scenario.setup,
        None if external.plant else scenario.plant,
        None if external.controller else scenario.controller,
        None if external.controller or external.feedforward else scenario.feedforward,
    )
    mechanism, actuator, built = setup.mechanism, setup.config.actuator, setup.config.plant
    if isinstance(built, AsBuiltConfig):
        actuator = replace(actuator, delay=actuator.delay + built.delay)
    engine = plant.engine if isinstance(plant, MujocoPlant) else None
    if isinstance(plant, AnalyticPlant | MujocoPlant):
        machine, travel = plant.state, None if engine is None else engine.travel
    else:
        machine, travel = new_state(mechanism.shape[0], mechanism.axes), copy.copy(scenario.first.travel)
        for values, start in zip(machine, get_state(scenario.first), strict=False):
            values[...] = start
    return Loop(
        setup.plan.support,
        setup.plan.reference,
        setup.plan.start_step,
        mechanism,
        plant.params if isinstance(plant, AnalyticPlant) else None,
        engine,
        travel,
        machine,
        *_make_observation(scenario, external, machine),
        controller.params if isinstance(controller, HybridController) else None,
        controller.state if isinstance(controller, HybridController) else new_hybrid_state(*mechanism.shape),
        feedforward.params if isinstance(feedforward, BuiltInFeedforward) else None,
        new_actuator(actuator, setup.config.sampling_period, mechanism.shape[0], mechanism.torque_limits),
        Torques(np.zeros(mechanism.shape), np.zeros(mechanism.shape)),
        limits,
        guard,
        new_load_meter(setup.config, mechanism),
    )
