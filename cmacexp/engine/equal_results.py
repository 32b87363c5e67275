"""Keys without effect, by evidence: runs that differ in one key alone, and whose results are equal.

Nothing is declared for this, so it holds for custom components too. A single run is judged by declarations instead
(:mod:`cmacexp.engine.without_effect`), since it has nothing that it could be compared with.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from cmacexp.config.load import WITHOUT_EFFECT
from cmacexp.data.run import Run
from cmacexp.data.tables import BODY_METRICS_FILE, METRICS_FILE
from cmacexp.typing import RESULTS

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
    settings: Mapping[str, Sequence[Any]], results: Sequence[str], names: Sequence[str], what: str
) -> Iterator[tuple[str, str]]:
    """Each key that had no effect in some runs, ``what`` such as ``jobs``: ``warning`` or ``note``, and a line.

    A key had none if all runs that set it, and differ in its value alone, gave equal ``results``, and there are such
    runs; those whose result is empty do not count. ``settings`` are what
    :func:`cmacexp.engine.sweep_tables.collect_settings` gives. A seed only draws numbers that a run may not need:
    that is a note.
    """
    for key, values in settings.items():
        if len(set(values)) < 2:
            continue
        others = [column for other, column in settings.items() if other != key]
        groups = defaultdict[tuple[Any, ...], list[int]](list)
        for number, value in enumerate(values):
            if value is not None and results[number]:
                groups[tuple(column[number] for column in others)].append(number)
        alike = [group for group in groups.values() if len({values[number] for number in group}) > 1]
        is_seen = any(len({results[number] for number in group}) > 1 for group in alike)
        if is_seen or not alike or key.partition(".")[0] in WITHOUT_EFFECT:
            continue
        listed = [names[number] for number in alike[0]]
        if len(listed) > MOST_NAMES:
            listed = [*listed[: MOST_NAMES - 1], "...", listed[-1]]
        equal = f"{what} {', '.join(listed)} gave equal results"
        if len(alike) > 1:
            equal += f"; the same in {len(alike) - 1} more group{'s' * (len(alike) > 2)} of {what}"
        if key.endswith("seed"):
            yield "note", f"{key} changes nothing here, one is enough: {equal}"
        else:
            yield "warning", f"{key} had no effect: {equal}"
