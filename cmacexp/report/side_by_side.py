"""Force and errors of a few runs in one figure, each over its last whole cycle."""

from collections.abc import Sequence

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.comparison import Job
from cmacexp.report.figure_data import DESIRED_LINE, MOST_CYCLES, legend_below, look_at, mark
from cmacexp.report.over_cycle import CLOCK, moves
from cmacexp.report.page import Drawing
from cmacexp.report.style import label, new_figure


def side_by_side(jobs: Sequence[Job], names: Sequence[str]) -> list[Drawing]:
    """Force and errors of leg 1 over the last whole cycle of each run; none for runs of different machines,
    or more than can be told apart.

    Args:
        jobs: results.
        names: of the jobs, as the legend says them.
    """
    begun = [(job, name) for job, name in zip(jobs, names, strict=True) if job.cycles]
    if not 1 < len(begun) <= MOST_CYCLES:
        return []
    if len({(job.config["scenario"], job.config["gait.cycle_time"]) for job, _ in begun}) > 1:
        return []
    looks = [(look_at(StoredRun(job.folder), [len(job.cycles)]), name) for job, name in begun]
    panels = {"force": ("contact force", "force, N"), "y": ("error along y", "y - desired, mm")}
    if any(moves(look) for look, _ in looks):
        panels["x"] = ("error along x", "x - desired, mm")
    figure, axes = new_figure(len(panels), 1, 2.1, sharex=True)
    for ax, (column, (title, unit)) in zip(axes, panels.items(), strict=True):
        drawn: list[list[float]] = []
        factor = 1.0 if column == "force" else 1e3
        for index, (look, name) in enumerate(looks):
            rows = look.of(look.numbers[0], 1)
            desired = rows["force_desired"].tolist()
            if column == "force" and desired not in drawn:
                drawn.append(desired)
                ax.plot(look.clock(rows), rows["force_desired"], label="desired", **DESIRED_LINE)
            value = rows[column] if column == "force" else rows[column] - rows[f"{column}_desired"]
            ax.plot(look.clock(rows), factor * value, label=name, **mark(index))
        label(ax, title, CLOCK if ax is axes[-1] else "", unit)
        ax.set_xlim(0, max(look.span for look, _ in looks))
    legend_below(figure, axes[0])
    leg = " of leg 1" if any(look.legs > 1 for look, _ in looks) else ""
    return [Drawing("side-by-side", figure, f"Force and errors{leg} over the last whole cycle of each run.")]
