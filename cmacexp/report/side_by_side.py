"""Force and errors of a few runs in one figure, each over its last whole cycle."""

from collections.abc import Sequence

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.figure_data import DESIRED_LINE, MOST_CYCLES, legend_below, mark, read_figure_data
from cmacexp.report.over_cycle import CLOCK, moves_along_x
from cmacexp.report.page import Drawing
from cmacexp.report.run_summary import RunSummary
from cmacexp.report.style import label, new_figure


def draw_side_by_side(runs: Sequence[RunSummary], names: Sequence[str]) -> list[Drawing]:
    """Force and errors of leg 1 over the last whole cycle of each run; none for runs of different machines
    or too many runs for one figure.

    Args:
        runs: with results.
        names: of the runs, for the legend.
    """
    begun = [(run, name) for run, name in zip(runs, names, strict=True) if run.cycles]
    if not 1 < len(begun) <= MOST_CYCLES:
        return []
    if len({(run.config["scenario"], run.config["gait.cycle_time"]) for run, _ in begun}) > 1:
        return []
    shown = [(read_figure_data(StoredRun(run.folder), [run.cycles]), name) for run, name in begun]
    panels = {"force": ("contact force", "force, N"), "y": ("error along y", "y - desired, mm")}
    if any(moves_along_x(data) for data, _ in shown):
        panels["x"] = ("error along x", "x - desired, mm")
    figure, axes = new_figure(len(panels), 1, 2.1, sharex=True)
    for ax, (column, (title, unit)) in zip(axes, panels.items(), strict=True):
        drawn: list[list[float]] = []
        factor = 1.0 if column == "force" else 1e3
        for index, (data, name) in enumerate(shown):
            rows = data.select(data.cycles[0], 1)
            desired = rows["force_desired"].tolist()
            if column == "force" and desired not in drawn:
                drawn.append(desired)
                ax.plot(data.time_in_cycle(rows), rows["force_desired"], label="desired", **DESIRED_LINE)
            value = rows[column] if column == "force" else rows[column] - rows[f"{column}_desired"]
            ax.plot(data.time_in_cycle(rows), factor * value, label=name, **mark(index))
        label(ax, title, CLOCK if ax is axes[-1] else "", unit)
        ax.set_xlim(0, max(data.duration for data, _ in shown))
    legend_below(figure, axes[0])
    leg = " of leg 1" if any(data.legs > 1 for data, _ in shown) else ""
    return [Drawing("side-by-side", figure, f"Force and errors{leg} over the last whole cycle of each run.")]
