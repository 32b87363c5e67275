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
from cmacexp.rollout.layout import BODY_SAMPLES, SAMPLES
from cmacexp.rollout.stepped import SteppedLoop
from cmacexp.rollout.stop import RUNNING, STATUSES, Guard, describe_stop, new_guard
from cmacexp.scenario import Scenario
from cmacexp.sensors import PerfectSensors

Run = Callable[[int, Array, Array], tuple[int, int]]


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
        and isinstance(scenario.feedforward, BuiltInFeedforward)
    )


def _fused(scenario: Scenario, guard: Guard) -> tuple[Run, Callable[[], Measurement]]:
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
        guard,
    )

    def run(start: int, samples: Array, body_samples: Array) -> tuple[int, int]:
        return fused_loop(loop, start, samples, body_samples)

    run(0, np.zeros((0, legs, len(SAMPLES))), np.zeros((0, len(BODY_SAMPLES))))
    return run, plant.measure


def _stepped(scenario: Scenario, guard: Guard) -> tuple[Run, Callable[[], Measurement]]:
    loop = SteppedLoop(scenario, guard)
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
    guard = new_guard(setup.mechanism, setup.plan.margins[:, 0], setup.config.sampling_period)
    run, measure = (_fused if fused and is_built_in(scenario) else _stepped)(scenario, guard)
    samples = np.full((cycles * period, setup.mechanism.legs.shape[0], len(SAMPLES)), np.nan)
    body_samples = np.full((cycles * period, len(BODY_SAMPLES)), np.nan)
    done, status, cause, seconds = 0, "completed", "", 0.0
    error: Exception | None = None
    try:
        for cycle in range(cycles):
            began = time.perf_counter()
            steps, stop = run(done, samples[done : done + period], body_samples[done : done + period])
            seconds += time.perf_counter() - began
            done += steps
            if stop != RUNNING:
                status, state = STATUSES[stop], measure()
                cause = describe_stop(guard, stop, done, setup.config.sampling_period, state.q, state.dq, state.body)
                break
            watch(cycle + 1)
    except KeyboardInterrupt:
        status, cause = "interrupted", f"after step {done}"
    except Exception as raised:
        status, cause, error = "failed", f"after step {done}: {type(raised).__name__}: {raised}", raised
    samples = samples[:done]
    if setup.mechanism.kind == POINT_MASS:
        samples[:, :, [SAMPLES.index(name) for name in ("q1", "q2", "dq1", "dq2")]] = np.nan
    return Rollout(setup.plan, samples, body_samples[:done], status, cause, seconds, error)
