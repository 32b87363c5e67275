"""Keys without effect, by evidence: runs that differ in one key alone, and whose results are equal.

Nothing is declared for this, so it holds for custom components too. A single run is judged by declarations instead
(:mod:`cmacexp.engine.without_effect`), since it has nothing that it could be compared with.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cmacexp.config.load import WITHOUT_EFFECT
from cmacexp.data.run import Run
from cmacexp.data.tables import BODY_METRICS_FILE, METRICS_FILE
from cmacexp.typing import RESULTS, Counts

MOST_NAMES = 5
"""Runs that a line names."""


def describe_result(run: Run) -> str:
    """How a stored run ended, after how many steps, and the hashes of its metrics, which every run has.

    Empty if it failed, has no whole cycle, or is not to warn. Raises BadRun.
    """
    if not run.config.get("warn", True) or run.status not in RESULTS or not run.whole_cycles:
        return ""
    hashes = [run.manifest["files"].get(name) for name in (METRICS_FILE, BODY_METRICS_FILE)]
    return repr((run.status, run.manifest["steps"], hashes))


def find_idle_keys(
    settings: Mapping[str, Sequence[Any]], results: Sequence[str | bytes], names: Sequence[object], what: str
) -> Iterator[tuple[str, str]]:
    """Each key that had no effect in some runs, ``what`` such as ``jobs``: ``warning`` or ``note``, and a line.

    A key had none if all runs that set it, and differ in its value alone, gave equal ``results``, and there are such
    runs; those whose result is empty do not count. ``settings`` are what
    :func:`cmacexp.engine.sweep_tables.collect_settings` gives. A seed only draws numbers that a run may not need:
    that is a note.
    """
    numbers, by_result = {key: _number(values) for key, values in settings.items()}, _number(results)
    for key, values in settings.items():
        counted = [value is not None and bool(result) for value, result in zip(values, results, strict=True)]
        runs = np.flatnonzero(counted)
        group = np.zeros(len(runs), dtype=int)  # of runs that differ in this key alone
        for own in (own for other, own in numbers.items() if other != key):
            group = np.unique(group * len(values) + own[runs], return_inverse=True)[1]
        alike = _count_distinct(group, numbers[key][runs]) > 1
        is_seen = (_count_distinct(group, by_result[runs])[alike] > 1).any()
        if is_seen or not alike.any() or key.partition(".")[0] in WITHOUT_EFFECT:
            continue
        listed = [str(names[run]) for run in runs[group == group[alike[group].argmax()]]]
        if len(listed) > MOST_NAMES:
            listed = [*listed[: MOST_NAMES - 1], "...", listed[-1]]
        equal = f"{what} {', '.join(listed)} gave equal results"
        if (more := int(alike.sum()) - 1) > 0:
            equal += f"; the same in {more} more group{'s' * (more > 1)} of {what}"
        if key.endswith("seed"):
            yield "note", f"{key} changes nothing here, one is enough: {equal}"
        else:
            yield "warning", f"{key} had no effect: {equal}"


def _number(values: Sequence[Any]) -> Counts:
    """The number of each of some values, from 0 on; equal ones have the same."""
    seen = dict[Any, int]()
    return np.array([seen.setdefault(value, len(seen)) for value in values], dtype=int)


def _count_distinct(group: Counts, number: Counts) -> Counts:
    """How many different numbers the members of each group have."""
    pairs = np.unique(np.stack([group, number]), axis=1)
    return np.bincount(pairs[0])
