"""Comparisons, tables and figures of the benchmark's results."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.study import Array, Comparison, Figure, Interval, Mask, compare, draw, find_order, profile_panel
from pipelines.benchmark.entrants import ALONE, CMAC, DECIDING, MACHINES, TASKS
from pipelines.benchmark.results import BY_DEFAULT, COMPLETED, FOR_ALL, FOR_EACH, take_reference
from pipelines.common_results import cycles_to

END, WORST, FORCE = "end_error", "worst_error", "force"
CYCLES = "cycles to a tenth"
"""Column with the cycles until the error stays below TENTH."""
TENTH = 0.1
"""Target error, relative to the end error of feedback only."""
COSTS = {FORCE: "force error", "feedback": "feedback", "torque_peak": "largest torque", "energy": "energy"}
"""Columns that are compared with those of feedback only, and their titles."""
UNDEFINED = "n/a"
"""Text for values without a completed run, or with a reference that failed."""


def take(frame: pd.DataFrame, machine: str, setting: str) -> pd.DataFrame:
    """Select the rows of a machine with a kind of setting."""
    return frame[(frame["machine"] == machine) & (frame["setting"] == setting)]


def make_comparison(
    frame: pd.DataFrame, machine: str, setting: str, column: str = END, tasks: Sequence[str] = TASKS
) -> Comparison:
    """Compare the methods on a machine over tasks: a column relative to feedback only in the same world."""
    rows = take(frame, machine, setting)
    values = {
        method: runs.pivot(index="task", columns="world", values=column).loc[[*tasks]].to_numpy()
        for method, runs in rows.groupby("method", sort=False)
    }
    return compare(values, ALONE, tasks, sorted(rows["world"].unique()))


def describe_order(frame: pd.DataFrame, machine: str) -> str:
    """Describe the order of the methods on which end error and worst cycle agree, and the tasks that do not count."""
    views = {
        name: make_comparison(frame, machine, find_setting(machine), key)
        for name, key in {"end error": END, "worst cycle": WORST}.items()
    }
    excluded = make_comparison(frame, machine, BY_DEFAULT).excluded.items()
    notes = [f"The task {task} does not count: {why}." for task, why in excluded]
    return " ".join([find_order(views).sentence, *notes])


def count_cycles(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the tasks that count, with CYCLES after the change to a tenth of feedback only's end error.

    Infinite where a run never stays below that; NaN where feedback only failed.
    """
    counting = rows[rows["task"].isin(TASKS)]
    levels = TENTH * take_reference(counting, END).to_numpy(dtype=float)
    cycles = cycles_to(np.stack(counting["errors"].to_list()), levels[:, None])
    return counting.assign(**{CYCLES: np.where(np.isfinite(levels), cycles, np.nan)})


def _format(interval: Interval) -> str:
    ends = f"[{interval.low:.3f}, {interval.high:.3f}]"
    return UNDEFINED if np.isnan(interval.value) else f"{interval.value:.3f} {ends}"


def _count(cycles: float) -> str:
    return UNDEFINED if np.isnan(cycles) else f"{cycles:g}" if np.isfinite(cycles) else "never"


def _describe(comparison: Comparison, method: str) -> str:
    """Format the mean score of the completed runs of a method, and the number that failed."""
    if method not in comparison.scores:
        return UNDEFINED
    done = comparison.completed(method)
    return _format(comparison.mean(method)) + (f"; {(~done).sum()} of {done.size} failed" if not done.all() else "")


def rank(comparison: Comparison) -> list[str]:
    """List the methods, best first: the number of failures decides, then the mean score of the completed runs."""
    failed = {method: int((~comparison.completed(method)).sum()) for method in comparison.scores}
    scores = {method: np.nan_to_num(comparison.mean(method).value, nan=np.inf) for method in comparison.scores}
    return sorted(comparison.scores, key=lambda method: (failed[method], scores[method]))


def table_ranking(frame: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the place of each method on each machine, its failures and its mean score; see :func:`rank`.

    Fewer than ``DECIDING`` worlds give no place.
    """
    by_machine = {name: make_comparison(frame, name, find_setting(name)) for name in frame["machine"].unique()}
    ranks = {name: rank(comparison) for name, comparison in by_machine.items()}

    def place(name: str, method: str) -> str:
        comparison = by_machine[name]
        number = f"{ranks[name].index(method) + 1}" if len(comparison.worlds) >= DECIDING else "undecided"
        return f"{number}: {_describe(comparison, method)}"

    first = next(iter(ranks.values()))
    titles = {name: f"{name}, {len(comparison.worlds)} worlds" for name, comparison in by_machine.items()}
    rows = [{titles[name]: place(name, method) for name in by_machine if method in ranks[name]} for method in first]
    return pd.DataFrame({"method": method, **cells} for method, cells in zip(first, rows, strict=True))


def find_setting(machine: str) -> str:
    """Return the main kind of setting for tables: one for all tasks if methods were tuned, else the default."""
    return FOR_ALL if MACHINES[machine].draws else BY_DEFAULT


def table_scores(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Tabulate the main results in the order of :func:`rank`.

    The columns are the score with each kind of setting, the worst cycle, and the cycles to a tenth. The last columns
    compare a method with the CMAC in the same tasks and worlds: the ratio of the scores in the runs that both
    complete, and the share of runs in which the method is better.
    """
    last = find_setting(machine)
    kinds = frame["setting"][frame["machine"] == machine].unique()
    same = () if last == FOR_ALL else (FOR_ALL, FOR_EACH)  # equal to the default setting, since nothing was tuned
    ends = {kind: make_comparison(frame, machine, kind) for kind in kinds if kind not in same}
    main = ends[last]
    worst = make_comparison(frame, machine, last, WORST)
    cycles = count_cycles(take(frame, machine, last)).groupby("method")[CYCLES].median()
    against = {"over the CMAC": main.ratio, "better than the CMAC": main.probability_of_improvement}
    return pd.DataFrame(
        {
            "method": method,
            **{kind: _describe(comparison, method) for kind, comparison in ends.items()},
            "worst cycle": _format(worst.mean(method)),
            CYCLES: _count(cycles[method]),
            **{title: _format(compute(method, CMAC)) for title, compute in against.items() if CMAC in main.scores},
        }
        for method in rank(main)
    )


def table_absolute(frame: pd.DataFrame) -> pd.DataFrame:
    """Tabulate the median errors of feedback only, to which ratios are relative, and of the CMAC."""
    rows = frame[frame["setting"] == frame["machine"].map(find_setting)]
    rows = rows[rows["task"].isin(TASKS) & rows["method"].isin((ALONE, CMAC))]
    errors = {"error, mm": 1e3 * rows[END], "force, N": rows[FORCE]}
    done = rows.assign(**{name: error.where(rows["status"] == COMPLETED) for name, error in errors.items()})
    by = done.groupby(["machine", "task", "method"], sort=False)
    medians = by[[*errors]].median().map("{:.3g}".format).replace("nan", UNDEFINED)
    counts = by["status"].agg(lambda status: f"{(status == COMPLETED).sum()} of {len(status)}")
    wide = medians.assign(completed=counts).unstack("method", sort=False)
    return wide.set_axis([f"{method}: {what}" for what, method in wide], axis=1).reset_index()


def table_tasks(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Tabulate the mean score of the completed runs of each method in each task, and the number that failed."""
    whole = make_comparison(frame, machine, find_setting(machine))
    parts = {task: make_comparison(frame, machine, find_setting(machine), tasks=[task]) for task in whole.tasks}
    return pd.DataFrame(
        {
            "method": method,
            **{task: _describe(comparison, method) for task, comparison in parts.items()},
            **dict.fromkeys(whole.excluded, f"{UNDEFINED}: the reference fell"),
        }
        for method in whole.scores
    )


def table_costs(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Tabulate force error, feedback, peak torque and energy relative to feedback only, and time and memory.

    Values are medians; ratios are over the runs that both complete.
    """
    rows = take(frame, machine, find_setting(machine)).query("task in @TASKS")
    costs, reference = (
        values.where(np.isfinite(values)) for values in (rows[[*COSTS]], take_reference(rows, [*COSTS]))
    )
    table = (
        (costs / reference)
        .rename(columns=COSTS)
        .assign(**{"time of a step, us": 1e6 * rows["seconds"], "memory, KB": rows["bytes"] / 1024})
    )
    return table.groupby(rows["method"], sort=False).median().reset_index()


def table_failures(frame: pd.DataFrame) -> pd.DataFrame:
    """Tabulate failures with the most frequent cause, for each method and task."""
    failed = frame[frame["status"] != COMPLETED]
    causes = failed["cause"].str.replace(r"[-+]?\d[\d.e+-]*", "N", regex=True)
    by = failed.assign(cause=causes).groupby(["machine", "setting", "method", "task"], sort=False)
    return by.agg(
        worlds=("world", "count"),
        status=("status", "first"),
        cause=("cause", lambda values: str(values.value_counts().index[0])),
    ).reset_index()


def draw_profiles(frame: pd.DataFrame) -> Figure:
    """Draw the share of runs over the largest score they reach, a panel for each machine."""
    return draw(
        [profile_panel(make_comparison(frame, m, find_setting(m)), m) for m in frame["machine"].unique()], height=3.2
    )


def over_worlds(machine: str, compute: Callable[[Comparison], Array | Mask], setting: str = FOR_ALL) -> Any:
    """Return a function of results that applies ``compute`` to the comparison of a machine with a kind of setting."""
    return lambda results: compute(make_comparison(results.computed["benchmark"], machine, setting))
