"""Run a scenario from its first step to its last, or until it stops."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from cmacexp.config.schema import ESTIMATE
from cmacexp.data.records import GuardEvent, LeadEstimate
from cmacexp.data.signals import ARRAYS, FEEDBACK_ALONE, LEARNS, LIVE_SIGNALS, REPEATED
from cmacexp.errors import describe_failure
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.jit.compiler import repays_compiling, workload
from cmacexp.jit.interrupt import exits_caught, interrupt_held_back, raise_if_interrupted
from cmacexp.loop.adaptation import Adaptation
from cmacexp.loop.builtin import make_guard
from cmacexp.loop.driver import Driver
from cmacexp.loop.probe import estimate_lead
from cmacexp.loop.samples import ALL_SAMPLES, TRAVEL, WIDE_BODY_SAMPLES, make_samples, name_samples
from cmacexp.loop.scenario import Scenario, resolve_rate
from cmacexp.loop.stop import RUNNING, STATUSES, describe_stop
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.mechanism import POINT_MASS
from cmacexp.planning.plan import LoadEstimate
from cmacexp.plants.mujoco_plant import MujocoPlant
from cmacexp.plants.protocol import come_to_rest, is_live
from cmacexp.sensors.protocol import find_altered
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


class Samples(NamedTuple):
    """Samples of some steps of a closed loop, whole cycles unless the run ends in them."""

    start: int
    legs: Array
    """(columns, steps, L), in the order of :mod:`cmacexp.loop.samples`."""
    body: Array
    """(columns, steps), likewise."""
    memory: dict[str, Array] | None
    """Columns of ``memory.parquet``, (cycles, L) by name; None without weights."""
    live: dict[str, Array]
    """LIVE_SIGNALS, (steps,) by name; empty of a plant that does not list them."""

    def columns(self) -> dict[str, Array]:
        """Samples of the legs, (steps, L) by column name, in the units of :func:`cmacexp.data.signals.list_units`."""
        return name_samples(self.legs)

    def body_columns(self) -> dict[str, Array]:
        """Samples of the body, (steps,) by column name, in the units of :func:`cmacexp.data.signals.list_units`."""
        return name_samples(self.body, WIDE_BODY_SAMPLES)


@dataclass
class End:
    """How a closed loop ended; while it runs, as if it ended now."""

    steps: int
    status: str
    """``completed``, ``diverged``, ``fell``, ``interrupted`` or ``failed``."""
    cause: str
    """Why it did not complete: step, time and cause; empty if it did."""
    rate: float
    """Rate of learning at the end."""
    error: Exception | None = None
    """What a component raised."""
    seconds: float = 0.0
    """Wall time of the closed loop alone, without compiling."""
    processor_seconds: float = 0.0
    """Processor time of the same."""
    events: Sequence[GuardEvent] = ()
    """What the guard of learning did."""
    estimates: list[LeadEstimate] = field(default_factory=list)
    """Estimates of the lead, by ``learning.lead=estimate``."""
    load_history: Sequence[tuple[int, LoadEstimate, float]] = ()
    """What the plan uses of the load from a cycle on, and what the feet carried in the one before, N, by
    ``force_control.load_sharing=adaptive``."""


def _samples_measured(scenario: Scenario) -> bool:
    """Whether sensors, or their supervision, add columns to the samples."""
    return scenario.setup.config.plausibility.enabled or bool(find_altered(scenario.sensors) - {"force"})


class _Stream:
    """A scenario under way, with arrays for the samples of some cycles; arguments as of :func:`stream`."""

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
        if is_live(scenario.plant):  # handing samples over takes longer than a step, so that it waits for the end
            cycles = config.cycles
        wide = _samples_measured(scenario)
        legs, joints = mechanism.shape
        self.samples, self.body = make_samples(cycles * config.steps_per_cycle, legs, wide, joints)
        if is_live(scenario.plant):
            self.samples.fill(0.0)  # else the system would find memory for them while the machine moves
        names = ALL_SAMPLES[: len(self.samples)]
        self.joints = [i for i, name in enumerate(names) if name.removesuffix("_measured") in JOINTS]
        self.end = End(0, Status.COMPLETED, "", setup.rate)
        if self.guard is not None:
            self.end.events = self.guard.events
        if self.adaptation is not None:
            self.end.load_history = self.adaptation.load_history

    @property
    def runs(self) -> bool:
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
        """Run until the arrays are full or the run ends, as at an interrupt or an error; returns the first step."""
        config, driver, end = self.config, self.driver, self.end
        start = driver.taken
        if self.adaptation is not None:
            self.adaptation.update_plan(start // config.steps_per_cycle + 1)
        steps = min(self.samples.shape[1], config.cycles * config.steps_per_cycle - start)
        self.body[TRAVEL[0] : TRAVEL[-1] + 1] = 0.0  # a body goes straight ahead unless the plant moves it
        self.body[TRAVEL[0], :steps] = np.arange(start, start + steps) * config.sampling_period * config.body_speed
        began, worked = time.perf_counter(), time.process_time()
        try:
            stop = self._drive(steps)
            if stop != RUNNING:
                plant, end.status = self.scenario.plant, STATUSES[stop]
                reported = driver.divergence or (plant.divergence if isinstance(plant, MujocoPlant) else "")
                period, state = config.sampling_period, driver.state
                end.cause = describe_stop(driver.loop.limits, stop, driver.taken, period, state, reported)
        except KeyboardInterrupt:
            end.status, end.cause = Status.INTERRUPTED, f"after step {driver.taken}"
        except Exception as raised:
            self.fail("", raised)
        end.seconds += time.perf_counter() - began
        end.processor_seconds += time.process_time() - worked
        end.steps = driver.taken
        return start

    @exits_caught()
    def _drive(self, most: int) -> int:
        """Take up to so many steps, by calls of the driver of a moment each; returns how the last one ended."""
        done, stop = 0, RUNNING
        while stop == RUNNING and done < most:
            raise_if_interrupted()
            steps, began = min(self._most_steps(), most - done), time.perf_counter()
            stop = self.driver.run(self.samples, self.body, done, steps)
            done += steps
            ends_cycle = self.driver.taken % self.config.steps_per_cycle == 0
            if ends_cycle:
                self._apply_estimate()
            adapts = stop == RUNNING and ends_cycle and self.adaptation is not None and self.adaptation.end_cycle()
            self.steps_per_call = max(1, int(steps * LONGEST_CALL / max(time.perf_counter() - began, 1e-6)))
            self.on_progress(self.driver.taken / self.config.steps_per_cycle)
            if adapts:
                break
        return stop

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
        on_drives = getattr(self.scenario.controller, "sends_drives", False)
        lead = estimate_lead(guard.probe.state, on_drives) or learning.lead
        if end.estimates and not on_drives:  # too short a lead does harm more often than one that is too long
            lead = max(lead, learning.lead + 1)
        end.rate = resolve_rate(self.config, LoopDelay(lead - 1), lead)
        if on_drives:
            end.rate *= 0.5 ** len(end.estimates)
        guard.learns_again = True
        learning = learning._replace(
            lead=lead,
            rate=np.full_like(learning.rate, end.rate),
            cycle_rate=float(learning.cycle_rate * end.rate / learning.rate[0]),
            start_step=self.driver.taken,
        )
        self.driver.loop = self.driver.loop._replace(feedforward=params._replace(learning=learning))
        end.estimates.append(LeadEstimate(self.driver.taken // self.config.steps_per_cycle + 1, lead))

    def collect(self, start: int) -> Samples:
        """The samples since step ``start``, which nothing changes from here on."""
        done = self.driver.taken - start
        if self.point_mass:
            self.samples[self.joints] = np.nan
        memory, feedforward = None, self.scenario.feedforward
        if isinstance(feedforward, BuiltInFeedforward):
            memory = feedforward.collect_memory(-(-done // self.config.steps_per_cycle))
            if memory is not None:
                memory["guard"] = self._guard_states(start, memory["rows"].shape)
        legs, body = self.samples[:, :done], self.body[:, :done]
        if self.runs:  # which fills them again
            legs, body = legs.copy(), body.copy()
        return Samples(start, legs, body, memory, self._list_live(start))

    def _list_live(self, start: int) -> dict[str, Array]:
        """LIVE_SIGNALS of the steps since ``start`` if the plant lists them, (steps,) each; NaN if that fails."""
        plant, steps = self.scenario.plant, self.driver.taken - start
        if not hasattr(plant, "list_steps"):
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
        """States of the guard of learning at the end of the cycles from step ``start`` on; ``shape`` (cycles, L)."""
        cycles, states = start // self.config.steps_per_cycle + 1 + np.arange(shape[0]), np.zeros(shape)
        changes = [(estimate.cycle, LEARNS) for estimate in self.end.estimates]
        changes += [(event.cycle, REPEATED if event.restored else FEEDBACK_ALONE) for event in self.end.events]
        for cycle, state in sorted(changes, key=itemgetter(0)):
            states[cycles >= cycle] = state
        return states


def stream(
    scenario: Scenario,
    keep: Callable[[Samples], None],
    on_progress: Callable[[float], None] = lambda cycles: None,
) -> End:
    """Run a scenario, whose components are reset, some cycles at a time; raises CmacexpError if it has run before.

    ``keep`` is called with the samples of these cycles, which it may keep; ``on_progress`` several times a second
    with the number of cycles done so far.

    Returns how it ended; samples are kept up to there, whether it diverged, failed or was interrupted.
    """
    scenario.begin()
    if scenario.fault is not None:
        legs, joints = scenario.setup.mechanism.shape
        none = dict.fromkeys((signal.name for signal in LIVE_SIGNALS), np.empty(0))
        keep(Samples(0, *make_samples(0, legs, _samples_measured(scenario), joints), None, none))
        cause = f"before the first step: {describe_failure(scenario.fault)}"
        return End(0, Status.FAILED, cause, scenario.setup.rate, scenario.fault)
    config = scenario.setup.config
    leg_steps = math.inf if is_live(scenario.plant) else config.cycles * config.steps_per_cycle * config.legs
    later: list[Samples] = []  # of a machine that must not wait for the files
    take = later.append if is_live(scenario.plant) else keep
    status: str = Status.FAILED
    fault: Exception | None = None
    with workload(leg_steps), interrupt_held_back():  # until the next call of the driver
        try:
            run = _Stream(scenario, on_progress)
            start = run.advance()
            while run.runs:
                take(run.collect(start))
                start = run.advance()
            status = run.end.status
        finally:
            try:
                come_to_rest(scenario.plant, status)
            except Exception as raised:
                fault = raised
        if fault is not None:
            run.fail("end_run, ", fault)
        if start == 0 or run.driver.taken > start:
            take(run.collect(start))
        for samples in later:
            keep(samples)
    return run.end
