"""What the rows of the benchmark say: comparisons, tables and figures."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study.comparison import STATISTICS, Comparison, compare, find_order, profile_panel
from cmacexp.study.interval import Interval
from cmacexp.typing import Array
from pipelines.benchmark.entrants import ALONE, CMAC
from pipelines.benchmark.results import BY_DEFAULT, FOR_ALL, SETTINGS
from pipelines.benchmark.tasks import MACHINES, STRESS, TASKS
from pipelines.benchmark.trial import COMPLETED
from pipelines.feedforwards_measures import cycles_to

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

END, WORST, FORCE = "end_error", "worst_error", "force"
TENTH = 0.1
"""Of the error of feedback alone at the end: what a method is to reach."""
METRICS = {"end error": END, "worst cycle": WORST}
"""What decides an order, by its name."""


def take(frame: "pd.DataFrame", machine: str, setting: str) -> "pd.DataFrame":
    """The rows of a machine with a kind of setting."""
    return frame[(frame["machine"] == machine) & (frame["setting"] == setting)]


def machines_of(frame: "pd.DataFrame") -> list[str]:
    """The machines that took part."""
    return list(frame["machine"].unique())


def tabulate_values(rows: "pd.DataFrame", column: str, tasks: tuple[str, ...] = TASKS) -> dict[str, Array]:
    """(tasks, worlds) of a column by method, of the rows of a machine with a kind of setting."""
    return {
        method: own.pivot(index="task", columns="world", values=column).loc[list(tasks)].to_numpy(dtype=float)
        for method, own in rows.groupby("method", sort=False)
    }


def make_comparison(frame: "pd.DataFrame", machine: str, setting: str, column: str = END) -> Comparison:
    """Methods on a machine over the tasks that count: a column over that of feedback alone in the same world."""
    rows = take(frame, machine, setting)
    return compare(tabulate_values(rows, column), ALONE, TASKS, sorted(rows["world"].unique()))


def describe_order(frame: "pd.DataFrame", machine: str, setting: str) -> str:
    """The order of the methods, as far as end error and worst cycle agree on it."""
    return find_order({name: make_comparison(frame, machine, setting, key) for name, key in METRICS.items()}).sentence


def count_cycles(rows: "pd.DataFrame") -> dict[str, Array]:
    """(tasks, worlds) by method: cycles after the change to a tenth of the end error of feedback alone, and on."""
    alone, found = tabulate_values(rows, END)[ALONE], {}
    for method, own in rows.groupby("method", sort=False):
        errors = own.pivot(index="task", columns="world", values="errors").loc[list(TASKS)]
        pairs = zip(errors.to_numpy().ravel(), alone.ravel(), strict=True)
        found[method] = np.array([cycles_to(np.array([each]), TENTH * level)[0] for each, level in pairs])
    return {method: values.reshape(alone.shape) for method, values in found.items()}


def _format(interval: Interval) -> str:
    return f"{interval.value:.3f} [{interval.low:.3f}, {interval.high:.3f}]"


def _count(cycles: float) -> str:
    return f"{cycles:g}" if np.isfinite(cycles) else "never"


def find_setting(machine: str) -> str:
    """The kind of setting that tables show where they show one: that for all tasks, if methods were tuned."""
    return FOR_ALL if MACHINES[machine].draws else BY_DEFAULT


def table_scores(frame: "pd.DataFrame", machine: str) -> "pd.DataFrame":
    """The headline: the capped mean with each kind of setting, failures, worst cycles, and cycles to a tenth."""
    import pandas as pd

    kinds = SETTINGS if MACHINES[machine].draws else (BY_DEFAULT,)
    last = find_setting(machine)
    ends = {kind: make_comparison(frame, machine, kind) for kind in kinds}
    worst, cycles = make_comparison(frame, machine, last, WORST), count_cycles(take(frame, machine, last))
    order = sorted(ends[last].scores, key=lambda method: ends[last].capped_mean(method).value)
    return pd.DataFrame(
        {
            "method": method,
            **{kind: _format(ends[kind].capped_mean(method)) for kind in kinds},
            "failed": f"{np.isinf(ends[last].scores[method]).sum()} of {ends[last].scores[method].size}",
            "worst cycle": _format(worst.capped_mean(method)),
            "cycles to a tenth": _count(float(np.median(cycles[method]))),
        }
        for method in order
    )


def table_statistics(frame: "pd.DataFrame", machine: str) -> "pd.DataFrame":
    """What each way of summing up says: both means, failures, and how often a method is the first."""
    import pandas as pd

    comparison = make_comparison(frame, machine, find_setting(machine))
    first = {name: comparison.first_places(name) for name in STATISTICS}
    return pd.DataFrame(
        {
            "method": method,
            "interquartile mean": _format(comparison.interquartile_mean(method)),
            "capped mean": _format(comparison.capped_mean(method)),
            "failures": _format(comparison.failures(method)),
            "better than the CMAC": _format(comparison.probability_of_improvement(method, CMAC)),
            **{f"first by the {name}": shares[method] for name, shares in first.items()},
        }
        for method in comparison.scores
    )


def table_tasks(frame: "pd.DataFrame", machine: str) -> "pd.DataFrame":
    """Capped mean of each method in each task, with the setting for all tasks."""
    import pandas as pd

    comparison = make_comparison(frame, machine, find_setting(machine))
    return pd.DataFrame(
        {"method": method, **dict(zip(comparison.tasks, np.fmin(scores, 1.0).mean(axis=1), strict=True))}
        for method, scores in comparison.scores.items()
    )


def table_costs(frame: "pd.DataFrame", costs: "pd.DataFrame", machine: str) -> "pd.DataFrame":
    """Force error, feedback, largest torque and energy over those of feedback alone, medians; time and memory."""
    import pandas as pd

    rows = take(frame, machine, find_setting(machine))
    shown = {"force error": FORCE, "feedback": "feedback", "largest torque": "torque_peak", "energy": "energy"}
    values = {title: tabulate_values(rows, column) for title, column in shown.items()}
    held = rows.groupby("method", sort=False)["bytes"].median()
    seconds = costs[costs["machine"] == machine].set_index("method")["seconds_per_step"]
    return pd.DataFrame(
        {
            "method": method,
            **{title: float(np.median(own[method] / own[ALONE])) for title, own in values.items()},
            "time of a step, us": 1e6 * seconds[method],
            "memory, KB": held[method] / 1024,
        }
        for method in held.index
    )


def table_failures(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Where methods fail, and why: the most frequent cause of each method in each task."""
    failed = frame[(frame["status"] != COMPLETED) & (frame["task"] != STRESS)].copy()
    failed["cause"] = failed["cause"].str.replace(r"[-+]?\d[\d.e+-]*", "N", regex=True)
    by = ["machine", "setting", "method", "task"]
    columns = {"worlds": ("world", "count"), "status": ("status", "first"), "cause": ("cause", _most_frequent)}
    return failed.groupby(by, sort=False).agg(**columns).reset_index()


def _most_frequent(values: "pd.Series[str]") -> str:
    return str(values.value_counts().index[0])


def draw_profiles(frame: "pd.DataFrame") -> "Figure":
    """Share of runs that score at most so much, on each machine."""
    machines = machines_of(frame)
    panels = [profile_panel(make_comparison(frame, each, find_setting(each)), each) for each in machines]
    return draw(panels, height=3.2)


def draw_worlds(frame: "pd.DataFrame") -> "Figure":
    """A dot for each world: scores of each method in each task, on the first machine."""
    machine = machines_of(frame)[0]
    comparison = make_comparison(frame, machine, find_setting(machine))
    methods = [method for method in comparison.scores if method != ALONE]
    spread = np.linspace(-0.3, 0.3, len(comparison.worlds))
    panels = []
    for number, task in enumerate(comparison.tasks):
        series = []
        for place, method in enumerate(methods):
            scores = comparison.scores[method][number]
            series.append(Series(method, place + spread, np.where(np.isinf(scores), np.nan, scores)))
        panels.append(Panel(task, "", "score", series, kind="scatter", log="y", y_limits=(1.0,)))
    return draw(panels, height=2.2)


def write_scores(frame: "pd.DataFrame") -> str:
    """The headline of each machine in Markdown, for the documentation."""
    parts = []
    for machine in machines_of(frame):
        scores = table_scores(frame, machine)
        rows = [list(scores), ["---"] * len(scores.columns), *scores.itertuples(index=False)]
        table = "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows)
        excluded = make_comparison(frame, machine, BY_DEFAULT).excluded
        notes = [f"The task {task} does not count there: {why}." for task, why in excluded.items()]
        order = " ".join([describe_order(frame, machine, find_setting(machine)), *notes])
        parts.append(f"**{machine}**\n\n{table}\n\n{order}\n")
    return "\n".join(parts)


def stress(frame: "pd.DataFrame") -> "pd.DataFrame":
    """How many worlds each method completes in the stress test, of those in which feedback alone does."""
    import pandas as pd

    rows = frame[(frame["task"] == STRESS) & (frame["setting"] == FOR_ALL)]
    alone = rows[(rows["method"] == ALONE) & (rows["status"] == COMPLETED)]
    possible: dict[Any, set[int]] = {machine: set(own["world"]) for machine, own in alone.groupby("machine")}
    return pd.DataFrame(
        {
            "machine": machine,
            "method": method,
            "completes": f"{sum((own['status'] == COMPLETED) & own['world'].isin(possible[machine]))}"
            f" of {len(possible[machine])}",
        }
        for (machine, method), own in rows.groupby(["machine", "method"], sort=False)
        if machine in possible
    )


def over_worlds(machine: str, compute: Callable[[Comparison], Array], setting: str = FOR_ALL) -> Any:
    """A sample with a value for each world, computed from the comparison of a machine."""
    return lambda results: compute(make_comparison(results.computed["benchmark"], machine, setting))
