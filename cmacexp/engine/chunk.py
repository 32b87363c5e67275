"""Some of many runs in one process: each is simulated alone, and those that are alike are scored together.

Most of what the metrics of a short run take is the overhead of calls, which does not grow with the number of legs.
"""

import hashlib
from collections import defaultdict, deque
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pyarrow as pa

from cmacexp.config import Config
from cmacexp.config.compose import compose_config
from cmacexp.config.machine import describe_other_model
from cmacexp.config.schema import ADAPTIVE
from cmacexp.data.tables import BODY_METRICS_FILE, METRICS_FILE, Scores, as_array
from cmacexp.data.trace import Trace, concat_traces
from cmacexp.engine.run import sample_scenario, score_scenario
from cmacexp.engine.stop_cause import explain_stop
from cmacexp.engine.sweep_tables import concat_metrics, join_scores
from cmacexp.jit.compiler import expect_runs
from cmacexp.jit.interrupt import is_interrupt
from cmacexp.loop import End
from cmacexp.loop.repeated import Repeated, split_runs
from cmacexp.loop.run import MOST_CYCLES
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.loop.trace import Sampled, assemble, join_runs
from cmacexp.metrics.body import compute_body
from cmacexp.metrics.drift import make_drift_entry, read_drift_entry
from cmacexp.metrics.score import RunScorer
from cmacexp.typing import RESULTS, Status

SHORT = 1 << 13
"""Rows of the trace of a run, up to which it is kept until it can be scored together with others."""


class RunEnd(NamedTuple):
    """How one of many runs ended."""

    status: str
    result: bytes
    """The same for runs that gave equal results; empty where there is none to compare."""
    other_model: str
    """Says that its robot is not the one that results were measured with; empty if it is."""
    rows: int
    """Number of rows of the run in the table of all."""


class Chunk:
    """Runs of one process, and their metrics."""

    _repeated: ClassVar[tuple[Any, Repeated] | None] = None
    """What the last runs that could share a scenario have in common, and that, also of an earlier chunk."""

    def __init__(self, keeps_trace: bool = False):
        """Begin without runs; the traces of all of them are kept, else of short runs until they are scored."""
        self._keeps_trace = keeps_trace
        self.traces = dict[int, pa.Table]()
        self._sampled = dict[int, Sampled]()
        """Samples of the runs that are not scored yet."""
        self._configs, self._scores = dict[int, Config](), dict[int, Scores]()
        self.hashes = dict[int, dict[str, str]]()
        """SHA-256 of the values of each table of metrics of the runs that are scored, by the name of its file."""

    def _share(self, configs: Sequence[Config]) -> Repeated | Scenario:
        """What starts runs of these configs, which can share a scenario, at once; else a scenario of the first."""
        alike = len(configs), find_shared(configs[0])
        if Chunk._repeated is None or Chunk._repeated[0] != alike:
            scenario = make_scenario(configs[0])
            if not Repeated.serves(scenario, len(configs)):
                return scenario
            Chunk._repeated = alike, Repeated(scenario, len(configs))
        return Chunk._repeated[1]

    def _run_at_once(
        self, numbers: Sequence[int], configs: Sequence[Config]
    ) -> Iterator[tuple[Scenario, End]] | None:
        """Run those of these numbers, whose configs can share a scenario, at once; None if each is to run alone."""
        first, count = configs[0], len(configs)
        if self._keeps_trace or count == 1 or first.legs > 1 or not _is_short(first):
            return None
        try:
            if not isinstance(shared := self._share(configs), Repeated):
                return None
            scenario = shared.start(configs)
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            return None  # what is wrong concerns each of them, and what is too large may fit alone
        end, scorer = score_scenario(scenario, machines=count)
        if end.status == Status.INTERRUPTED:
            raise KeyboardInterrupt
        if end.status != Status.COMPLETED:  # as one leg at least, but not all of them
            return None
        self._add_scores(numbers, scorer.scores.legs, [None] * count)
        self._configs |= zip(numbers, configs, strict=True)
        return split_runs(scenario, configs, end)

    def list_runs(self, configs: Mapping[int, Config]) -> Iterator[tuple[int, Callable[[], tuple[Scenario, End]]]]:
        """What runs each of these configs, whose numbers are given; it is to be called before the next one.

        Those in a row that can share a scenario have run at once, if possible. It returns a scenario, which is that
        of the run until the next one, and how it ended; it raises what :func:`make_scenario` raises.
        """
        for _, group in groupby(configs.items(), lambda each: find_shared(each[1])):
            numbers, alike = zip(*group, strict=True)
            at_once = self._run_at_once(numbers, alike)
            for number, config in zip(numbers, alike, strict=True):
                run_alone = partial(self._run_alone, number, config, len(alike) > 1)
                yield number, run_alone if at_once is None else partial(next, at_once)

    def _run_alone(self, number: int, config: Config, is_repeated: bool) -> tuple[Scenario, End]:
        """Run the one of this number, which can share the scenario of another run if it ``is_repeated``."""
        shared = self._share([config]) if is_repeated else make_scenario(config)
        scenario = shared.start([config]) if isinstance(shared, Repeated) else shared
        traces = deque[Trace](maxlen=None if self._keeps_trace else 2)  # the last part may be short
        parts = list[Sampled]()
        if not self._keeps_trace and _is_short(config):
            end = sample_scenario(scenario, parts.append)
            (self._sampled[number],) = parts
        else:
            end, scorer = score_scenario(scenario, traces.append)
            self._add_scores([number], scorer.scores.legs, [scorer.scores.body])
        self._configs[number] = config  # not before: one that raised has no metrics
        if self._keeps_trace:
            self.traces[number] = concat_traces(traces).table
        elif end.status in (Status.FELL, Status.DIVERGED):
            traces.extend(map(assemble, parts))
            drift = read_drift_entry(make_drift_entry(self.score()[number].legs))
            end = replace(end, cause=end.cause + explain_stop(scenario, end, traces, drift))
        return scenario, end

    def score(self) -> dict[int, Scores]:
        """The metrics of all runs by their numbers, in their order."""
        groups = defaultdict[Hashable, list[int]](list)  # equally many steps of the same phases, and the same signals
        for number, run in self._sampled.items():
            phases = run.plan.support.tobytes(), run.plan.progress.tobytes(), run.plan.start_step
            signals = *run.samples, *(signal.name for signal in run.columns), run.memory is None, run.steered
            groups[*phases, *signals, run.sampling_period, run.samples["x"].shape].append(number)
        for numbers in groups.values():
            steps_per_cycle = self._configs[numbers[0]].steps_per_cycle
            runs = [self._sampled[number] for number in numbers]
            scorer = RunScorer(steps_per_cycle, len(runs))
            scorer.add(assemble(join_runs(runs)))
            bodies = [None if run.body is None else compute_body(run.body, steps_per_cycle) for run in runs]
            self._add_scores(numbers, scorer.scores.legs, bodies)
        self._sampled.clear()
        return {number: self._scores[number] for number in self._configs}

    def _add_scores(self, numbers: Sequence[int], table: pa.Table, bodies: Sequence[pa.Table | None]) -> None:
        """Note the metrics of runs, whose rows follow one another in a table, equally many of each."""
        rows, hashes = table.num_rows // len(numbers), _hash_rows(table, len(numbers))
        for place, (number, body) in enumerate(zip(numbers, bodies, strict=True)):
            self._scores[number] = Scores(table.slice(place * rows, rows), body)
            self.hashes[number] = {METRICS_FILE: hashes[place]}
            if body is not None:
                (self.hashes[number][BODY_METRICS_FILE],) = _hash_rows(body, 1)


def find_shared(config: Config) -> dict[str, Any]:
    """What runs have in common that share a scenario: all but the rate, and the seed if only a feedforward draws."""
    seed = config.seed if getattr(config.sensors, "draws", True) else None
    return {**vars(config), "learning": {**vars(config.learning), "rate": None}, "seed": seed}


def _is_short(config: Config) -> bool:
    """Whether a run is handed over as a whole, and its samples are few enough to be kept."""
    fits = config.cycles * config.steps_per_cycle * config.legs <= SHORT and config.cycles <= MOST_CYCLES
    return fits and config.force_control.load_sharing != ADAPTIVE


def _hash_rows(table: pa.Table, runs: int) -> list[str]:
    """SHA-256 of the rows of each of some runs, which follow one another in a table, equally many of each."""
    values = np.column_stack([as_array(table, name) for name in table.column_names])
    return [hashlib.sha256(own.tobytes()).hexdigest() for own in np.split(values, runs)]


def run_chunk(chunk: Sequence[list[str]], keeps_trace: bool, runs: int) -> tuple[list[RunEnd], pa.Table]:
    """Run configs of these overrides, some of so many runs: how they ended, and their metrics, or their traces.

    Raises CmacexpError if one of them cannot be run.
    """
    expect_runs(runs)
    together, ended = Chunk(keeps_trace), list[tuple[Config, End]]()
    # Twice as fast in a row as between runs.
    configs = [compose_config(overrides, is_shared=True) for overrides in chunk]
    for number, run in together.list_runs(dict(enumerate(configs))):
        ended.append((configs[number], run()[1]))
    scores = list(together.score().values())
    tables = [*together.traces.values()] if keeps_trace else [*map(join_scores, scores)]
    hashes = [together.hashes[number] for number in range(len(ended))]
    return [
        RunEnd(end.status, _hash_result(config, end, of), describe_other_model(config.machine), table.num_rows)
        for (config, end), of, table in zip(ended, hashes, tables, strict=True)
    ], concat_metrics(tables)[0].combine_chunks()  # a slice is pickled with all that it is a slice of


def _hash_result(config: Config, end: End, hashes: dict[str, str]) -> bytes:
    """SHA-256 of how a run ended, after how many steps, and its metrics, unless it failed or is not to warn."""
    if not config.warn or end.status not in RESULTS or end.steps < config.steps_per_cycle:
        return b""
    return hashlib.sha256(repr((end.status, end.steps, hashes)).encode()).digest()
