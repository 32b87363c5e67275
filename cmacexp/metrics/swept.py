"""The settings in which runs differ, and short names of runs made from them, for all comparisons."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from cmacexp.config.component import COMPONENTS
from cmacexp.config.load import WITHOUT_EFFECT
from cmacexp.data.run import Run
from cmacexp.metrics.registry import format_setting, make_names

MOST_KEYS = 3
"""Most keys in the name of a run; runs that differ in more keys are named by their folders."""
Partition = tuple[int, ...]
"""Index of the first run with the same value, for each run: values a, b, a give (0, 1, 0)."""


class Swept(NamedTuple):
    """The settings in which runs differ."""

    keys: list[str]
    """Config keys that vary independently of each other."""
    linked: dict[str, list[str]]
    """Keys that vary together with one of ``keys``, listed under that key."""
    seeds: list[str]
    """Seeds that vary besides ``keys``; runs that differ only in seeds are repetitions."""

    @property
    def all_keys(self) -> list[str]:
        """Keys, then seeds: the columns of a table of runs."""
        return [*self.keys, *self.seeds]


def _partition(values: Sequence[Any]) -> Partition:
    texts = [repr(value) for value in values]
    return tuple(texts.index(text) for text in texts)


def _group_keys(configs: Sequence[dict[str, Any]]) -> dict[Partition, list[str]]:
    """Group the keys that vary by the partition of the runs that their values make.

    A key with a single value per scenario is grouped with the scenario.
    """
    scenarios = _partition([config.get("scenario") for config in configs])
    groups: dict[Partition, list[str]] = {}
    for key in dict.fromkeys(key for config in configs for key in config):
        runs = _partition([config.get(key) for config in configs])
        if not any(runs) or key.split(".")[0] in WITHOUT_EFFECT:
            continue
        follows_scenario = len(set(zip(scenarios, runs, strict=True))) == len(set(scenarios))
        groups.setdefault(scenarios if follows_scenario else runs, []).append(key)
    return groups


def _rank(key: str) -> tuple[int, int, str]:
    """Rank a key by how well it describes a difference: scenario, component or method, short keys; cycles last."""
    is_choice = key.endswith((".method", ".kind", ".model", ".rule", ".pattern"))
    order = [key == "scenario", key in COMPONENTS, is_choice, key != "cycles"]
    return (order.index(True) if True in order else len(order), len(key), key)


def find_swept(runs: Iterable[Run]) -> Swept:
    """Find the config keys in which runs differ; one key represents all that vary together with it."""
    groups = _group_keys([run.settings for run in runs if run.settings])
    linked = {first: linked_keys for first, *linked_keys in (sorted(keys, key=_rank) for keys in groups.values())}
    seeds = [key for key in linked if key.endswith("seed")]
    keys = [key for key in linked if key not in seeds]
    if not keys:
        return Swept(seeds, {}, [])
    return Swept(keys, {key: linked[key] for key in keys if linked[key]}, seeds)


def name_runs(runs: Sequence[Run], keys: Sequence[str]) -> list[str]:
    """Name each run by its values of the swept ``keys``.

    Names of folders are used instead if there are more than MOST_KEYS keys, or if the names would not be unique.
    """
    values = [[format_setting(run.settings.get(key)) for key in keys] for run in runs]
    short = [key.rpartition(".")[2] for key in keys]
    names = [", ".join(map(" ".join, zip(short, run_values, strict=True))) for run_values in values]
    is_unique = 0 < len(keys) <= MOST_KEYS and len(set(names)) == len(runs)
    return names if is_unique else make_names(runs)
