"""Run a scenario from its first step to its last, or until it stops."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from operator import itemgetter

import numpy as np

from cmacexp.config.schema import ESTIMATE
from cmacexp.data.records import LeadEstimate
from cmacexp.data.signals import ARRAYS, FEEDBACK_ALONE, LEARNS, LIVE_SIGNALS, REPEATED
from cmacexp.data.trace import Trace
from cmacexp.errors import describe_failure
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.jit.compiler import repays_compiling, workload
from cmacexp.jit.interrupt import exits_caught, interrupt_held_back, raise_if_interrupted
from cmacexp.loop.adaptation import Adaptation
from cmacexp.loop.builtin import make_guard
from cmacexp.loop.driver import Driver
from cmacexp.loop.probe import estimate_lead
from cmacexp.loop.samples import ALL_SAMPLES, TRAVEL, make_samples
from cmacexp.loop.scenario import Scenario, resolve_rate
from cmacexp.loop.stop import RUNNING, STATUSES, describe_stop
from cmacexp.loop.trace import make_trace, select_columns
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.mechanism import POINT_MASS
from cmacexp.plants.mujoco_plant import MujocoPlant
from cmacexp.protocols import ListsSteps, Live, SendsDrives, offers
from cmacexp.typing import Array, Status

MOST_ROWS = 1 << 15
"""Rows of leg samples in memory: a long run needs no more than a short one.

Entering the compiled program costs some 20 us, as much as dozens of steps.
"""
MOST_CYCLES = 64
"""Cycles whose samples are in memory, where cycles are short."""
LONGEST_CALL = 0.3
"""Seconds that one call of a driver is to take: progress is shown, and Ctrl-C heeded, between two calls."""
FIRST_STEPS = 1 << 12
"""Steps of the first call of a compiled program, in which even a robot takes less time."""
JOINTS = (*ARRAYS["q"], *ARRAYS["dq"])
"""Signals that are undefined for a point mass, measured or not."""


def _samples_measured(scenario: Scenario) -> bool:
    """Whether sensors, or their supervision, add columns to the samples."""
    return scenario.setup.config.plausibility.enabled or bool(scenario.altered - {"force"})


class _Cycles:
    """A scenario under way, with arrays for the samples of some cycles; arguments as of :func:`run_cycles`."""

    def __init__(self, scenario: Scenario, on_progress: Callable[[float], None]):
        setup = scenario.setup
        config, mechanism = setup.config, setup.mechanism
        self.scenario = scenario
        self.config = config
        self.point_mass = mechanism.kind == POINT_MASS
        self.on_progress = on_progress
        self.guard = make_guard(scenario)
        self.driver = Driver(scenario, self.guard)
        meter = self.driver.loop.meter
        self.adaptation = None if meter is None else Adaptation(setup, meter)
        self.steps_per_call = FIRST_STEPS if repays_compiling() and self.driver.components is None else 1
        """Steps of the next call of the driver."""
        fit = MOST_ROWS // (config.steps_per_cycle * config.legs)
        cycles = min(config.cycles, max(1, fit), MOST_CYCLES)
        if scenario.is_live:  # handing samples over takes longer than a step, so that it waits for the end
            cycles = config.cycles
        wide = _samples_measured(scenario)
        legs, joints = mechanism.shape
        self.samples, self.body = make_samples(cycles * config.steps_per_cycle, legs, wide, joints)
        if scenario.is_live:
            self.samples.fill(0.0)  # else the system would find memory for them while the machine moves
        names = ALL_SAMPLES[: len(self.samples)]
        self.joints = [i for i, name in enumerate(names) if name.removesuffix("_measured") in JOINTS]
        self.columns = select_columns(scenario)
        self.end = scenario.end
        if self.guard is not None:
            self.end.guard = self.guard.events
        if self.adaptation is not None:
            self.end.carried = self.adaptation.carried

    @property
    def is_running(self) -> bool:
        """Whether steps are left and nothing has ended the run."""
        steps = self.config.cycles * self.config.steps_per_cycle
        return self.end.status == Status.COMPLETED and self.driver.taken < steps

    def fail(self, where: str, raised: Exception) -> None:
        """Let the run fail by what a component raised, unless it has failed before; ``where``: in which method."""
        end = self.end
        if end.error is None:
            end.status, end.error = Status.FAILED, raised
            end.cause = f"{where}after step {self.driver.taken}: {describe_failure(raised)}"

    def advance(self) -> int:
        """Run until the arrays are full or the run ends, as at an interrupt or an error; returns the first step.

        The driver is called for a moment at a time: between two calls an interrupt is heeded, progress is shown, and
        the plan may change.
        """
        config, driver, end = self.config, self.driver, self.end
        start = driver.taken
        if self.adaptation is not None:
            self.adaptation.update_plan(start // config.steps_per_cycle + 1)
        steps = min(self.samples.shape[1], config.cycles * config.steps_per_cycle - start)
        self.body[TRAVEL[0] : TRAVEL[-1] + 1] = 0.0  # a body goes straight ahead unless the plant moves it
        self.body[TRAVEL[0], :steps] = np.arange(start, start + steps) * config.sampling_period * config.body_speed
        began, worked = time.perf_counter(), time.process_time()
        stop, changes_plan = RUNNING, False
        try:
            with exits_caught():
                while stop == RUNNING and driver.taken < start + steps and not changes_plan:
                    raise_if_interrupted()
                    called, done = time.perf_counter(), driver.taken - start
                    count = min(self._most_steps(), steps - done)
                    stop = driver.run(self.samples, self.body, done, count)
                    changes_plan = self._end_call(stop)
                    self.steps_per_call = max(1, int(count * LONGEST_CALL / max(time.perf_counter() - called, 1e-6)))
            if stop != RUNNING:
                self._note_stop(stop)
        except KeyboardInterrupt:
            end.status, end.cause = Status.INTERRUPTED, f"after step {driver.taken}"
        except Exception as raised:
            self.fail("", raised)
        end.rollout_seconds += time.perf_counter() - began
        end.processor_seconds += time.process_time() - worked
        end.steps = driver.taken
        return start

    def _end_call(self, stop: int) -> bool:
        """Do what is due after a call of the driver; returns whether the plan changes before the next one."""
        taken, period, adaptation = self.driver.taken, self.config.steps_per_cycle, self.adaptation
        ends_cycle = taken % period == 0
        if ends_cycle:
            self._apply_estimate()
        changes_plan = stop == RUNNING and ends_cycle and adaptation is not None and adaptation.end_cycle()
        self.on_progress(taken / period)
        return changes_plan

    def _note_stop(self, stop: int) -> None:
        """Note why the loop stopped, DIVERGED or FELL."""
        driver, plant = self.driver, self.scenario.plant
        reported = driver.divergence or (plant.divergence if isinstance(plant, MujocoPlant) else "")
        period, state = self.config.sampling_period, driver.state
        self.end.status = STATUSES[stop]
        self.end.cause = describe_stop(driver.loop.limits, stop, driver.taken, period, state, reported)

    def _most_steps(self) -> int:
        """Steps of the next call of the driver; lead and plan can change only between calls, where a cycle starts."""
        if self.config.learning.lead != ESTIMATE and self.adaptation is None:
            return self.steps_per_call
        return min(self.steps_per_call, self.config.steps_per_cycle - self.driver.taken % self.config.steps_per_cycle)

    def _apply_estimate(self) -> None:
        """Learn with the lead that a probe has given; after a retreat with a longer one than has failed.

        On drives the lead stays as it is estimated, and each retreat halves the rate.
        """
        params, guard, end = self.driver.loop.feedforward, self.guard, self.end
        if guard is None or guard.probe.state is None or params is None or not guard.probe.end_cycle():
            return
        learning = params.learning
        controller = self.scenario.controller
        on_drives = offers(controller, SendsDrives) and controller.sends_drives
        lead = estimate_lead(guard.probe.state, on_drives) or learning.lead
        if end.lead_estimates and not on_drives:  # too short a lead does harm more often than one that is too long
            lead = max(lead, learning.lead + 1)
        rate = resolve_rate(self.config, LoopDelay(lead - 1), lead)
        if on_drives:
            rate *= 0.5 ** len(end.lead_estimates)
        end.learning_rate, end.learning_lead = rate, lead
        guard.learns_again = True
        learning = learning._replace(
            lead=lead,
            rate=np.full_like(learning.rate, rate),
            cycle_rate=float(learning.cycle_rate * rate / learning.rate[0]),
            start_step=self.driver.taken,
        )
        self.driver.loop = self.driver.loop._replace(feedforward=params._replace(learning=learning))
        end.lead_estimates.append(LeadEstimate(self.driver.taken // self.config.steps_per_cycle + 1, lead))

    def collect(self, start: int) -> Trace:
        """Make the trace of the steps since ``start``, which nothing changes from here on."""
        steps = self.driver.taken - start
        if self.point_mass:
            self.samples[self.joints] = np.nan
        legs, body = self.samples[:, :steps], self.body[:, :steps]
        if self.is_running:  # and fills them again
            legs, body = legs.copy(), body.copy()
        return make_trace(
            self.scenario, self.columns, start, legs, body, self._collect_memory(start), self._list_live(start)
        )

    def _collect_memory(self, start: int) -> dict[str, Array] | None:
        """Collect the signals of networks since step ``start``, (cycles, L) by name; None without weights."""
        feedforward, steps = self.scenario.feedforward, self.driver.taken - start
        if not isinstance(feedforward, BuiltInFeedforward):
            return None
        memory = feedforward.collect_memory(-(-steps // self.config.steps_per_cycle))
        if memory is not None:
            memory["guard"] = self._guard_states(start, memory["rows"].shape)
        return memory

    def _list_live(self, start: int) -> dict[str, Array]:
        """List LIVE_SIGNALS of the steps since ``start`` if the plant has them, (steps,) each; NaN if that fails."""
        plant, steps = self.scenario.plant, self.driver.taken - start
        if not offers(plant, ListsSteps):
            return {}
        columns = {signal.name: np.full(steps, np.nan) for signal in LIVE_SIGNALS}
        try:
            with exits_caught():
                listed = plant.list_steps(start, self.driver.taken)
            for name, values in columns.items():
                values[:] = listed[name]
        except Exception as raised:
            self.fail("list_steps, ", raised)
        return columns

    def _guard_states(self, start: int, shape: tuple[int, int]) -> Array:
        """List states of the guard of learning at the end of the cycles from step ``start`` on, as ``shape``.

        That is (cycles, L).
        """
        cycles, states = start // self.config.steps_per_cycle + 1 + np.arange(shape[0]), np.zeros(shape)
        changes = [(estimate.cycle, LEARNS) for estimate in self.end.lead_estimates]
        changes += [(event.cycle, REPEATED if event.restored else FEEDBACK_ALONE) for event in self.end.guard]
        for cycle, state in sorted(changes, key=itemgetter(0)):
            states[cycles >= cycle] = state
        return states


def _trace_nothing(scenario: Scenario) -> Trace:
    """Make the trace of a run that takes no step, since a component raised when it was reset."""
    legs, joints = scenario.setup.mechanism.shape
    none = dict.fromkeys((signal.name for signal in LIVE_SIGNALS), np.empty(0))
    samples, body = make_samples(0, legs, _samples_measured(scenario), joints)
    return make_trace(scenario, select_columns(scenario), 0, samples, body, None, none)


def run_cycles(scenario: Scenario, on_progress: Callable[[float], None] = lambda cycles: None) -> Iterator[Trace]:
    """Run a scenario, whose components are reset, some cycles at a time.

    Args:
        scenario: it must not have run before.
        on_progress: called several times a second with the number of cycles done so far.

    Yields:
        The trace of the next cycles; the last one may be short. ``scenario.end`` says how the run ended, whether it
        completed, diverged, failed or was interrupted; of a machine that is not simulated nothing is yielded before.

    Raises:
        CmacexpError: the scenario has run before.
    """
    scenario.begin()
    if scenario.fault is not None:
        scenario.end.status, scenario.end.error = Status.FAILED, scenario.fault
        scenario.end.cause = f"before the first step: {describe_failure(scenario.fault)}"
        yield _trace_nothing(scenario)
        return
    plant = scenario.plant
    traces: list[Trace] = []  # of a machine that must not wait for the files
    status: str = Status.FAILED
    fault: Exception | None = None
    try:
        with _at_work(scenario):
            cycles = _Cycles(scenario, on_progress)
            start = cycles.advance()
        while cycles.is_running:
            with _at_work(scenario):
                trace = cycles.collect(start)
            if scenario.is_live:
                traces.append(trace)
            else:
                yield trace
            with _at_work(scenario):
                start = cycles.advance()
        status = scenario.end.status
    finally:
        try:
            if offers(plant, Live):
                plant.end_run(is_safe=status in (Status.COMPLETED, Status.INTERRUPTED))
        except Exception as raised:
            fault = raised
    if fault is not None:
        cycles.fail("end_run, ", fault)
    yield from traces
    if start == 0 or cycles.driver.taken > start:
        with _at_work(scenario):
            trace = cycles.collect(start)
        yield trace


@contextmanager
def _at_work(scenario: Scenario) -> Iterator[None]:
    """Run steps of a scenario: what it calls is compiled if that repays it; an interrupt waits for the next call."""
    config = scenario.setup.config
    leg_steps = math.inf if scenario.is_live else config.cycles * config.steps_per_cycle * config.legs
    with workload(leg_steps), interrupt_held_back(), exits_caught():
        yield
