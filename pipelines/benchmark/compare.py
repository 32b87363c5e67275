"""Two results of the benchmark, compared: what changed for which method, in the same worlds."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.data.parquet import read_table
from cmacexp.errors import BadInput
from cmacexp.study import Comparison
from pipelines.benchmark.summary import make_comparison

SAME = ("version", "tasks_hash")
"""Entries in which results must agree to be compared."""


def _read(path: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """A table of results, and the JSON beside it.

    Raises:
        BadInput: one of them is missing, or is none.
    """
    beside = path.with_suffix(".json")
    try:
        entry = json.loads(beside.read_text(encoding="utf-8"))
        frame = read_table(path, texts=True).to_pandas()
    except (OSError, ValueError) as error:
        allowed = f"must be a table of results with {beside.name} beside it: {error}"
        raise BadInput("--compare", path, allowed) from error
    if not isinstance(entry, dict) or not set(SAME) <= set(entry) or "end_error" not in frame:
        raise BadInput("--compare", path, "must be benchmark.parquet of a report of the benchmark")
    return frame, entry


def compare_results(first: Path, second: Path) -> Iterator[str]:
    """A line for each machine, method and kind of setting that both have and that changed: its score and failures.

    The score is the mean over the runs that complete in both, as a ratio of the second to the first.

    Raises:
        BadInput: a file is no result, or they are of different tasks.
    """
    (before, of_before), (after, of_after) = _read(first), _read(second)
    for name in SAME:
        if of_before[name] != of_after[name]:
            raise BadInput("--compare", second, f"has another {name} than {first}: their scores mean other things")
    places = [frame[["machine", "setting"]].drop_duplicates() for frame in (before, after)]
    for machine, setting in pd.merge(*places).itertuples(index=False):
        old, new = (make_comparison(frame, machine, setting) for frame in (before, after))
        for method in (name for name in old.scores if name in new.scores):
            pair = Comparison({"old": old.scores[method], "new": new.scores[method]}, old.tasks, old.worlds)
            if not np.array_equal(pair.scores["old"], pair.scores["new"]):
                found, failed = pair.ratio("new", "old"), [(~pair.completed(name)).sum() for name in pair.scores]
                text = f"score times {found.value:.3f} [{found.low:.3f}, {found.high:.3f}]"
                yield f"{machine}, {method}, {setting}: {text}, failed {failed[0]}, then {failed[1]}"
    yield "no other score has changed"
