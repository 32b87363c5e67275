"""Some of many runs in one process: each is simulated alone, and those that are alike are scored together.

Most of what the metrics of a short run take is the overhead of calls, which does not grow with the number of legs.
"""

import hashlib
from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import NamedTuple

import pyarrow as pa

from cmacexp.config import Config
from cmacexp.config.compose import compose_config
from cmacexp.config.machine import describe_other_model
from cmacexp.data.parquet import as_array
from cmacexp.data.tables import Scores
from cmacexp.data.trace import SampledTrace, join_sampled
from cmacexp.engine.pool import report_share
from cmacexp.engine.run import sample_scenario, score_scenario
from cmacexp.engine.sweep_tables import concat_metrics, join_scores
from cmacexp.jit.compiler import expect_runs
from cmacexp.loop import End
from cmacexp.loop.scenario import make_scenario
from cmacexp.metrics.score import score_together
from cmacexp.typing import RESULTS

SHORT = 1 << 13
"""Rows of the trace of a run, up to which it is kept until it can be scored together with others."""


class RunEnd(NamedTuple):
    """How one of many runs ended."""

    status: str
    result: str
    """The same for runs that gave equal results; empty where there is none to compare."""
    other_model: str
    """That its robot is not the one that results were measured with; empty if it is."""
    rows: int
    """Of the run in the table of all."""


def run_chunk(chunk: Sequence[list[str]], keeps_trace: bool, runs: int) -> tuple[list[RunEnd], pa.Table]:
    """Run configs of these overrides, some of so many runs: how they ended, and their metrics, or their traces.

    Raises CmacexpError if one of them cannot be run.
    """
    expect_runs(runs)
    configs, ends, scores = list[Config](), list[End](), dict[int, Scores]()
    traces = dict[int, SampledTrace]()
    for number, overrides in enumerate(chunk):
        config = compose_config(overrides)
        configs.append(config)
        scenario, parts = make_scenario(config), list[SampledTrace]()
        if keeps_trace or config.cycles * config.steps_per_cycle * config.legs <= SHORT:
            ends.append(sample_scenario(scenario, parts.append))
            traces[number] = join_sampled(parts, axis=0)
        else:
            end, scorer = score_scenario(scenario)
            ends.append(end)
            scores[number] = scorer.scores
        report_share((number + 1) / len(chunk))
    for alike in _group(configs, traces):
        found = score_together([traces[number] for number in alike], configs[alike[0]].steps_per_cycle)
        scores |= zip(alike, found, strict=True)
    tables = [trace.table for trace in traces.values()] if keeps_trace else [*map(join_scores, _in_order(scores))]
    return [
        RunEnd(
            end.status,
            _describe_result(config, end, scores[number]),
            describe_other_model(config.machine),
            tables[number].num_rows,
        )
        for number, (config, end) in enumerate(zip(configs, ends, strict=True))
    ], concat_metrics(tables)[0].combine_chunks()  # a slice is pickled with all that it is a slice of


def _group(configs: Sequence[Config], traces: Mapping[int, SampledTrace]) -> Iterable[list[int]]:
    """Numbers of runs that can be scored together: with equally many steps of the same gait, and the same signals."""
    groups = defaultdict[Hashable, list[int]](list)
    for number, trace in traces.items():
        config = configs[number]
        rhythm = repr(config.gait), config.sampling_period, *trace.shape
        groups[*rhythm, *trace.names, *trace.arrays, trace.memory is None].append(number)
    return groups.values()


def _in_order(scores: Mapping[int, Scores]) -> list[Scores]:
    return [scores[number] for number in range(len(scores))]


def _describe_result(config: Config, end: End, scores: Scores) -> str:
    """How a run ended, after how many steps, and the hashes of its metrics, unless it failed or is not to warn."""
    if not config.warn or end.status not in RESULTS or end.steps < config.steps_per_cycle:
        return ""
    tables = [table for table in scores if table is not None]
    columns = (as_array(table, name).tobytes() for table in tables for name in table.column_names)
    return repr((end.status, end.steps, hashlib.sha256(b"".join(columns)).hexdigest()))
