"""The parts of one run, built from its config."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from hydra.errors import InstantiationException
from hydra.utils import instantiate

from cmacexp.arrays import Array
from cmacexp.config import Config, to_plain
from cmacexp.config.schema import LegConfig, LegMachine, PointMassMachine, QuadrupedMachine
from cmacexp.control import Controller, Feedforward
from cmacexp.errors import BadInput
from cmacexp.models.leg import Leg
from cmacexp.models.mechanism import Mechanism, legs_on_stand, legs_under_body, point_mass
from cmacexp.planning import Plan, Setup, make_plan
from cmacexp.plants import Measurement, Plant
from cmacexp.sensors import Sensors


@dataclass(frozen=True)
class Scenario:
    """One run, ready to start: every part is reset. A scenario runs once."""

    setup: Setup
    plant: Plant
    sensors: Sensors
    controller: Controller
    feedforward: Feedforward
    first: Measurement
    """Of the plant at the start."""


def make_leg(config: LegConfig) -> Leg:
    """The leg that a config describes."""
    knee = -1.0 if config.knee == "back" else 1.0
    return Leg(config.length_1, config.length_2, config.mass_1, config.mass_2, knee)


def make_mechanism(machine: LegMachine | PointMassMachine | QuadrupedMachine) -> Mechanism:
    """The machine that a config describes."""
    if isinstance(machine, PointMassMachine):
        return point_mass(machine.mass, machine.hip_height)
    if isinstance(machine, QuadrupedMachine):
        legs = [make_leg(leg) for leg in machine.legs.in_order]
        return legs_under_body(legs, machine.hip_height, machine.hips, machine.total_weight)
    return legs_on_stand([make_leg(machine.leg)], machine.hip_height)


def _start(config: Config, plan: Plan) -> Array:
    """Planned joint angles; a point mass starts where its config says, above the ground."""
    start = plan.joints[0, :, :2].copy()
    if isinstance(config.machine, PointMassMachine):
        start[:, 1] = config.machine.hip_height - config.machine.start_clearance
    return start


METHODS = {
    "plant": ("reset", "step"),
    "sensors": ("reset", "measure"),
    "controller": ("reset", "act"),
    "feedforward": ("reset", "predict", "acts"),
}
"""What each part must have."""


def _build(config: Config, key: str) -> Any:
    """The part that the ``_target_`` of a config node names, made with the rest of the node."""
    node = to_plain(config)[key]
    try:
        part = instantiate(node)
    except InstantiationException as error:
        reason = " ".join(str(error.__cause__ or error).split())
        raise BadInput(f"{key}._target_", node.get("_target_"), f"cannot be made: {reason}") from error
    missing = [name for name in METHODS[key] if not hasattr(part, name)]
    if missing:
        raise BadInput(f"{key}._target_", node.get("_target_"), f"is no {key}: it has no {' and no '.join(missing)}")
    return part


def make_scenario(config: Config) -> Scenario:
    """Plan the run, build its parts and reset them.

    Raises:
        BadInput: the plan asks for what the machine cannot do.
    """
    mechanism = make_mechanism(config.machine)
    plant: Plant = _build(config, "plant")
    sensors: Sensors = _build(config, "sensors")
    controller: Controller = _build(config, "controller")
    feedforward: Feedforward = _build(config, "feedforward")
    plan = make_plan(config, mechanism, feedforward.acts)
    setup = Setup(config, mechanism, plan, np.ascontiguousarray(_start(config, plan)))
    feedforward.reset(setup)
    controller.reset(setup, feedforward)
    sensors.reset(setup)
    return Scenario(setup, plant, sensors, controller, feedforward, plant.reset(setup))
