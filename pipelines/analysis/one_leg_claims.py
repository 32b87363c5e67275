"""What Lin & Song 1997 claim of one leg's position and force (section 5), judged by stated criteria."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cmacexp.report.page import Claim, Link
from pipelines.analysis.figures_one_leg import AXES, MM, touch_down
from pipelines.analysis.one_leg_measures import (
    FIFTH,
    FIRST,
    LANDED,
    SECOND,
    WINDOW,
    by_cycle,
    force_oscillation,
    judged,
)
from pipelines.analysis.one_leg_statics import Config, feedback_force, weight_at_foot, weight_for

if TYPE_CHECKING:
    import pandas as pd

FAIRLY_LARGE = 0.05
"""Peak error over the extent of the path (stroke, lift)."""
ELIMINATED, MOSTLY = 0.10, 1.0 / 3.0
"""RMS error over that of feedback alone: virtually eliminated, and mostly gone."""
PAPER_PEAK, PAPER_SETTLED, ABOUT = 1.1, 0.9, 0.05
"""Forces of Fig. 12 under feedback alone (N), and what still counts as the same (N)."""
SMALL = 0.05
"""Steady-state error that the paper reaches."""
STEADY = 0.02
"""Standard deviation of a relatively steady force over the desired one."""


def large_errors(rows: "pd.DataFrame", config: Config, links: Sequence[Link]) -> Claim:
    """Fig. 10: errors of feedback alone, in the first cycle."""
    swing = rows[rows["phase"] == "transfer"]
    peak = [float((swing[axis] - swing[f"{axis}_desired"]).abs().max()) for axis in AXES]
    share = [p / config["gait"][extent] for p, extent in zip(peak, ("stroke", "lift"), strict=True)]
    return Claim(
        "with feedback alone there are fairly large position errors in both X and Y",
        "section 5, Fig. 10",
        f"largest error in transfer {MM * peak[0]:.0f} mm in x ({share[0]:.0%} of the stroke) and {MM * peak[1]:.0f} "
        f"mm in y ({share[1]:.0%} of the lift)",
        judged(*(s >= FAIRLY_LARGE for s in share)),
        links,
    )


def errors_vanish(metrics: "pd.DataFrame", config: Config, links: Sequence[Link]) -> Claim:
    """Fig. 11: errors after 12 s of learning."""
    table = by_cycle(metrics)
    ratios = (
        table[[f"transfer_rmse_{axis}" for axis in AXES]] / table.loc[FIRST, [f"transfer_rmse_{a}" for a in AXES]]
    )
    then, worst = ratios.loc[FIFTH], float(ratios.loc[FIFTH].max())
    gone = ratios.index[(ratios <= ELIMINATED).all(axis=1)]
    reached = (
        f"both below {ELIMINATED:.0%} first in cycle {gone[0]}"
        if len(gone)
        else f"not yet both below {ELIMINATED:.0%}"
    )
    gains = config["controller"]
    return Claim(
        "with CMAC, after 12 s, the position errors are virtually eliminated without increasing the gains",
        "section 5, Fig. 11",
        f"RMS in transfer {MM * table['transfer_rmse_x'][FIFTH]:.1f} / {MM * table['transfer_rmse_y'][FIFTH]:.0f} mm "
        f"(x / y) in cycle {FIFTH}, {then.iloc[0]:.0%} / {then.iloc[1]:.0%} of feedback alone; {reached}; "
        f"K_ap {gains['position_gain']:g} N/m and K_av {gains['velocity_gain']:g} N s/m throughout",
        judged(worst <= ELIMINATED, worst <= MOSTLY),
        links,
    )


def force_of_feedback(rows: "pd.DataFrame", metrics: "pd.DataFrame", config: Config, links: Sequence[Link]) -> Claim:
    """Fig. 12, first 3 s; with the reason from statics."""
    second_half = rows[(rows["phase"] == "support") & (rows["progress"] >= 0.5)]
    peak = float(rows["force"].to_numpy()[touch_down(rows) :].max())
    settled = float(by_cycle(metrics)["force_settled"][FIRST])
    weight = weight_at_foot(second_half, config)
    return Claim(
        f"with feedback alone the foot force goes to {PAPER_PEAK} N, then decreases to approximately {PAPER_SETTLED} "
        "N",
        "section 5, Fig. 12",
        f"it goes to {peak:.2f} N, then settles at {settled:.2f} N. Statics: the weight of the leg presses the foot "
        f"with {weight:.1f} N, which eq. 13 leaves out; feedback then holds {feedback_force(config, weight):.2f} N. "
        f"{PAPER_SETTLED} N would need a foot that is lifted with {-weight_for(config, PAPER_SETTLED):.1f} N",
        judged(abs(peak - PAPER_PEAK) <= ABOUT, abs(settled - PAPER_SETTLED) <= ABOUT),
        links,
    )


def some_improvement(metrics: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """Fig. 12, from 3 to 6 s: better than feedback alone."""
    table = by_cycle(metrics)
    error, rmse = table["force_steady_state_error"].abs(), table["force_rmse"]
    return Claim(
        "as CMAC is applied in the second cycle, some improvement of the force can be observed",
        "section 5, Fig. 12",
        f"RMS force error {rmse[FIRST]:.2f} N to {rmse[SECOND]:.2f} N, steady-state error {error[FIRST]:.1%} to "
        f"{error[SECOND]:.1%}",
        judged(rmse[SECOND] < rmse[FIRST], error[SECOND] < error[FIRST]),
        links,
    )


def below_5_percent(metrics: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """Fig. 12: the steady-state error in the second cycle, and in those to come."""
    error = by_cycle(metrics)["force_steady_state_error"].loc[SECOND:]
    good = error.abs() < SMALL
    said = ", ".join(f"{error[cycle]:+.2%} in cycle {cycle}" for cycle in range(SECOND, FIFTH + 1))
    above = error.index[~good]
    lasting = f"below 5 % in every cycle from {above[-1] + 1} on" if len(above) else "below 5 % in every cycle"
    if good.iloc[-1] and error.index[-1] > FIFTH:
        said += f"; {lasting}, {error.iloc[-1]:+.2%} in cycle {error.index[-1]}: the bias of eq. 13, see below"
    return Claim(
        "between 3 s and 6 s the steady-state error is reduced to less than 5 %",
        "section 5, Fig. 12",
        said,
        "reproduced" if good[SECOND] else judged(False, bool(good.loc[:FIFTH].any())),
        links,
    )


def force_is_steady(metrics: "pd.DataFrame", config: Config, links: Sequence[Link]) -> Claim:
    """Fig. 12, from 3 to 6 s: the force in support."""
    ripple = float(by_cycle(metrics)["force_ripple"][SECOND]) / config["force_control"]["desired_force"]
    return Claim(
        "in the second cycle the foot force remains relatively steady during support",
        "section 5, Fig. 12",
        f"standard deviation over the second half of support: {ripple:.2%} of F_d",
        judged(ripple <= STEADY),
        links,
    )


def more_oscillation(second: "pd.DataFrame", fifth: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """Fig. 12, from 12 to 15 s: oscillations against those of the second cycle."""
    before, after = force_oscillation(second), force_oscillation(fifth)
    return Claim(
        "in the fifth cycle the foot force shows more oscillations than in the second",
        "section 5, Fig. 12",
        f"RMS of the force around its mean over {WINDOW:g} s, from {LANDED:g} s after touch-down on: "
        f"{MM * before:.1f} mN in cycle {SECOND}, {MM * after:.1f} mN in cycle {FIFTH}",
        judged(after > before, failed="contradicted"),
        links,
    )


def more_learning_is_no_better(metrics: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """Fig. 12, from 12 to 15 s: steady-state error and RMS error against those of the second cycle."""
    table = by_cycle(metrics)
    error, rmse = table["force_steady_state_error"].abs(), table["force_rmse"]
    return Claim(
        "more learning does not bring better performance: the steady-state error of the force has increased",
        "section 5, Fig. 12",
        f"from cycle {SECOND} to cycle {FIFTH} the steady-state error goes from {error[SECOND]:.2%} to "
        f"{error[FIFTH]:.2%}, the RMS force error from {rmse[SECOND]:.3f} N to {rmse[FIFTH]:.3f} N",
        judged(error[FIFTH] > error[SECOND], rmse[FIFTH] >= rmse[SECOND], failed="contradicted"),
        links,
    )


def all_improve(metrics: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """The summary of section 5."""
    table = by_cycle(metrics)
    columns = {
        "transfer_rmse_x": ("x in transfer", "mm", MM),
        "transfer_rmse_y": ("y in transfer", "mm", MM),
        "support_rmse_x": ("x in support", "mm", MM),
        "force_rmse": ("force", "N", 1.0),
    }
    return Claim(
        "CMAC improves force and position control, in the free and in the compliant space",
        "section 5",
        f"RMS errors of cycle {FIRST} and cycle {FIFTH}: "
        + "; ".join(
            f"{name} {f * table[column][FIRST]:.3g} and {f * table[column][FIFTH]:.3g} {unit}"
            for column, (name, unit, f) in columns.items()
        ),
        judged(*(table[column][FIFTH] < table[column][FIRST] for column in columns)),
        links,
    )
