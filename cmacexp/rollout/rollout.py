"""Run a scenario from its first step to its last, or to where it stops by itself."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cmacexp.arrays import Array
from cmacexp.control import CmacFeedforward, HybridController, InverseDynamics, NoFeedforward
from cmacexp.control.feedforward import BuiltInFeedforward
from cmacexp.models.mechanism import POINT_MASS
from cmacexp.planning.plan import Plan
from cmacexp.plants import AnalyticPlant, Measurement
from cmacexp.rollout.fused import FusedLoop, Torques, fused_loop
from cmacexp.rollout.layout import BODY_SAMPLES, SAMPLES
from cmacexp.rollout.stepped import SteppedLoop
from cmacexp.rollout.stop import RUNNING, STATUSES, Guard, describe_stop, new_guard
from cmacexp.scenario import Scenario
from cmacexp.sensors import PerfectSensors


@dataclass(frozen=True)
class Rollout:
    """What a closed loop gave."""

    plan: Plan
    samples: Array
    """(steps, L, columns), in the order of :data:`cmacexp.rollout.layout.SAMPLES`."""
    body_samples: Array
    """(steps, 3), in the order of :data:`cmacexp.rollout.layout.BODY_SAMPLES`."""
    status: str
    """``completed``, ``diverged``, ``fell``, ``interrupted`` or ``failed``."""
    cause: str
    """Why it is not completed: step, time and cause; empty if it is."""
    seconds: float
    """Wall time of the closed loop alone, compiling not counted."""
    error: Exception | None = None
    """What a part raised in the middle."""

    def columns(self) -> dict[str, Array]:
        """Samples (steps, L) by column name."""
        return {name: self.samples[:, :, i] for i, name in enumerate(SAMPLES)}

    def body_columns(self) -> dict[str, Array]:
        """Samples of the body (steps,) by column name."""
        return {name: self.body_samples[:, i] for i, name in enumerate(BODY_SAMPLES)}


def is_built_in(scenario: Scenario) -> bool:
    """Whether the fused loop knows every part."""
    return (
        type(scenario.plant) is AnalyticPlant
        and type(scenario.sensors) is PerfectSensors
        and type(scenario.controller) is HybridController
        and type(scenario.feedforward) in (NoFeedforward, InverseDynamics, CmacFeedforward)
    )


class _FusedLoop:
    """The fused loop over the states of built-in parts, compiled by running no step of it."""

    def __init__(self, scenario: Scenario, guard: Guard):
        plant, controller, feedforward = scenario.plant, scenario.controller, scenario.feedforward
        assert isinstance(plant, AnalyticPlant)
        assert isinstance(controller, HybridController)
        assert isinstance(feedforward, BuiltInFeedforward)
        legs = scenario.setup.mechanism.legs.shape[0]
        self.plant = plant
        self.taken = 0
        plan = scenario.setup.plan
        self.loop = FusedLoop(
            plan.support,
            plan.reference,
            plan.start_step,
            plant.law,
            plant.state,
            controller.law,
            controller.state,
            feedforward.law,
            scenario.setup.config.actuator.limit,
            Torques(*(np.zeros((legs, 2)) for _ in range(2))),
            guard,
        )
        self.run(np.zeros((0, legs, len(SAMPLES))), np.zeros((0, len(BODY_SAMPLES))))

    def run(self, samples: Array, body_samples: Array) -> int:
        """As :meth:`SteppedLoop.run`."""
        steps, stop = fused_loop(self.loop, self.taken, samples, body_samples)
        self.taken += steps
        return stop

    @property
    def state(self) -> Measurement:
        """Of the plant now."""
        return self.plant.measure()


def roll_out(scenario: Scenario, watch: Callable[[int], None] = lambda cycle: None, *, fused: bool = True) -> Rollout:
    """Run a scenario, cycle by cycle.

    Args:
        scenario: the parts.
        watch: is called after every cycle with the cycles done so far.
        fused: False takes the step-by-step loop even where the fused one knows every part.

    Returns:
        The samples up to the last step taken; a run that diverges, that a part fails in or that is interrupted
        keeps what it has.
    """
    setup = scenario.setup
    config, period, cycles = setup.config, setup.config.steps_per_cycle, setup.config.cycles
    guard = new_guard(setup.mechanism, setup.plan.margins[:, 0], config.sampling_period)
    loop = (_FusedLoop if fused and is_built_in(scenario) else SteppedLoop)(scenario, guard)
    samples = np.full((cycles * period, setup.mechanism.legs.shape[0], len(SAMPLES)), np.nan)
    body_samples = np.full((cycles * period, len(BODY_SAMPLES)), np.nan)
    status, cause, seconds = "completed", "", 0.0
    error: Exception | None = None
    try:
        for cycle in range(cycles):
            rows = slice(cycle * period, (cycle + 1) * period)
            began = time.perf_counter()
            stop = loop.run(samples[rows], body_samples[rows])
            seconds += time.perf_counter() - began
            if stop != RUNNING:
                q, dq, body = loop.state.q, loop.state.dq, loop.state.body
                status = STATUSES[stop]
                cause = describe_stop(guard, stop, loop.taken, config.sampling_period, q, dq, body)
                break
            watch(cycle + 1)
    except KeyboardInterrupt:
        status, cause = "interrupted", f"after step {loop.taken}"
    except Exception as raised:
        status, cause, error = "failed", f"after step {loop.taken}: {type(raised).__name__}: {raised}", raised
    done = loop.taken
    if setup.mechanism.kind == POINT_MASS:
        samples[:, :, [SAMPLES.index(name) for name in ("q1", "q2", "dq1", "dq2")]] = np.nan
    return Rollout(setup.plan, samples[:done], body_samples[:done], status, cause, seconds, error)
