"""What Lin & Song 1997 claim of one leg's torques and of the learning law (sections 4, 5), by stated criteria."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.report.page import Claim, Link
from pipelines.analysis.figures_one_leg import MM, data_points, touch_down
from pipelines.analysis.one_leg_measures import (
    EVENT,
    FIFTH,
    FIRST,
    SECOND,
    TORQUE_WINDOW,
    by_cycle,
    judged,
    torque_oscillation,
    torque_step,
)

if TYPE_CHECKING:
    import pandas as pd

BUSY = 3.0
"""RMS of a torque around its moving mean, over that in mid support, above which it oscillates."""
MAJOR = 0.5
"""Share of the torque that is the major part."""
LESS_DRASTIC = 0.8
"""Largest step of the torque with a ramp over that without."""
AGAIN = 1.1
"""Share of the feedback over its least above which it has grown again."""
GROWN = 2.0
"""RMS feedback over its least above which learning no longer converges."""


def torque_oscillates_at_events(rows: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """Fig. 13: the feedforward torque at touch-down and in support."""
    event, smooth = torque_oscillation(rows)
    return Claim(
        "the learning torques oscillate where the torque changes abruptly, e.g. around data point 1320, and are "
        "smooth in support",
        "section 5, Fig. 13",
        f"RMS of the CMAC's torque around its mean over {TORQUE_WINDOW:g} s: {event:.2f} N m in the {EVENT:g} s from "
        f"data point {data_points(rows, FIFTH)[touch_down(rows)]} on, {smooth:.3f} N m in mid support, "
        f"{event / smooth:.0f} times less",
        judged(event >= BUSY * smooth),
        links,
    )


def major_part(metrics: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """Fig. 13: who gives the torque."""
    share = by_cycle(metrics)["feedforward_share"]
    return Claim(
        "CMAC provides the major part of the overall control torques",
        "section 5, Fig. 13",
        ", ".join(f"{share[cycle]:.0%} in cycle {cycle}" for cycle in range(SECOND, FIFTH + 1)),
        judged(bool(share[FIFTH] > MAJOR)),
        links,
    )


def ramp_is_milder(step: "pd.DataFrame", ramp: "pd.DataFrame", duration: float, links: Sequence[Link]) -> Claim:
    """What the paper expects of a force that is ramped: the torque."""
    before, after = torque_step(step), torque_step(ramp)
    return Claim(
        "with a force ramp instead of a step the change of torques is expected to be less drastic",
        "section 5",
        f"largest change of the torque of joint 1 within 5 ms at touch-down, cycle {FIFTH}: {before:.1f} N m with "
        f"the step, {after:.1f} N m with a ramp of {duration:g} s",
        judged(after <= LESS_DRASTIC * before),
        links,
    )


def ramp_is_learnt_better(step: "pd.DataFrame", ramp: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """What the paper expects of a force that is ramped: the approximation."""
    step, ramp = by_cycle(step), by_cycle(ramp)
    feedback, share, y = "feedback_rms", "feedforward_share", "transfer_rmse_y"
    return Claim(
        "with a force ramp CMAC probably provides better approximation",
        "section 5",
        f"cycle {FIFTH}, step against ramp: feedback torque that is left {step[feedback][FIFTH]:.2f} against "
        f"{ramp[feedback][FIFTH]:.2f} N m RMS, CMAC's share {step[share][FIFTH]:.0%} against "
        f"{ramp[share][FIFTH]:.0%}; RMS error of the foot in transfer, y: {MM * step[y][FIFTH]:.1f} against "
        f"{MM * ramp[y][FIFTH]:.1f} mm",
        judged(ramp[feedback][FIFTH] < step[feedback][FIFTH], ramp[share][FIFTH] > step[share][FIFTH]),
        links,
    )


def feedback_fades(metrics: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """Section 4: the share of the feedback over learning; in the paper's cycles, and after them."""
    share = 1.0 - by_cycle(metrics)["feedforward_share"]
    early = share.loc[:FIFTH]
    least, last = share.idxmin(), share.index[-1]
    return Claim(
        "as CMAC progresses in learning the share of feedback in the control output decreases",
        "section 4",
        ", ".join(f"{value:.0%}" for value in early)
        + f" in cycles {FIRST} to {FIFTH}; least in cycle {least} ({share[least]:.0%}), {share[last]:.0%} in "
        f"cycle {last}",
        judged(bool((np.diff(early) < 0.0).all()), bool(share[last] <= AGAIN * share[least])),
        links,
    )


def law_converges(metrics: "pd.DataFrame", status: str, links: Sequence[Link]) -> Claim:
    """Section 4: convergence and complete stability, in a run that is longer than the paper's."""
    feedback = by_cycle(metrics)["feedback_rms"].dropna()
    least, last = feedback.idxmin(), feedback.index[-1]
    growth = feedback[last] / feedback[least]
    diverged = status == "diverged"
    end = f"the run diverges in cycle {last}" if diverged else f"cycle {last} is still simulated"
    return Claim(
        "the learning law is convergent, and the learning control system has complete stability",
        "section 4",
        f"RMS feedback torque is least in cycle {least} ({feedback[least]:.2f} N m) and {growth:.3g} times that in "
        f"cycle {last}; {end}",
        "contradicted" if diverged or growth >= GROWN else "reproduced",
        links,
    )
