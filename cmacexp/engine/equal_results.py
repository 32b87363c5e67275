"""Keys without effect, by evidence: runs that differ in one key alone, and whose results are equal.

Nothing is declared for this, so it holds for custom components too. A single run is judged by declarations instead
(:mod:`cmacexp.engine.without_effect`), since it has nothing that it could be compared with.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from cmacexp.config import config_hash, to_plain
from cmacexp.config.compose import compose_config
from cmacexp.data.run import Run
from cmacexp.data.tables import BODY_METRICS_FILE, METRICS_FILE
from cmacexp.engine.sweep_tables import JobRun
from cmacexp.terminal.output import print_line
from cmacexp.typing import RESULTS

MOST_NAMES = 5
"""Runs that a line names."""


class Outcome(NamedTuple):
    """What a run was of, and what it gave; metrics are all that is compared, since every run has them."""

    hash_config: Callable[[], str]
    """The hash of its config, without what cannot change a result: two runs of one config prove nothing."""
    result: str
    """How it ended, after how many steps, and the hashes of its metrics."""


def hash_overrides(overrides: Sequence[str]) -> str:
    """The hash of the config of these overrides."""
    return config_hash(to_plain(compose_config(overrides)))


def read_outcome(run: Run) -> Outcome | None:
    """The outcome of a stored run, whose manifest has the hashes of its files; raises BadRun.

    None if it failed, has no whole cycle, or is not to warn.
    """
    if isinstance(run, JobRun):
        return Outcome(partial(run.read, "config_hash"), result) if (result := run.read("result")) else None
    if not run.config.get("warn", True) or run.status not in RESULTS or not run.whole_cycles:
        return None
    hashes = [run.manifest["files"].get(name) for name in (METRICS_FILE, BODY_METRICS_FILE)]
    found = run.manifest["config_hash"]
    return Outcome(lambda: found, repr((run.status, run.manifest["steps"], hashes)))


def find_idle_keys(
    settings: Sequence[Mapping[str, Any]], outcomes: Sequence[Outcome | None], names: Sequence[str], what: str
) -> Iterator[tuple[str, str]]:
    """Each key that had no effect in some runs, ``what`` such as ``jobs``: ``warning`` or ``note``, and a line.

    A key had none if all runs that differ in it alone gave equal results, and there are such runs; those without an
    outcome do not count. ``settings`` are the values that each run has for the keys of all. A seed only draws numbers
    that a run may not need: that is a note.
    """
    known = zip(settings, outcomes, names, strict=True)
    runs = [(values, outcome, name) for values, outcome, name in known if outcome is not None]
    for key in settings[0] if settings else ():
        groups = defaultdict[str, list[tuple[Outcome, str]]](list)
        for values, outcome, name in runs:
            groups[repr([value for other, value in values.items() if other != key])].append((outcome, name))
        alike = [group for group in groups.values() if len(group) > 1]
        if any(outcome.result != group[0][0].result for group in alike for outcome, _ in group):
            continue
        firsts = ((group, group[0][0].hash_config()) for group in alike)
        proof = next((group for group, first in firsts if any(o.hash_config() != first for o, _ in group)), None)
        if proof is None:
            continue
        listed = [name for _, name in proof]
        if len(listed) > MOST_NAMES:
            listed = [*listed[: MOST_NAMES - 1], "...", listed[-1]]
        equal = f"{what} {', '.join(listed)} gave equal results"
        if len(alike) > 1:
            equal += f"; the same in {len(alike) - 1} more group{'s' * (len(alike) > 2)} of {what}"
        if key.endswith("seed"):
            yield "note", f"{key} changes nothing here, one is enough: {equal}"
        else:
            yield "warning", f"{key} had no effect: {equal}"


def print_idle_keys(settings: Sequence[Mapping[str, Any]], runs: Sequence[Run], what: str) -> None:
    """Print :func:`find_idle_keys` of stored runs, each named as its folder; raises BadRun."""
    outcomes, names = [read_outcome(run) for run in runs], [run.folder.name for run in runs]
    for kind, text in find_idle_keys(settings, outcomes, names, what):
        print_line(f"{kind}: {text}", error=True)
