"""Many runs as one table, run in memory on all cores."""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cmacexp.config.compose import list_texts, refuse_options
from cmacexp.data.files import write_atomically
from cmacexp.data.tables import arrow, table_writer, write_table
from cmacexp.engine.chunk import RunEnd, run_chunk
from cmacexp.engine.equal_results import find_idle_keys
from cmacexp.engine.pool import choose_size, count_processes, group_runs, start_workers
from cmacexp.engine.sweep_tables import (
    collect_settings,
    concat_metrics,
    join_runs,
    make_column,
    read_settings,
    tabulate_settings,
)
from cmacexp.errors import OtherModel, WithoutEffect, require, require_name
from cmacexp.terminal.output import print_line

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
        WithoutEffect: of each key without effect, see ``docs/runs.md``; runs with ``warn=false`` do not count.
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


def _run_in_parts(runs: Sequence[Sequence[str]], keep: str, processes: int | None, most: int) -> Iterator[pa.Table]:
    """The table of :func:`run_many`, of so many runs at a time; warnings are in the name of the caller's caller."""
    require_name("keep", keep, KEPT)
    count = count_processes(processes)
    size, settings = choose_size(len(runs), count), collect_settings(map(read_settings, runs))
    known = pa.table({"run": make_column(range(len(runs))), **tabulate_settings(settings)})
    chunks = [
        (first, chunk)
        for first in range(0, len(runs), most)
        for chunk in group_runs(runs[first : first + most], size)
    ]
    items = [([runs[first + number] for number in chunk], keep == TRACE, len(runs)) for first, chunk in chunks]
    results, others = list[bytes](), dict[str, None]()
    with start_workers(count) as parallel_map:
        # While one part is written, the next one runs: none waits for the other.
        done = parallel_map("running", run_chunk, items, len(runs), 2 * max(most // size, count))
        for first, part in groupby(zip(chunks, done, strict=True), lambda each: each[0][0]):
            own_chunks, ended = zip(*part, strict=True)
            order = np.concatenate([chunk for _, chunk in own_chunks])
            ends: list[RunEnd] = [end for chunk, _ in ended for end in chunk]
            in_order = [ends[place] for place in order.argsort()]
            results += [end.result for end in in_order]
            others |= dict.fromkeys(end.other_model for end in in_order if end.other_model)
            own = known.take(arrow(first + order, pa.int64())).append_column(
                "status", make_column([end.status for end in ends])
            )
            index: Any = np.repeat(np.arange(len(order)), [end.rows for end in ends])
            table = join_runs(own, concat_metrics([table for _, table in ended])[0], index)
            if (np.diff(order) != 1).any():
                table = table.take(arrow(order[index].argsort(kind="stable"), pa.int64()))
            yield table
    for other in others:
        warnings.warn(other, OtherModel, stacklevel=3)
    for kind, text in find_idle_keys(settings, results, range(len(runs)), "runs"):
        if kind == "warning":
            warnings.warn(text, WithoutEffect, stacklevel=3)
        else:
            print_line(f"{kind}: {text}", error=True)
