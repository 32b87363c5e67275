"""The report of several runs: in which settings they differ, how each ended, and their metrics."""

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cmacexp.config.component import COMPONENTS
from cmacexp.config.load import WITHOUT_EFFECT
from cmacexp.data.run import Run
from cmacexp.data.tables import TABLES
from cmacexp.metrics.run_table import format_runs, make_names
from cmacexp.metrics.text import format_setting
from cmacexp.report.page import HOW_TO_REPORT, Report
from cmacexp.report.page_elements import Section, Table
from cmacexp.report.sweep_figures import draw_learning_curves, draw_over_key

Partition = tuple[int, ...]
"""For each run the first run that has the same value: values a, b, a give (0, 1, 0)."""


class Swept(NamedTuple):
    """The settings in which runs differ."""

    keys: list[str]
    """Config keys that vary independently of each other."""
    linked: dict[str, list[str]]
    """Keys that vary together with one of ``keys``, by that key."""
    seeds: list[str]
    """Seeds that vary besides ``keys``: runs that differ in them alone repeat each other."""


def _partition(values: Sequence[Any]) -> Partition:
    texts = [repr(value) for value in values]
    return tuple(texts.index(text) for text in texts)


def _group_keys(configs: Sequence[dict[str, Any]]) -> dict[Partition, list[str]]:
    """The keys that differ, by the runs between which they differ.

    A key that has one value for each scenario belongs to the scenario.
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
    """Order in which keys describe a difference: the scenario, the component or method chosen, the shortest key."""
    order = [key == "scenario", key in COMPONENTS, key.endswith((".method", ".kind", ".rule", ".pattern"))]
    return (order.index(True) if True in order else len(order), len(key), key)


def find_swept(runs: Iterable[Run]) -> Swept:
    """The config keys in which runs differ; of keys that differ between the same runs, one stands for all."""
    groups = _group_keys([run.settings for run in runs if run.settings])
    linked = {first: others for first, *others in (sorted(keys, key=_rank) for keys in groups.values())}
    seeds = [key for key in linked if key.endswith("seed")]
    keys = [key for key in linked if key not in seeds]
    if not keys:
        return Swept(seeds, {}, [])
    return Swept(keys, {key: linked[key] for key in keys if linked[key]}, seeds)


def _list_stopped(runs: Sequence[Run]) -> list[Any]:
    """Runs that stopped or are broken, each with its reason."""
    named = zip(make_names(runs), runs, strict=True)
    rows = [[name, *run.outcome] for name, run in named if not run.completed]
    caption = "Runs that did not complete; figures show only those that fell or diverged"
    return [Table(["run", "status", "reason"], rows, caption)] if rows else []


def _list_differences(runs: Sequence[Run], swept: Swept) -> list[Any]:
    rows = []
    for key in [*swept.keys, *swept.seeds]:
        values = list(dict.fromkeys(format_setting(run.settings.get(key)) for run in runs if run.settings))
        listed = ", ".join(values[:12]) + (f", ... ({len(values)} values)" if len(values) > 12 else "")
        rows.append([key, listed, *([", ".join(swept.linked.get(key, []))] if swept.linked else [])])
    if not rows:
        same = "These runs have the same config, apart from settings that do not change the results."
        return [same] if all(run.settings for run in runs) else []
    titles = ["key", "values", *(["keys that vary with it"] if swept.linked else [])]
    return [Table(titles, rows, "What differs between the runs")]


def _make_line_names(runs: Sequence[Run], keys: Sequence[str]) -> list[str]:
    """Names of the runs in legends: the values of the swept keys, or else their folders."""
    named = [
        ", ".join(f"{key.rpartition('.')[2]} {format_setting(run.settings.get(key))}" for key in keys) for run in runs
    ]
    return named if keys and len(keys) <= 3 and len(set(named)) == len(runs) else make_names(runs)


def make_sweep_report(runs: Sequence[Run], title: str, resume: str = "") -> Report:
    """The report of two or more runs; ``resume`` says how an unfinished sweep is continued."""
    swept = find_swept(runs)
    results = [run for run in runs if run.outcome.is_result]
    keys = [*swept.keys, *swept.seeds]
    names = _make_line_names(results, keys)
    curves = draw_learning_curves(results, names, keys or ["scenario"])
    over = [drawing for key in swept.keys[:4] for drawing in draw_over_key(results, key, swept.keys)]
    final = Table(*format_runs(runs, keys), "Metrics of the last whole cycle, pooled over the legs")
    place = os.path.commonpath([run.folder.resolve().parent for run in runs])
    pages = f"Runs are folders below {place}. {HOW_TO_REPORT}"
    sections = [Section("The runs", [*_list_differences(runs, swept), final, pages, *_list_stopped(runs)])]
    sections += [Section("Metrics over the swept keys", over)] if over else []
    sections += [Section("Learning curves", curves)] if curves else []
    ends = ", ".join(f"{count} {status}" for status, count in Counter(run.outcome.status for run in runs).items())
    summary = f"{len(runs)} runs: {ends}."
    if keys or all(run.settings for run in runs):
        summary += f" What differs between them: {', '.join(keys) or 'nothing'}."
    summary += f" To continue: {resume}." if resume else ""
    inputs = [run.folder / name for run in results for name in TABLES if (run.folder / name).exists()]
    return Report(title, summary, sections, inputs, {"runs": [str(Path(run.folder).resolve()) for run in runs]})
