"""What the rows of the benchmark say: comparisons, tables and figures."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from cmacexp.study import Array, Comparison, Figure, Interval, Mask, compare, draw, find_order, profile_panel
from pipelines.benchmark.entrants import ALONE, CMAC, MACHINES, TASKS
from pipelines.benchmark.results import BY_DEFAULT, COMPLETED, FOR_ALL, FOR_EACH, take_reference
from pipelines.common_results import cycles_to

END, WORST, FORCE = "end_error", "worst_error", "force"
CYCLES = "cycles to a tenth"
"""Column of tables."""
TENTH = 0.1
"""Of the error of feedback only at the end: what a method is to reach."""
COSTS = {FORCE: "force error", "feedback": "feedback", "torque_peak": "largest torque", "energy": "energy"}
"""Columns that are compared with those of feedback only, and their titles."""
UNDEFINED = "n/a"
"""Of what no completed run defines, or is relative to a reference that failed."""


def take(frame: pd.DataFrame, machine: str, setting: str) -> pd.DataFrame:
    """The rows of a machine with a kind of setting."""
    return frame[(frame["machine"] == machine) & (frame["setting"] == setting)]


def make_comparison(
    frame: pd.DataFrame, machine: str, setting: str, column: str = END, tasks: Sequence[str] = TASKS
) -> Comparison:
    """Methods on a machine over tasks: a column over that of feedback only in the same world."""
    rows = take(frame, machine, setting)
    values = {
        method: own.pivot(index="task", columns="world", values=column).loc[[*tasks]].to_numpy()
        for method, own in rows.groupby("method", sort=False)
    }
    return compare(values, ALONE, tasks, sorted(rows["world"].unique()))


def describe_order(frame: pd.DataFrame, machine: str) -> str:
    """The order of the methods, as far as end error and worst cycle agree on it; and which tasks do not count."""
    views = {
        name: make_comparison(frame, machine, find_setting(machine), key)
        for name, key in {"end error": END, "worst cycle": WORST}.items()
    }
    excluded = make_comparison(frame, machine, BY_DEFAULT).excluded.items()
    notes = [f"The task {task} does not count: {why}." for task, why in excluded]
    return " ".join([find_order(views).sentence, *notes])


def count_cycles(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of the tasks that count, with CYCLES to a tenth of the end error of feedback only, after the change.

    Infinite where a run never stays below that; NaN where feedback only failed.
    """
    own = rows[rows["task"].isin(TASKS)]
    levels = TENTH * take_reference(own, END).to_numpy(dtype=float)
    counted = cycles_to(np.stack(own["errors"].to_list()), levels[:, None])
    return own.assign(**{CYCLES: np.where(np.isfinite(levels), counted, np.nan)})


def _format(interval: Interval) -> str:
    ends = f"[{interval.low:.3f}, {interval.high:.3f}]"
    return UNDEFINED if np.isnan(interval.value) else f"{interval.value:.3f} {ends}"


def _count(cycles: float) -> str:
    return UNDEFINED if np.isnan(cycles) else f"{cycles:g}" if np.isfinite(cycles) else "never"


def _describe(comparison: Comparison, method: str) -> str:
    """The mean score of the runs that completed, and how many failed; of a method that takes part."""
    if method not in comparison.scores:
        return UNDEFINED
    done = comparison.completed(method)
    return _format(comparison.mean(method)) + (f"; {(~done).sum()} of {done.size} failed" if not done.all() else "")


def find_setting(machine: str) -> str:
    """The kind of setting that tables show where they show one: that for all tasks, if methods were tuned."""
    return FOR_ALL if MACHINES[machine].draws else BY_DEFAULT


def table_scores(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """The headline, the best first: score with each kind of setting; worst cycle, cycles to a tenth, and the CMAC.

    With the CMAC a method is compared in the same tasks and worlds: the ratio of the scores in the runs that both
    complete, and the share of runs in which it is better.
    """
    last = find_setting(machine)
    kinds = frame["setting"][frame["machine"] == machine].unique()
    same = () if last == FOR_ALL else (FOR_ALL, FOR_EACH)  # as the default one, since nothing was tuned
    ends = {kind: make_comparison(frame, machine, kind) for kind in kinds if kind not in same}
    main, worst = ends[last], make_comparison(frame, machine, last, WORST)
    cycles = count_cycles(take(frame, machine, last)).groupby("method")[CYCLES].median()
    order = sorted(main.scores, key=lambda method: np.nan_to_num(main.mean(method).value, nan=np.inf))
    against = {"over the CMAC": main.ratio, "better than the CMAC": main.probability_of_improvement}
    return pd.DataFrame(
        {
            "method": method,
            **{kind: _describe(found, method) for kind, found in ends.items()},
            "worst cycle": _format(worst.mean(method)),
            CYCLES: _count(cycles[method]),
            **{title: _format(compute(method, CMAC)) for title, compute in against.items() if CMAC in main.scores},
        }
        for method in order
    )


def table_absolute(frame: pd.DataFrame) -> pd.DataFrame:
    """What ratios are relative to: medians of the errors of feedback only, and of the CMAC if it takes part."""
    shown = frame[frame["setting"] == frame["machine"].map(find_setting)]
    shown = shown[shown["task"].isin(TASKS) & shown["method"].isin((ALONE, CMAC))]
    errors = {"error, mm": 1e3 * shown[END], "force, N": shown[FORCE]}
    done = shown.assign(**{name: own.where(shown["status"] == COMPLETED) for name, own in errors.items()})
    by = done.groupby(["machine", "task", "method"], sort=False)
    found = by[[*errors]].median().map("{:.3g}".format).replace("nan", UNDEFINED)
    counts = by["status"].agg(lambda own: f"{(own == COMPLETED).sum()} of {len(own)}")
    wide = found.assign(completed=counts).unstack("method", sort=False)
    return wide.set_axis([f"{method}: {what}" for what, method in wide], axis=1).reset_index()


def table_tasks(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Mean score of the completed runs of each method in each task, and how many failed."""
    whole = make_comparison(frame, machine, find_setting(machine))
    parts = {task: make_comparison(frame, machine, find_setting(machine), tasks=[task]) for task in whole.tasks}
    return pd.DataFrame(
        {
            "method": method,
            **{task: _describe(own, method) for task, own in parts.items()},
            **dict.fromkeys(whole.excluded, f"{UNDEFINED}: the reference fell"),
        }
        for method in whole.scores
    )


def table_costs(frame: pd.DataFrame, machine: str) -> pd.DataFrame:
    """Force error, feedback, largest torque and energy over those of feedback only, medians; time and memory.

    Of the runs that both complete.
    """
    rows = take(frame, machine, find_setting(machine)).query("task in @TASKS")
    own, alone = (each.where(np.isfinite(each)) for each in (rows[[*COSTS]], take_reference(rows, [*COSTS])))
    shown = (
        (own / alone)
        .rename(columns=COSTS)
        .assign(**{"time of a step, us": 1e6 * rows["seconds"], "memory, KB": rows["bytes"] / 1024})
    )
    return shown.groupby(rows["method"], sort=False).median().reset_index()


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


def draw_profiles(frame: pd.DataFrame) -> Figure:
    """Share of runs that score at most so much, on each machine."""
    panels = [profile_panel(make_comparison(frame, m, find_setting(m)), m) for m in frame["machine"].unique()]
    return draw(panels, height=3.2)


def write_scores(frame: pd.DataFrame) -> str:
    """Absolute errors, and the headline of each machine, in Markdown, for the documentation."""
    parts = [("Absolute errors at the end, medians over the worlds", table_absolute(frame), "")]
    parts += [(name, table_scores(frame, name), describe_order(frame, name)) for name in frame["machine"].unique()]
    return "\n".join(f"**{title}**\n\n{write_table(table)}\n\n{text}\n" for title, table, text in parts)


def write_table(table: pd.DataFrame) -> str:
    """A table in Markdown."""
    rows = [list(table), ["---"] * len(table.columns), *table.itertuples(index=False)]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows)


def over_worlds(machine: str, compute: Callable[[Comparison], Array | Mask], setting: str = FOR_ALL) -> Any:
    """A sample that is computed from the comparison of a machine."""
    return lambda results: compute(make_comparison(results.computed["benchmark"], machine, setting))
