"""What Lin & Song 1997 did not see of one leg: the bias of eq. 13, the divergence, the limits of an exact model."""

from typing import TYPE_CHECKING

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.page import Drawing, Section
from pipelines.analysis import figures_learning as figures
from pipelines.analysis.one_leg_measures import FIFTH, by_cycle
from pipelines.analysis.one_leg_statics import learned_error
from pipelines.shared.runs import Runs

if TYPE_CHECKING:
    import pandas as pd

MM = 1e3
SWING_START = 0.1
"""Time after lift-off in which the growing feedback is looked for, s."""


def bias_section(runs: Runs) -> Section:
    """The 5 % of the paper."""
    literal, aware = runs["paper"], runs["aware"]
    predicted = learned_error(literal.config)
    last = int(literal.metrics["cycle"].iloc[-1])
    ends = [by_cycle(run.metrics)["force_steady_state_error"][last] for run in (literal, aware)]
    caption = (
        f"In cycle {last} the force is off by {ends[0]:+.2%} with eq. 13 as printed, where statics predict "
        f"{predicted:.2%}, and by {ends[1]:+.2%} without the 1/K_ap term. That term is the error that feedback needs "
        "to hold the static load; CMAC learns until feedback is zero, and nothing needs it any more."
    )
    drawing = Drawing("bias", figures.bias(literal.metrics, aware.metrics, predicted), caption)
    return Section("What the paper did not see: the 5 % is a bias", [drawing], beyond=True)


def feedback_at_lift_off(run: StoredRun, cycle: int) -> float:
    """Part of a cycle's squared feedback torque that falls in the first moments after lift-off."""
    rows = run.cycle(cycle)
    squared = (rows["tau_feedback_1"] ** 2 + rows["tau_feedback_2"] ** 2).to_numpy()
    return float(squared[: round(SWING_START / run.config["sampling_period"])].sum() / squared.sum())


def divergence_section(runs: Runs) -> Section:
    """The learning law over many cycles."""
    tables = {
        "as published": runs["long"].metrics,
        "trained one sample earlier (lead 1)": runs["long, lead 1"].metrics,
    }
    both = dict(zip(tables, (runs["long"], runs["long, lead 1"]), strict=True))
    ends = {name: int(run.metrics["cycle"].iloc[-1]) for name, run in both.items() if run.status == "diverged"}
    published, cured = (by_cycle(table) for table in tables.values())
    least, last = published["feedback_rms"].idxmin(), published.index[-1]
    early, late = (feedback_at_lift_off(runs["long"], cycle) for cycle in (FIFTH, int(last) - 1))
    caption = (
        f"As published the feedback torque is least in cycle {least} ({published['feedback_rms'][least]:.2f} N m) "
        f"and then grows to {published['feedback_rms'][last]:.3g} N m in cycle {last}"
        + (", where the run diverges" if ends else "")
        + f". It grows where the planned speed jumps: {late:.0%} of the squared feedback of cycle {last - 1} falls "
        f"in the {SWING_START:g} s after lift-off ({early:.0%} in cycle {FIFTH}). A torque is felt one sample after "
        f"it was given; crediting the cells of that sample ends at {cured['feedback_rms'].iloc[-1]:.2f} N m and "
        f"{MM * cured['transfer_rmse_x'].iloc[-1]:.2g} mm in cycle {cured.index[-1]}."
    )
    drawing = Drawing("divergence", figures.divergence(tables, ends), caption)
    return Section("What the paper did not see: the learning law diverges", [drawing], beyond=True)


def passes(learnt: "pd.Series", exact: "pd.Series") -> str:
    """When a learnt feedforward leaves less than an exact one, in words."""
    below = learnt.index[learnt < exact]
    last = learnt.index[-1]
    if len(below):
        return f"the CMAC comes below that in cycle {below[0]} and has {learnt[last]:.2f} mm in cycle {last}"
    return f"the CMAC, with {learnt[last]:.2f} mm in cycle {last}, is still above that"


def exact_section(runs: Runs) -> Section:
    """Exact inverse dynamics against the CMAC on both paths."""
    pairs = {
        "path of the paper, one cubic": ("paper", "exact"),
        "smooth path, two cubics": ("smooth", "smooth exact"),
    }
    tables = {
        path: {who: runs[name].metrics for who, name in zip(("CMAC", "exact inverse dynamics"), names, strict=True)}
        for path, names in pairs.items()
    }
    jumping, smooth = tables.values()
    learnt, exact = (by_cycle(table)["transfer_rmse_y"] * MM for table in jumping.values())
    calm_learnt, calm_exact = (by_cycle(table)["transfer_rmse_y"] * MM for table in smooth.values())
    caption = (
        f"On the paper's path exact inverse dynamics leaves {exact.min():.1f} to {exact.max():.1f} mm in every "
        f"cycle, since it does not know of the jumps of the planned speed; {passes(learnt, exact)}. Where the speed "
        f"does not jump it leaves {calm_exact.min():.2f} to {calm_exact.max():.2f} mm from its first cycle on; "
        f"{passes(calm_learnt, calm_exact)}."
    )
    drawing = Drawing("exact_model", figures.exact_model(tables), caption)
    return Section("What the paper did not see: an exact model is not the best", [drawing], beyond=True)
