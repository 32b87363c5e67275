"""The parts of one run, built from its config."""

import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cmacexp.cmac.rules import find_rule
from cmacexp.config import Config, to_plain
from cmacexp.config.machine import PointMassMachine
from cmacexp.control import Controller
from cmacexp.data.weights import read_weights
from cmacexp.errors import BadInput, CmacexpError
from cmacexp.feedforward.protocol import Feedforward, Learns
from cmacexp.loop.factory import METHODS, build, current_folder_importable
from cmacexp.loop.validation import require_finite, take_measurement
from cmacexp.planning import Plan, Setup, make_plan
from cmacexp.planning.machine import check_load_sharing, make_mechanism
from cmacexp.plants import AnalyticPlant, Measurement, Plant
from cmacexp.plants.protocol import STATE, new_measurement, state_of
from cmacexp.sensors import Sensors
from cmacexp.typing import Array


@dataclass
class Scenario:
    """One run, ready to start: every part is reset. A scenario runs once."""

    setup: Setup
    plant: Plant
    sensors: Sensors
    controller: Controller
    feedforward: Feedforward
    first: Measurement
    """Of the plant at the start."""
    fault: Exception | None = None
    """What a part raised when it was reset: the run fails before its first step."""
    used: bool = field(default=False, init=False)

    def begin(self) -> None:
        """Note that the run begins.

        Raises:
            CmacexpError: it has run before; its parts hold the state of its end.
        """
        if self.used:
            raise CmacexpError(
                "this scenario has run and its parts are where they ended: make it anew by make_scenario"
            )
        self.used = True


def _start(config: Config, plan: Plan) -> Array:
    """Planned joint angles; a point mass starts where its config says, above the ground."""
    start = plan.joints[0, :, :2].copy()
    if isinstance(config.machine, PointMassMachine):
        start[:, 1] = config.machine.hip_height - config.machine.start_clearance
    return start


def _own(setup: Setup, part: object) -> Setup:
    """What a part may know, as a copy of its own if it is not one of ours: no other part can be harmed by it."""
    return setup if type(part).__module__.startswith("cmacexp.") else copy.deepcopy(setup)


def _reset(setup: Setup, parts: dict[str, Any]) -> Measurement:
    """Reset all parts; the plant at the start.

    Raises:
        BadOutput: what the plant gave is no measurement of this machine.
        Exception: whatever a part raises.
    """
    plant, sensors, controller, feedforward = (parts[key] for key in METHODS)
    feedforward.reset(_own(setup, feedforward))
    controller.reset(_own(setup, controller), feedforward)
    sensors.reset(_own(setup, sensors))
    first = new_measurement(setup.mechanism.legs.shape[0])
    measured = plant.reset(_own(setup, plant))
    take_measurement(plant, "reset", measured, first)
    if not isinstance(plant, AnalyticPlant):  # ours says so if the body finds no balance: it has fallen
        for name, values in zip(STATE, state_of(first), strict=True):
            require_finite(plant, "reset", name, values)
    return first._replace(travel=measured.travel)


def make_scenario(config: Config, **given: Any) -> Scenario:
    """Plan the run, build its parts and reset them.

    Args:
        config: a checked config.
        given: parts that are made already, by the key of their group.

    Raises:
        BadInput: a part cannot be made, there are no weights to start from, or the plan asks for what the machine
            cannot do.
    """
    find_rule(config.learning.rule)
    check_load_sharing(config)
    mechanism = make_mechanism(config.machine)
    plain = to_plain(config)
    with current_folder_importable():
        built = {key: build(key, plain[key], given.get(key)) for key in METHODS}
        parts = {key: part for key, (part, _) in built.items()}
        if isinstance(config.controller, dict):
            # Gains that its class does not take are not the controller's, and no reference may rest on them.
            config = replace(config, controller=built["controller"][1])
        check_weights(config, parts["feedforward"])
        plan = make_plan(config, mechanism, parts["feedforward"].acts)
        setup = Setup(config, mechanism, plan, np.ascontiguousarray(_start(config, plan)), read_weights(config))
        first, fault = new_measurement(mechanism.legs.shape[0]), None
        try:
            first = _reset(setup, parts)
        except (BadInput, EOFError):  # the latter is damaged compiled code, not the part's
            raise
        except Exception as error:
            fault = error
    return Scenario(setup, **parts, first=first, fault=fault)


def check_weights(config: Config, feedforward: Feedforward) -> None:
    """Hold what is to be kept, or started from, to feedforwards that learn.

    Raises:
        BadInput: ``feedforward`` does not say what it has learnt.
    """
    if isinstance(feedforward, Learns):
        return
    name = type(feedforward).__name__
    if config.record.weights:
        raise BadInput("record.weights", True, f"{name} learns nothing that could be kept; give false")
    if config.learning.start_from is not None:
        raise BadInput("learning.start_from", config.learning.start_from, f"{name} learns nothing; give null")
