"""What the rows of the benchmark say: comparisons, tables and figures; and what differs between two results."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.data.tables import read_table
from cmacexp.errors import BadInput
from cmacexp.study import Array, Comparison, Figure, Interval, Mask, compare, draw, find_order, profile_panel
from pipelines.benchmark.entrants import ALONE, CMAC, MACHINES, TASKS
from pipelines.benchmark.results import BY_DEFAULT, COMPLETED, FOR_ALL, GUARDED, SETTINGS
from pipelines.common_results import cycles_to

END, WORST, FORCE = "end_error", "worst_error", "force"
TENTH = 0.1
"""Of the error of feedback only at the end: what a method is to reach."""
METRICS = {"end error": END, "worst cycle": WORST}
"""What decides an order, by its name."""
SAME = ("version", "tasks_hash")
"""Entries in which results must agree to be compared."""
UNDEFINED = "n/a"
"""Of what no completed run defines, or is relative to a reference that failed."""


def take(frame: pd.DataFrame, machine: str, setting: str) -> pd.DataFrame:
    """The rows of a machine with a kind of setting."""
    return frame[(frame["machine"] == machine) & (frame["setting"] == setting)]


def tabulate_values(rows: pd.DataFrame, column: str, tasks: tuple[str, ...] = TASKS) -> dict[str, Array]:
    """(tasks, worlds) of a column by method, of the rows of a machine with a kind of setting."""
    return {
        method: own.pivot(index="task", columns="world", values=column).loc[list(tasks)].to_numpy()
        for method, own in rows.groupby("method", sort=False)
    }


def make_comparison(frame: pd.DataFrame, machine: str, setting: str, column: str = END) -> Comparison:
    """Methods on a machine over the tasks that count: a column over that of feedback only in the same world."""
    rows = take(frame, machine, setting)
    return compare(tabulate_values(rows, column), ALONE, TASKS, sorted(rows["world"].unique()))


def describe_order(frame: pd.DataFrame, machine: str) -> str:
    """The order of the methods, as far as end error and worst cycle agree on it."""
    views = {name: make_comparison(frame, machine, find_setting(machine), key) for name, key in METRICS.items()}
    return find_order(views).sentence


def count_cycles(rows: pd.DataFrame) -> dict[str, Array]:
    """(tasks, worlds) by method: cycles after the change to a tenth of the end error of feedback only, and on.

    Infinite where that is never; NaN where feedback only failed.
    """
    alone = tabulate_values(rows, END)[ALONE]
    level, known = TENTH * alone.reshape(-1, 1), np.isfinite(alone)
    return {
        method: np.where(known, cycles_to(np.array(errors.ravel().tolist()), level).reshape(alone.shape), np.nan)
        for method, errors in tabulate_values(rows, "errors").items()
    }


def _format(interval: Interval) -> str:
    known = f"{interval.value:.3f} [{interval.low:.3f}, {interval.high:.3f}]"
    return UNDEFINED if np.isnan(interval.value) else known


def find_median(cycles: Array) -> float:
    """The median of those that are defined; NaN if none is."""
    return float(pd.Series(cycles.ravel()).median())


def _count(cycles: float) -> str:
    return UNDEFINED if np.isnan(cycles) else f"{cycles:g}" if np.isfinite(cycles) else "never"


def _failed(comparison: Comparison, method: str) -> str:
    done = comparison.completed(method)
    return f"{(~done).sum()} of {done.size}"


def find_setting(machine: str) -> str:
    """The kind of setting that tables show where they show one: that for all tasks, if methods were tuned."""
    return FOR_ALL if MACHINES[machine].draws else BY_DEFAULT


def table_scores(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """The headline: mean score of completed runs and failures with each kind of setting, worst cycle, cycles."""
    last = find_setting(machine)
    kinds = [kind for kind in SETTINGS if kind != GUARDED] if last == FOR_ALL else [last]
    ends = {kind: make_comparison(frame, machine, kind) for kind in kinds}
    worst, cycles = make_comparison(frame, machine, last, WORST), count_cycles(take(frame, machine, last))
    order = sorted(ends[last].scores, key=lambda method: np.nan_to_num(ends[last].mean(method).value, nan=np.inf))
    return pd.DataFrame(
        {
            "method": method,
            **{
                title: text
                for kind, found in ends.items()
                for title, text in ((kind, _format(found.mean(method))), (f"failed, {kind}", _failed(found, method)))
            },
            "worst cycle": _format(worst.mean(method)),
            "cycles to a tenth": _count(find_median(cycles[method])),
        }
        for method in order
    )


def table_guarded(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Default settings without and with the guard; and their ratio in the runs that both complete."""
    free, guarded = (make_comparison(frame, machine, kind) for kind in (BY_DEFAULT, GUARDED))
    both = {
        method: Comparison({"": free.scores[method], GUARDED: scores}, free.tasks, free.worlds)
        for method, scores in guarded.scores.items()
        if method != ALONE
    }
    return pd.DataFrame(
        {
            "method": method,
            "default": _format(free.mean(method)),
            "failed": _failed(free, method),
            "guarded": _format(guarded.mean(method)),
            "failed, guarded": _failed(guarded, method),
            "guarded over default": _format(pair.ratio(GUARDED, "")),
        }
        for method, pair in both.items()
    )


def table_absolute(frame: pd.DataFrame) -> pd.DataFrame:
    """What ratios are relative to: medians of the errors of feedback only, and of the CMAC if it takes part."""
    rows: dict[tuple[str, str], dict[str, str]] = {(m, t): {} for m in frame["machine"].unique() for t in TASKS}
    for (machine, task), row in rows.items():
        own = take(frame, machine, find_setting(machine))
        own = own[own["task"] == task]
        for method in (name for name in (ALONE, CMAC) if name in set(own["method"])):
            tried = own[own["method"] == method]
            done = tried[tried["status"] == COMPLETED]
            row[f"{method}, mm"] = f"{1e3 * done[END].median():.3g}" if len(done) else UNDEFINED
            row[f"{method}, N"] = f"{done[FORCE].median():.3g}" if len(done) else UNDEFINED
            row[f"{method}, completed"] = f"{len(done)} of {len(tried)}"
    return pd.DataFrame({"machine": machine, "task": task, **row} for (machine, task), row in rows.items())


def table_statistics(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Mean score of completed runs, failures, and the comparison with the CMAC in the same tasks and worlds."""
    comparison = make_comparison(frame, machine, find_setting(machine))
    return pd.DataFrame(
        {
            "method": method,
            "completed runs": _format(comparison.mean(method)),
            "failures": _format(comparison.failures(method)),
            "over the CMAC": _format(comparison.ratio(method, CMAC)),
            "better than the CMAC": _format(comparison.probability_of_improvement(method, CMAC)),
        }
        for method in comparison.scores
    )


def table_tasks(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Mean score of the completed runs of each method in each task, and how many failed."""
    comparison = make_comparison(frame, machine, find_setting(machine))

    def describe(scores: Array) -> str:
        done = scores[np.isfinite(scores)]
        failed = f"; {scores.size - done.size} failed" if done.size < scores.size else ""
        return (f"{done.mean():.3f}" if done.size else UNDEFINED) + failed

    return pd.DataFrame(
        {
            "method": method,
            **{task: describe(row) for task, row in zip(comparison.tasks, scores, strict=True)},
            **dict.fromkeys(comparison.excluded, f"{UNDEFINED}: the reference fell"),
        }
        for method, scores in comparison.scores.items()
    )


def table_costs(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Force error, feedback, largest torque and energy over those of feedback only, medians; time and memory.

    Of the runs that both complete.
    """
    rows = take(frame, machine, find_setting(machine))
    shown = {"force error": FORCE, "feedback": "feedback", "largest torque": "torque_peak", "energy": "energy"}
    values = {title: tabulate_values(rows, column) for title, column in shown.items()}
    held = rows.groupby("method", sort=False)[["seconds", "bytes"]].median()

    def divide(own: Array, alone: Array) -> float:
        both = np.isfinite(own) & np.isfinite(alone)
        return find_median(own[both] / alone[both])

    return pd.DataFrame(
        {
            "method": method,
            **{title: divide(found[method], found[ALONE]) for title, found in values.items()},
            "time of a step, us": 1e6 * own.seconds,
            "memory, KB": own.bytes / 1024,
        }
        for method, own in held.iterrows()
    )


def table_failures(frame: pd.DataFrame) -> pd.DataFrame:
    """Where methods fail, and why: the most frequent cause of each method in each task."""
    failed = frame[frame["status"] != COMPLETED]
    causes = failed["cause"].str.replace(r"[-+]?\d[\d.e+-]*", "N", regex=True)
    by = failed.assign(cause=causes).groupby(["machine", "setting", "method", "task"], sort=False)
    return by.agg(
        worlds=("world", "count"),
        status=("status", "first"),
        cause=("cause", lambda values: str(values.value_counts().index[0])),
    ).reset_index()


def table_settings(tuned: pd.DataFrame) -> pd.DataFrame:
    """What was chosen for all tasks, and the median of the cycles to a tenth in the worlds of tuning."""
    cycles = {machine: count_cycles(take(tuned, machine, FOR_ALL)) for machine in tuned["machine"].unique()}
    rows = tuned[tuned["method"] != ALONE].drop_duplicates(["machine", "method"])
    medians = [find_median(cycles[row.machine][row.method]) for row in rows.itertuples()]
    chosen = rows[["machine", "method"]].assign(setting=rows["overrides"].replace("", "default"))
    return chosen.assign(**{"cycles to a tenth": medians})


def draw_profiles(frame: pd.DataFrame) -> Figure:
    """Share of runs that score at most so much, on each machine."""
    machines = frame["machine"].unique()
    return draw([profile_panel(make_comparison(frame, m, find_setting(m)), m) for m in machines], height=3.2)


def write_scores(frame: pd.DataFrame) -> str:
    """Absolute errors, and the headline of each machine, in Markdown, for the documentation."""
    parts = [f"**Absolute errors at the end, medians over the worlds**\n\n{write_table(table_absolute(frame))}\n"]
    for machine in frame["machine"].unique():
        excluded = make_comparison(frame, machine, BY_DEFAULT).excluded.items()
        notes = [f"The task {task} does not count there: {why}." for task, why in excluded]
        order, scores = " ".join([describe_order(frame, machine), *notes]), write_table(table_scores(frame, machine))
        parts.append(f"**{machine}**\n\n{scores}\n\n{order}\n")
        if has_guarded(frame):
            parts[-1] += f"\nWith the guard:\n\n{write_table(table_guarded(frame, machine))}\n"
    return "\n".join(parts)


def has_guarded(frame: pd.DataFrame) -> bool:
    """Whether a method that learns takes part, which ran guarded too."""
    return set(frame["method"][frame["setting"] == GUARDED]) > {ALONE}


def write_table(table: pd.DataFrame) -> str:
    """A table in Markdown."""
    rows = [list(table), ["---"] * len(table.columns), *table.itertuples(index=False)]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows)


def over_worlds(machine: str, compute: Callable[[Comparison], Array | Mask], setting: str = FOR_ALL) -> Any:
    """A sample that is computed from the comparison of a machine."""
    return lambda results: compute(make_comparison(results.computed["benchmark"], machine, setting))


def _read(path: Path) -> tuple[pd.DataFrame, list[Any]]:
    """A table of results, and what the JSON beside it says of SAME.

    Raises:
        BadInput: one of them is missing, or is none.
    """
    try:
        entry = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
        frame = read_table(path, texts=True).to_pandas().astype({"end_error": float})
        return frame, [entry[name] for name in SAME]
    except (OSError, ValueError, LookupError, TypeError) as error:
        allowed = f"must be benchmark.parquet of a report of the benchmark, with its .json beside it: {error}"
        raise BadInput("--compare", path, allowed) from error


def compare_results(first: Path, second: Path) -> Iterator[str]:
    """A line for each machine, method and kind of setting that both have and that changed: its score and failures.

    The score is the mean over the runs that complete in both, as a ratio of the second to the first.

    Raises:
        BadInput: a file is no result, or they are of different tasks.
    """
    (before, of_before), (after, of_after) = _read(first), _read(second)
    if of_before != of_after:
        raise BadInput(
            "--compare", second, f"has another {' or '.join(SAME)} than {first}: their scores mean other things"
        )
    places = [frame[["machine", "setting"]].drop_duplicates() for frame in (before, after)]
    for machine, setting in pd.merge(*places).itertuples(index=False):
        old, new = (make_comparison(frame, machine, setting) for frame in (before, after))
        for method in (name for name in old.scores if name in new.scores):
            pair = Comparison({"old": old.scores[method], "new": new.scores[method]}, old.tasks, old.worlds)
            if not np.array_equal(pair.scores["old"], pair.scores["new"]):
                found, failed = pair.ratio("new", "old"), [(~pair.completed(name)).sum() for name in pair.scores]
                text = f"score times {_format(found)}, failed {failed[0]}, then {failed[1]}"
                yield f"{machine}, {method}, {setting}: {text}"
    yield "no other score has changed"
