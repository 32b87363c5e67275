"""Many runs as one table, run in memory on all cores."""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from omegaconf import DictConfig

from cmacexp.config.compose import compose_config, compose_untyped, list_texts, refuse_options
from cmacexp.config.machine import describe_other_model
from cmacexp.data.files import write_atomically
from cmacexp.data.tables import table_writer, write_table
from cmacexp.data.trace import concat_traces
from cmacexp.engine.pool import choose_size, count_processes, start_workers
from cmacexp.engine.run import score_run
from cmacexp.engine.sweep_tables import (
    collect_settings,
    concat_metrics,
    join_runs,
    join_scores,
    make_column,
    read_settings,
    tabulate_settings,
)
from cmacexp.engine.without_effect import IdleKeys, join_idle
from cmacexp.errors import OtherModel, WithoutEffect, require, require_name
from cmacexp.jit.compiler import expect_runs
from cmacexp.loop import run_cycles
from cmacexp.loop.scenario import make_scenario
from cmacexp.planning import Recall

if TYPE_CHECKING:
    import pandas as pd

METRICS, TRACE = KEPT = ("metrics", "trace")
AT_ONCE = {METRICS: 1 << 10, TRACE: 1 << 5}
"""Runs whose results are in memory at a time while they are written, by what is kept."""


def run_many(runs: Sequence[Sequence[str]], keep: str = METRICS, processes: int | None = None) -> "pd.DataFrame":
    """Run many configs in memory, in processes on all cores, compiled where that pays off for all of them together.

    Args:
        runs: overrides of each run, as :func:`run` takes them.
        keep: ``metrics``, a row for each run, cycle and leg, or ``trace``, a row for each run, step and leg.
        processes: how many; None: one for each core that this process may use.

    Returns:
        A table: ``run``, its number; a column for each key that some run overrides; ``status``; the columns of
        ``metrics.parquet`` and ``body_metrics.parquet``, or of ``trace.parquet``.

    Raises:
        CmacexpError: one of them cannot be run; nothing is returned then.

    Warns:
        OtherModel: of each robot whose model is not the one that results were measured with.
        WithoutEffect: of each key without effect in all runs that set it; none of runs with ``warn=false``.
    """
    listed = _list_runs(runs)
    (table,) = _run_in_parts(listed, keep, processes, len(listed))
    return table.to_pandas()


def write_many(
    file: str | Path, runs: Sequence[Sequence[str]], keep: str = METRICS, processes: int | None = None
) -> None:
    """Write the table of :func:`run_many` to one Parquet file, in little more memory than the overrides take.

    Args, errors and warnings are the same; a column that a run lacks is null. The file is whole or absent.
    """
    place, listed = Path(file), _list_runs(runs)
    require(not place.is_dir(), "file", place, "is a folder: name a file")
    with write_atomically(place) as whole, TemporaryDirectory(dir=place.parent, prefix=".") as folder:
        parts = list[Path]()
        for part in _run_in_parts(listed, keep, processes, AT_ONCE.get(keep, 1)):
            parts.append(Path(folder) / f"{len(parts)}.parquet")
            write_table(part, parts[-1])
        # No part knows the columns of later ones, and all must have run before one may be refused.
        schema = pa.unify_schemas([pq.read_schema(each) for each in parts])
        with table_writer(whole, schema) as writer:
            for each in parts:
                own = pq.read_table(each)
                writer.write_table(pa.concat_tables([schema.empty_table(), own], promote_options="default"))


def _list_runs(runs: Iterable[Sequence[str]]) -> list[list[str]]:
    """The overrides of each run; raises BadInput if there are none, or what is given is something else."""
    fits = isinstance(runs, Iterable) and not isinstance(runs, str)
    require(fits, "runs", runs, 'must be a list of lists of overrides, such as [["cycles=3"]]')
    listed = []
    for overrides in runs:
        is_list = not isinstance(overrides, str)
        require(is_list, "runs", overrides, f"must be a list of lists of overrides: [[{overrides!r}]]")
        listed.append(list_texts(overrides))
        refuse_options(listed[-1])
    require(listed, "runs", listed, "must have at least one run")
    return listed


class ManyEnd(NamedTuple):
    """How one of many runs ended, for the table of all."""

    status: str
    rows: int
    """Rows of the run in the table."""
    idle: dict[str, str]
    """Keys without effect, as :meth:`IdleKeys.find` gives them."""
    other_model: str
    """Says that its robot is not the one that results were measured with; empty if it is."""


def run_chunk(chunk: Sequence[list[str]], keep: str, runs: int) -> tuple[list[ManyEnd], pa.Table]:
    """Run some of so many ``runs``: how they ended, and their metrics, or their traces.

    Raises CmacexpError if one of them cannot be run.
    """
    expect_runs(runs)
    recall, idle_keys = Recall(), IdleKeys()
    ends, tables = list[ManyEnd](), list[pa.Table]()
    # Twice as fast in a row as between runs.
    for overrides, config in zip(chunk, [compose_config(each, is_shared=True) for each in chunk], strict=True):
        scenario = make_scenario(config, None, recall)
        if keep == TRACE:
            tables.append(concat_traces([*run_cycles(scenario)]).table)
        else:
            tables.append(join_scores(score_run(scenario)))
        idle = idle_keys.find(config, overrides, partial(_compose_untyped, overrides))
        ends.append(ManyEnd(scenario.end.status, tables[-1].num_rows, idle, describe_other_model(config.machine)))
    return ends, concat_metrics(tables)[0].combine_chunks()  # a slice is pickled with all that it is a slice of


def _compose_untyped(overrides: Sequence[str]) -> DictConfig:
    return compose_untyped(overrides)[0]


def _run_in_parts(runs: Sequence[Sequence[str]], keep: str, processes: int | None, most: int) -> Iterator[pa.Table]:
    """The table of :func:`run_many`, of so many runs at a time; warnings are in the name of the caller's caller."""
    require_name("keep", keep, KEPT)
    count = count_processes(processes)
    size, settings = choose_size(len(runs), count), collect_settings(map(read_settings, runs))
    known = pa.table({"run": make_column(range(len(runs))), **tabulate_settings(settings)})
    starts = [(first, range(first, min(first + most, len(runs)), size)) for first in range(0, len(runs), most)]
    items = [
        (list(runs[start : min(start + size, first + most)]), keep, len(runs))
        for first, chunks in starts
        for start in chunks
    ]
    ends = list[ManyEnd]()
    with start_workers(count) as parallel_map:
        # While one part is written, the next one runs: none waits for the other.
        done = parallel_map("running", run_chunk, items, len(runs), 2 * max(most // size, count))
        for first, chunks in starts:
            part = [next(done) for _ in chunks]
            own = [end for chunk_ends, _ in part for end in chunk_ends]
            statuses = make_column([end.status for end in own])
            labels = known.slice(first, len(own)).append_column("status", statuses)
            index: Any = np.repeat(np.arange(len(own)), [end.rows for end in own])
            ends += own
            yield join_runs(labels, concat_metrics([table for _, table in part])[0], index)
        assert next(done, None) is None, "more results than parts of the table"
    for other in dict.fromkeys(end.other_model for end in ends if end.other_model):
        warnings.warn(other, OtherModel, stacklevel=3)
    for text in join_idle(settings, [end.idle for end in ends]):
        warnings.warn(text, WithoutEffect, stacklevel=3)
