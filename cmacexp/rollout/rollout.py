"""Run a scenario from its first step to its last, or to where it stops by itself."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cmacexp.arrays import Array
from cmacexp.control import HybridController
from cmacexp.control.feedforward import BuiltInFeedforward
from cmacexp.models.mechanism import POINT_MASS
from cmacexp.planning.plan import Plan
from cmacexp.plants import AnalyticPlant, Measurement
from cmacexp.rollout.fused import FusedLoop, Torques, fused_loop
from cmacexp.rollout.layout import RUNNING, SAMPLES, describe_stop
from cmacexp.rollout.stepped import SteppedLoop
from cmacexp.scenario import Scenario
from cmacexp.sensors import PerfectSensors

Run = Callable[[int, Array], tuple[int, int]]


@dataclass(frozen=True)
class Rollout:
    """What a closed loop gave."""

    plan: Plan
    samples: Array
    """(steps, L, columns), in the order of :data:`cmacexp.rollout.layout.SAMPLES`."""
    status: str
    """``completed``, ``diverged``, ``interrupted`` or ``failed``."""
    cause: str
    """Why it is not completed: step, time and cause; empty if it is."""
    seconds: float
    """Wall time of the closed loop alone, compiling not counted."""
    error: Exception | None = None
    """What a part raised in the middle."""

    def columns(self) -> dict[str, Array]:
        """Samples (steps, L) by column name."""
        return {name: self.samples[:, :, i] for i, name in enumerate(SAMPLES)}


def is_built_in(scenario: Scenario) -> bool:
    """Whether the fused loop knows every part."""
    return (
        type(scenario.plant) is AnalyticPlant
        and type(scenario.sensors) is PerfectSensors
        and type(scenario.controller) is HybridController
        and isinstance(scenario.feedforward, BuiltInFeedforward)
    )


def _fused(scenario: Scenario) -> tuple[Run, Callable[[], Measurement]]:
    """The fused loop over the states of built-in parts, compiled by running no step of it."""
    plant, controller, feedforward = scenario.plant, scenario.controller, scenario.feedforward
    assert isinstance(plant, AnalyticPlant)
    assert isinstance(controller, HybridController)
    assert isinstance(feedforward, BuiltInFeedforward)
    legs = scenario.setup.mechanism.legs.shape[0]
    limit = scenario.setup.config.actuator.torque_limit
    loop = FusedLoop(
        scenario.setup.plan,
        plant.law,
        plant.state,
        controller.law,
        controller.state,
        feedforward.law,
        float("inf") if limit is None else float(limit),
        Torques(*(np.zeros((legs, 2)) for _ in range(3))),
    )

    def run(start: int, samples: Array) -> tuple[int, int]:
        return fused_loop(loop, start, samples)

    run(0, np.zeros((0, legs, len(SAMPLES))))
    return run, plant.measure


def _stepped(scenario: Scenario) -> tuple[Run, Callable[[], Measurement]]:
    loop = SteppedLoop(scenario)
    return loop.run, lambda: loop.state


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
    period, cycles = setup.config.steps_per_cycle, setup.config.cycles
    run, measure = (_fused if fused and is_built_in(scenario) else _stepped)(scenario)
    samples = np.full((cycles * period, setup.mechanism.legs.shape[0], len(SAMPLES)), np.nan)
    done, status, cause, seconds = 0, "completed", "", 0.0
    error: Exception | None = None
    try:
        for cycle in range(cycles):
            began = time.perf_counter()
            steps, stop = run(done, samples[done : done + period])
            seconds += time.perf_counter() - began
            done += steps
            if stop != RUNNING:
                status, state = "diverged", measure()
                cause = describe_stop(done, setup.config.sampling_period, state.q, state.dq)
                break
            watch(cycle + 1)
    except KeyboardInterrupt:
        status, cause = "interrupted", f"after step {done}"
    except Exception as raised:
        status, cause, error = "failed", f"after step {done}: {type(raised).__name__}: {raised}", raised
    samples = samples[:done]
    if setup.mechanism.kind == POINT_MASS:
        samples[:, :, [SAMPLES.index(name) for name in ("q1", "q2", "dq1", "dq2")]] = np.nan
    return Rollout(setup.plan, samples, status, cause, seconds, error)
