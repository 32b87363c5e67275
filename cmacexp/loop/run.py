"""Execution of a scenario, some cycles at a time, until it completes or stops."""

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
"""Largest number of rows of leg samples in memory, so that long runs need no more memory than short ones.

A much smaller number would cost time: to enter the compiled program takes some 20 us, as much as dozens of steps.
"""
MOST_CYCLES = 64
"""Largest number of cycles whose samples are in memory; it limits short cycles."""
LONGEST_CALL = 0.3
"""Target duration of one call of the driver, s; between calls progress is shown and Ctrl-C is handled."""
FIRST_STEPS = 1 << 12
"""Steps of the first call of a compiled program; even for a robot they take less than LONGEST_CALL."""
JOINTS = (*ARRAYS["q"], *ARRAYS["dq"])
"""Joint signals, which are undefined for a point mass."""


def _samples_measured(scenario: Scenario) -> bool:
    """Return True if altering sensors or force fault detection add columns to the samples."""
    return scenario.setup.config.plausibility.enabled or bool(scenario.altered - {"force"})


class _Cycles:
    """A running scenario with arrays for the samples of some cycles; arguments as for :func:`run_cycles`."""

    def __init__(self, scenario: Scenario, on_progress: Callable[[float], None]):
        setup = scenario.setup
        config = setup.config
        self.scenario = scenario
        self.config = config
        self.point_mass = setup.mechanism.kind == POINT_MASS
        self.on_progress = on_progress
        self.guard = make_guard(scenario)
        self.driver = Driver(scenario, self.guard)
        meter = self.driver.loop.meter
        self.adaptation = None if meter is None else Adaptation(setup, meter)
        self.steps_per_call = FIRST_STEPS if repays_compiling() and self.driver.components is None else 1
        """Number of steps of the next call of the driver."""
        cycles = min(config.cycles, max(1, MOST_ROWS // (config.steps_per_cycle * config.legs)), MOST_CYCLES)
        if scenario.is_live:  # traces are made after the end, since that takes longer than a step
            cycles = config.cycles
        legs, joints = setup.mechanism.shape
        steps = cycles * config.steps_per_cycle
        self.samples, self.body = make_samples(steps, legs, _samples_measured(scenario), joints)
        if scenario.is_live:
            self.samples.fill(0.0)  # makes the system allocate the pages before the machine moves
        names = enumerate(ALL_SAMPLES[: len(self.samples)])
        self.joints = [i for i, name in names if name.removesuffix("_measured") in JOINTS]
        self.columns = select_columns(scenario)
        self.end = scenario.end
        if self.guard is not None:
            self.end.guard = self.guard.events
        if self.adaptation is not None:
            self.end.carried = self.adaptation.carried

    @property
    def is_running(self) -> bool:
        """True if steps are left and nothing has ended the run."""
        steps = self.config.cycles * self.config.steps_per_cycle
        return self.end.status == Status.COMPLETED and self.driver.taken < steps

    def fail(self, where: str, raised: Exception) -> None:
        """Record that the exception ``raised`` of a component ended the run; only the first failure counts.

        ``where`` is the prefix of the recorded cause: the name of a method, or empty.
        """
        if self.end.error is None:
            self.end.status = Status.FAILED
            self.end.error = raised
            self.end.cause = f"{where}after step {self.driver.taken}: {describe_failure(raised)}"

    def advance(self) -> int:
        """Run until the arrays are full, the plan changes or the run ends; return the first step.

        Interrupts and errors also end the run. Each call of the driver takes about LONGEST_CALL; between two calls an
        interrupt is handled, progress is shown, and the plan may change.
        """
        config = self.config
        driver = self.driver
        end = self.end
        start = driver.taken
        if self.adaptation is not None:
            self.adaptation.update_plan(start // config.steps_per_cycle + 1)
        steps = min(self.samples.shape[1], config.cycles * config.steps_per_cycle - start)
        self.body[TRAVEL[0] : TRAVEL[-1] + 1] = 0.0  # the body moves straight ahead unless the plant moves it
        self.body[TRAVEL[0], :steps] = np.arange(start, start + steps) * config.sampling_period * config.body_speed
        began = time.perf_counter()
        processor_began = time.process_time()
        stop = RUNNING
        changes_plan = False
        try:
            with exits_caught():
                while stop == RUNNING and driver.taken < start + steps and not changes_plan:
                    raise_if_interrupted()
                    called = time.perf_counter()
                    done = driver.taken - start
                    count = min(self._most_steps(), steps - done)
                    stop = driver.run(self.samples, self.body, done, count)
                    changes_plan = self._end_call(stop)
                    self.steps_per_call = max(1, int(count * LONGEST_CALL / max(time.perf_counter() - called, 1e-6)))
            if stop != RUNNING:
                self._note_stop(stop)
        except KeyboardInterrupt:
            end.status = Status.INTERRUPTED
            end.cause = f"after step {driver.taken}"
        except Exception as raised:
            self.fail("", raised)
        end.rollout_seconds += time.perf_counter() - began
        end.processor_seconds += time.process_time() - processor_began
        end.steps = driver.taken
        return start

    def _end_call(self, stop: int) -> bool:
        """Update lead and load estimates after a call of the driver; return True if the plan has to change."""
        changes_plan = False
        if self.driver.taken % self.config.steps_per_cycle == 0:
            self._apply_estimate()
            changes_plan = stop == RUNNING and self.adaptation is not None and self.adaptation.end_cycle()
        self.on_progress(self.driver.taken / self.config.steps_per_cycle)
        return changes_plan

    def _note_stop(self, stop: int) -> None:
        """Record status and cause of a stop, DIVERGED or FELL."""
        driver = self.driver
        plant = self.scenario.plant
        reported = driver.divergence or (plant.divergence if isinstance(plant, MujocoPlant) else "")
        self.end.status = STATUSES[stop]
        self.end.cause = describe_stop(
            driver.loop.limits, stop, driver.taken, self.config.sampling_period, driver.state, reported
        )

    def _most_steps(self) -> int:
        """Return the number of steps of the next call of the driver.

        A call ends with the cycle if lead or plan can change, which happens only between calls.
        """
        if self.config.learning.lead != ESTIMATE and self.adaptation is None:
            return self.steps_per_call
        return min(self.steps_per_call, self.config.steps_per_cycle - self.driver.taken % self.config.steps_per_cycle)

    def _apply_estimate(self) -> None:
        """Start learning with the estimated lead if a probe has ended with this cycle.

        After a reversion the lead is at least one sample longer than the one that failed. With drives the estimate is
        used unchanged, and each reversion halves the learning rate.
        """
        params = self.driver.loop.feedforward
        guard = self.guard
        if guard is None or guard.probe.state is None or params is None or not guard.probe.end_cycle():
            return
        learning = params.learning
        controller = self.scenario.controller
        on_drives = offers(controller, SendsDrives) and controller.sends_drives
        lead = estimate_lead(guard.probe.state, on_drives) or learning.lead
        if self.end.lead_estimates and not on_drives:  # too short a lead does harm more often than too long a one
            lead = max(lead, learning.lead + 1)
        rate = resolve_rate(self.config, LoopDelay(lead - 1), lead)
        if on_drives:
            rate *= 0.5 ** len(self.end.lead_estimates)
        self.end.learning_rate = rate
        self.end.learning_lead = lead
        guard.learns_again = True
        learning = learning._replace(
            lead=lead,
            rate=np.full_like(learning.rate, rate),
            cycle_rate=float(learning.cycle_rate * rate / learning.rate[0]),
            start_step=self.driver.taken,
        )
        self.driver.loop = self.driver.loop._replace(feedforward=params._replace(learning=learning))
        self.end.lead_estimates.append(LeadEstimate(self.driver.taken // self.config.steps_per_cycle + 1, lead))

    def collect(self, start: int) -> Trace:
        """Make the trace of the steps since ``start``; later steps do not change it."""
        steps = self.driver.taken - start
        if self.point_mass:
            self.samples[self.joints] = np.nan
        legs, body = self.samples[:, :steps], self.body[:, :steps]
        if self.is_running:  # the next steps overwrite the arrays
            legs, body = legs.copy(), body.copy()
        memory = self._collect_memory(start)
        return make_trace(self.scenario, self.columns, start, legs, body, memory, self._list_live(start))

    def _collect_memory(self, start: int) -> dict[str, Array] | None:
        """Collect the memory signals of networks since step ``start``, (cycles, L) by name; None without networks."""
        feedforward = self.scenario.feedforward
        if not isinstance(feedforward, BuiltInFeedforward):
            return None
        steps = self.driver.taken - start
        memory = feedforward.collect_memory(-(-steps // self.config.steps_per_cycle))
        if memory is not None:
            memory["guard"] = self._guard_states(start, memory["rows"].shape)
        return memory

    def _list_live(self, start: int) -> dict[str, Array]:
        """Get LIVE_SIGNALS (steps,) since step ``start`` from a plant that has them; NaN if its method fails."""
        plant = self.scenario.plant
        if not offers(plant, ListsSteps):
            return {}
        columns = {signal.name: np.full(self.driver.taken - start, np.nan) for signal in LIVE_SIGNALS}
        try:
            with exits_caught():
                signals = plant.list_steps(start, self.driver.taken)
            for name, values in columns.items():
                values[:] = signals[name]
        except Exception as raised:
            self.fail("list_steps, ", raised)
        return columns

    def _guard_states(self, start: int, shape: tuple[int, int]) -> Array:
        """Return the state of the guard at the end of each cycle from step ``start`` on.

        An array of ``shape`` (cycles, L): LEARNS, REPEATED or FEEDBACK_ALONE.
        """
        cycles = start // self.config.steps_per_cycle + 1 + np.arange(shape[0])
        states = np.zeros(shape)
        changes = [(estimate.cycle, LEARNS) for estimate in self.end.lead_estimates]
        changes += [(event.cycle, REPEATED if event.restored else FEEDBACK_ALONE) for event in self.end.guard]
        for cycle, state in sorted(changes, key=itemgetter(0)):
            states[cycles >= cycle] = state
        return states


def _trace_nothing(scenario: Scenario) -> Trace:
    """Make the empty trace of a run that takes no step because the reset of a component failed."""
    legs, joints = scenario.setup.mechanism.shape
    none = dict.fromkeys((signal.name for signal in LIVE_SIGNALS), np.empty(0))
    samples, body = make_samples(0, legs, _samples_measured(scenario), joints)
    return make_trace(scenario, select_columns(scenario), 0, samples, body, None, none)


def run_cycles(scenario: Scenario, on_progress: Callable[[float], None] = lambda cycles: None) -> Iterator[Trace]:
    """Run a scenario and yield its traces, some cycles at a time.

    Args:
        scenario: new scenario, whose components are reset.
        on_progress: called several times per second with the number of completed cycles, a fraction included.

    Yields:
        The trace of the next cycles; the last cycle may be incomplete. Afterwards ``scenario.end`` contains the
        outcome. For a machine that is not simulated, all traces are yielded after the end of the run.

    Raises:
        CmacexpError: the scenario has run before.
    """
    scenario.begin()
    if scenario.fault is not None:
        scenario.end.status = Status.FAILED
        scenario.end.error = scenario.fault
        scenario.end.cause = f"before the first step: {describe_failure(scenario.fault)}"
        yield _trace_nothing(scenario)
        return
    plant = scenario.plant
    traces: list[Trace] = []  # of a machine that is not simulated, which must not wait for files
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
    """Set up the context for running steps: the workload for compiling, deferred interrupts, and caught exits."""
    config = scenario.setup.config
    leg_steps = math.inf if scenario.is_live else config.cycles * config.steps_per_cycle * config.legs
    with workload(leg_steps), interrupt_held_back(), exits_caught():
        yield
