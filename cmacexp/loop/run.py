"""Run a scenario from its first step to its last, or to where it stops by itself."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cmacexp.config import Config
from cmacexp.data.signals import ARRAYS
from cmacexp.errors import CmacexpError
from cmacexp.feedforward.network import BuiltInFeedforward
from cmacexp.feedforward.weight_log import MOST_CYCLES
from cmacexp.loop.builtin import ALL_EXTERNAL, FusedRun, external_components, fused_parts
from cmacexp.loop.external import SteppedLoop
from cmacexp.loop.interrupt import interrupt_held_back
from cmacexp.loop.samples import TRAVEL, WIDE_SAMPLES, make_samples, name_body_samples, name_samples
from cmacexp.loop.scenario import Scenario
from cmacexp.loop.stop import RUNNING, STATUSES, describe_stop, new_guard
from cmacexp.models.mechanism import POINT_MASS
from cmacexp.planning.plan import Plan
from cmacexp.planning.stability import STABILITY
from cmacexp.sensors.protocol import find_altered
from cmacexp.typing import Array

MOST_ROWS = 1 << 15
"""Rows of leg samples that are worked on at a time: a long run needs no more memory than a short one.

Entering the fused loop costs some 12 us, as much as dozens of steps.
"""


JOINTS = (*ARRAYS["q"], *ARRAYS["dq"])
"""Signals that are undefined for a point mass, measured or not."""


class Samples(NamedTuple):
    """What some steps of a closed loop gave, whole cycles unless the run ends in them."""

    start: int
    """First step."""
    legs: Array
    """(steps, L, columns), in the order of :mod:`cmacexp.loop.samples`."""
    body: Array
    """(steps, columns), likewise."""
    memory: dict[str, Array] | None
    """Columns of ``memory.parquet``, (cycles, L) by name; None without weights."""

    def columns(self) -> dict[str, Array]:
        """Of the legs, (steps, L) by column name."""
        return name_samples(self.legs)

    def body_columns(self) -> dict[str, Array]:
        """Of the body, (steps,) by column name."""
        return name_body_samples(self.body)


@dataclass(frozen=True)
class End:
    """How a closed loop ended."""

    steps: int
    """Steps taken."""
    status: str
    """``completed``, ``diverged``, ``fell``, ``interrupted`` or ``failed``."""
    cause: str
    """Why it is not completed: step, time and cause; empty if it is."""
    seconds: float
    """Wall time of the closed loop alone, compiling not counted."""
    error: Exception | None
    """What a part raised in the middle."""


def _told(raised: Exception) -> str:
    """What a part raised, in a line; ours say all themselves."""
    return " ".join(
        (str(raised) if isinstance(raised, CmacexpError) else f"{type(raised).__name__}: {raised}").split()
    )


class _Ending:
    """How a loop ends, as far as is known; what is raised in :meth:`caught` ends it."""

    def __init__(self, loop: "FusedRun | SteppedLoop"):
        self.loop = loop
        self.status, self.cause = "completed", ""
        self.error: Exception | None = None

    @contextmanager
    def caught(self) -> Iterator[None]:
        """Make an interrupt, or the mistake of a part, the end of the run instead of its loss."""
        try:
            yield
        except KeyboardInterrupt:
            self.status, self.cause = "interrupted", f"after step {self.loop.taken}"
        except Exception as raised:
            self.status, self.error = "failed", raised
            self.cause = f"after step {self.loop.taken}: {_told(raised)}"


def _memory(scenario: Scenario, cycles: int) -> dict[str, Array] | None:
    """What a built-in feedforward reports of its memory in the last ``cycles`` cycles."""
    feedforward = scenario.feedforward
    return feedforward.take_memory(cycles) if isinstance(feedforward, BuiltInFeedforward) else None


def _go_as_planned(body: Array, start: int, config: Config) -> None:
    """Where a body that goes straight ahead as planned is in the world; fills its columns of ``body``."""
    step = np.arange(start, start + len(body))
    body[:, TRAVEL] = 0.0
    body[:, TRAVEL[0]] = step * config.sampling_period * config.body_speed


def stream(
    scenario: Scenario,
    keep: Callable[[Samples], None],
    watch: Callable[[int], None] = lambda cycle: None,
    *,
    fused: bool = True,
) -> End:
    """Run a scenario, some cycles at a time.

    Args:
        scenario: the parts.
        keep: takes the samples of these cycles; their arrays are used again for the next ones.
        watch: is called after them with the cycles done so far; after every cycle of the step-by-step loop.
        fused: False calls every part step by step, as if none were built in.

    Raises:
        CmacexpError: the scenario has run before.

    Returns:
        How it ended; a run that diverges, that a part fails in or that is interrupted has kept what it has.
    """
    scenario.begin()
    setup = scenario.setup
    config, period, cycles = setup.config, setup.config.steps_per_cycle, setup.config.cycles
    guard = new_guard(setup.mechanism, setup.plan.margins[:, STABILITY], config.sampling_period)
    if scenario.fault is not None:
        keep(Samples(0, *make_samples(0, setup.mechanism.legs.shape[0], False), None))
        return End(0, "failed", f"before the first step: {_told(scenario.fault)}", 0.0, scenario.fault)
    external = external_components(scenario) if fused else ALL_EXTERNAL
    parts = fused_parts(scenario, external, guard)
    loop = SteppedLoop(scenario, parts, external) if any(external) else FusedRun(parts)
    legs = setup.mechanism.legs.shape[0]
    fits = min(max(1, MOST_ROWS // (period * legs)), MOST_CYCLES)
    together = min(cycles, fits if isinstance(loop, FusedRun) else 1)
    wide = config.plausibility.enabled or bool(find_altered(scenario.sensors) - {"force"})
    samples, body = make_samples(together * period, legs, wide)
    names = WIDE_SAMPLES[: samples.shape[2]]
    joints = [column for column, name in enumerate(names) if name.removesuffix("_measured") in JOINTS]
    ending, seconds = _Ending(loop), 0.0
    while ending.status == "completed" and loop.taken < cycles * period:
        start, steps = loop.taken, min(len(samples), cycles * period - loop.taken)
        _go_as_planned(body[:steps], start, config)
        began = time.perf_counter()
        with ending.caught():
            stop = loop.run(samples[:steps], body[:steps])
            if stop != RUNNING:
                q, dq, pose = loop.state.q, loop.state.dq, loop.state.body
                ending.status = STATUSES[stop]
                ending.cause = describe_stop(guard, stop, loop.taken, config.sampling_period, q, dq, pose)
        seconds += time.perf_counter() - began
        done = loop.taken - start
        if setup.mechanism.kind == POINT_MASS:
            samples[:done, :, joints] = np.nan
        with interrupt_held_back() as interrupted:
            keep(Samples(start, samples[:done], body[:done], _memory(scenario, -(-done // period))))
        if ending.status == "completed":
            with ending.caught():
                if interrupted():
                    raise KeyboardInterrupt
                watch(loop.taken // period)
    return End(loop.taken, ending.status, ending.cause, seconds, ending.error)


@dataclass(frozen=True)
class Rollout(End):
    """A closed loop with all its samples in memory."""

    plan: Plan
    samples: Array
    """(steps, L, columns), as :attr:`Samples.legs`."""
    body_samples: Array
    """(steps, columns), as :attr:`Samples.body`."""

    def columns(self) -> dict[str, Array]:
        """Samples (steps, L) by column name."""
        return Samples(0, self.samples, self.body_samples, None).columns()

    def body_columns(self) -> dict[str, Array]:
        """Samples of the body (steps,) by column name."""
        return Samples(0, self.samples, self.body_samples, None).body_columns()


def roll_out(scenario: Scenario, watch: Callable[[int], None] = lambda cycle: None, *, fused: bool = True) -> Rollout:
    """:func:`stream` with all samples kept in memory."""
    kept: list[tuple[Array, Array]] = []
    end = stream(scenario, lambda new: kept.append((new.legs.copy(), new.body.copy())), watch, fused=fused)
    samples, body = (np.concatenate(arrays) for arrays in zip(*kept, strict=True))
    return Rollout(**vars(end), plan=scenario.setup.plan, samples=samples, body_samples=body)
