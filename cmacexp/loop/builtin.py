"""Which parts of a scenario the compiled loops know, and the states of those for them to work on."""

import numpy as np

from cmacexp.control import HybridController, NoFeedforward
from cmacexp.control.actuator import new_actuator
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.loop.compiled import FusedLoop, Torques, fused_loop
from cmacexp.loop.coroutine import External
from cmacexp.loop.external import measurable
from cmacexp.loop.samples import make_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.stop import Guard
from cmacexp.plants import AnalyticPlant
from cmacexp.plants.kernels import PlantState
from cmacexp.sensors import PerfectSensors, RealSensors
from cmacexp.sensors.channel import Sensing
from cmacexp.sensors.kernels import Seen, new_seen, no_sensing
from cmacexp.typing import Array


def external_components(scenario: Scenario) -> External:
    """Which parts the compiled loops do not know; a class made from a built-in one is external."""
    controller, feedforward = type(scenario.controller) is not HybridController, scenario.feedforward
    known = isinstance(feedforward, BuiltInFeedforward) and type(feedforward).predict is BuiltInFeedforward.predict
    return External(
        type(scenario.plant) is not AnalyticPlant,
        type(scenario.sensors) not in (PerfectSensors, RealSensors),
        controller,
        not controller and not known,
    )


ALL_EXTERNAL = External(plant=True, sensors=True, controller=True, feedforward=False)


def _sensing(scenario: Scenario, external: External, state: PlantState) -> tuple[Sensing, Seen]:
    """Sensors as the loops take them; perfect ones show the arrays of the plant."""
    sensors = scenario.sensors
    if external.sensors:
        return no_sensing(), new_seen(len(state.force))
    if isinstance(sensors, RealSensors) and sensors.sensing.active:
        return sensors.sensing, sensors.seen
    return no_sensing(), Seen(*(getattr(state, name) for name in Seen._fields))


def fused_parts(scenario: Scenario, external: External, guard: Guard) -> FusedLoop:
    """The states of all built-in parts; with stand-ins for the others, of which only the room for results is used."""
    setup = scenario.setup
    plant, controller, feedforward = AnalyticPlant(), HybridController(1.0, 0.0, 1.0, 1.0), scenario.feedforward
    if external.plant:
        plant.reset(setup)
    else:
        assert isinstance(scenario.plant, AnalyticPlant)
        plant = scenario.plant
    if external.controller:
        controller.reset(setup, feedforward)
    else:
        assert isinstance(scenario.controller, HybridController)
        controller = scenario.controller
    if not isinstance(feedforward, BuiltInFeedforward) or external.controller or external.feedforward:
        feedforward = NoFeedforward()
        feedforward.reset(setup)
    legs = setup.mechanism.legs.shape[0]
    return FusedLoop(
        setup.plan.support,
        setup.plan.reference,
        setup.plan.start_step,
        plant.params,
        plant.state,
        *_sensing(scenario, external, plant.state),
        controller.params,
        controller.state,
        feedforward.params,
        new_actuator(setup.config.actuator, setup.config.sampling_period, legs),
        Torques(*(np.zeros((legs, 2)) for _ in range(2))),
        guard,
    )


class FusedRun:
    """The fused loop over the states of built-in parts, compiled by running no step of it.

    ``loop`` holds all that changes, ``taken`` counts the steps taken so far.
    """

    def __init__(self, loop: FusedLoop):
        self.loop = loop
        self.taken = 0
        self.state = measurable(loop.plant_state)
        self.run(*make_samples(0, loop.support.shape[1], False))

    def run(self, samples: Array, body_samples: Array) -> int:
        """As :meth:`SteppedLoop.run`."""
        steps, stop = fused_loop(self.loop, self.taken, samples, body_samples)
        self.taken += steps
        return stop
