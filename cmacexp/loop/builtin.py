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


def _get_parts(component: Any) -> KernelParts:
    return component.kernel_parts()  # type: ignore[no-any-return]


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
    if external.plant:
        first = copy.deepcopy(scenario.first)
        machine = new_state(mechanism.shape[0], mechanism.axes)
        for values, start in zip(get_state(machine), get_state(first), strict=True):
            values[...] = start
        parts: dict[str, Any] = {"plant_state": machine, "travel": first.travel, "signals": first.signals}
    else:
        parts = dict(_get_parts(scenario.plant))
    if external.sensors:
        parts["observation"] = new_observation(mechanism.shape[0], mechanism.axes)._replace(
            travel=copy.copy(parts.get("travel"))
        )
    else:  # with perfect sensors the controller reads the arrays of the plant
        machine = parts["plant_state"]
        parts["observation"] = Observation._make((*get_state(machine), machine.kinematics, None))
        parts |= _get_parts(scenario.sensors)
        has_signals = not isinstance(parts.get("sensing"), Proprioception) or parts.get("signals") is not None
        require(
            has_signals,
            "sensors",
            "proprioceptive",
            "needs a plant that gives RobotSignals; use plant=mujoco_robot",
        )
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
