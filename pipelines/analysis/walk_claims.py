"""What the paper claims of the quadruped (section 6), and the verdicts: functions of tables, by named criteria."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from cmacexp.report.page import Claim, Link

if TYPE_CHECKING:
    import pandas as pd

MM, MS, PERCENT = 1e3, 1e3, 1e2
REPRODUCED, IN_PART, NOT_REPRODUCED, CONTRADICTED = (
    "reproduced",
    "reproduced in part",
    "not reproduced",
    "contradicted",
)
DUTY_FACTOR = 0.8
LEAST_FEET = 3
STEADY_TILT = 0.02
"""Steady: over the last quarter of the cycles no tilt above this, rad."""
STEADY_HEIGHT = 0.01
"""Steady: nor a height that is off by more than this part of the planned one."""
SHORT = 0.1
"""A margin below this part of the body's length is very short."""
FOLLOWS = 0.9
"""A force is an indicator of a margin if their correlation is above this."""
OFTEN = 0.5
"""The late foot counts as seen if it is late in this part of the cycles, the last one included."""
AT_ONCE = 0.1
"""Restored at once: within this time, s; a sixth of a transfer of the paper's gait."""
HALVED = 0.5
"""Diminishing: the share of the feedback at the end, to that of the first cycle with CMAC."""
IMPROVED = 0.8
"""Improved: an error at the end, to that of feedback and posture control alone."""
ERRORS = {
    "transfer_rmse_x": ("transfer x", MM, "mm"),
    "transfer_rmse_y": ("transfer y", MM, "mm"),
    "force_rmse_three_feet": ("force on three feet", 1.0, "N"),
    "force_rmse_cycle": ("force over the whole cycle", 1.0, "N"),
}
"""What is to improve: name, factor and unit."""


class End(NamedTuple):
    """How a run ended."""

    status: str
    time: float
    """Simulated, s."""
    cycles: int
    """That were asked for."""


def gait_is_a_wave(gait: "pd.DataFrame", least_feet: int, links: Sequence[Link]) -> Claim:
    """Fig. 14, from :func:`pipelines.analysis.gait_events.gait` and the least number of feet that carry."""
    tolerance = 1e-3

    def after(first: int, second: int) -> float:
        return float((gait["lift_off"][second] - gait["lift_off"][first]) % 1.0)

    duty = (gait["duty_factor"] - DUTY_FACTOR).abs().max() < tolerance
    hind_first = all(0.0 < after(hind, front) < 0.5 for hind, front in ((3, 1), (4, 2)))
    opposite = all(abs(after(left, right) - 0.5) < tolerance for left, right in ((1, 2), (3, 4)))
    order = " ".join(str(leg) for leg in gait["lift_off"].sort_values().index)
    kept = least_feet >= LEAST_FEET
    return Claim(
        "Wave gait with duty factor 0.8: feet lift from hind to front, the sides half a cycle apart, at least three "
        "feet are on the ground",
        "sections 6, 6.1, Fig. 14",
        f"duty factor {', '.join(sorted({f'{d:.3f}' for d in gait['duty_factor']}))}; feet lift in the order "
        f"{order}, {PERCENT * after(3, 1):.0f} % of a cycle from hind to front; never fewer than {least_feet} feet "
        "carry",
        REPRODUCED if duty and hind_first and opposite and kept else IN_PART if kept else CONTRADICTED,
        links,
    )


def walks_steadily(end: End, body: "pd.DataFrame", hip_height: float, how: str, links: Sequence[Link]) -> Claim:
    """Stable: it walks to the end. Steady: level and at its height over the last quarter of the cycles."""
    last = body.tail(max(1, len(body) // 4))
    tilt = last["tilt_max"].max()
    off = max(last["height_max"].max() - hip_height, hip_height - last["height_min"].min())
    stable = end.status == "completed"
    steady = tilt <= STEADY_TILT and off <= STEADY_HEIGHT * hip_height
    walked = f"walks all {end.cycles} cycles" if stable else f"{end.status} after {end.time:.3f} s"
    return Claim(
        f"Force/position feedback, posture control and CMAC together give stable and steady walking ({how})",
        "section 6.3",
        f"{walked}; in the last {len(last)} it leans by up to {MM * tilt:.0f} mrad and its height is off by up to "
        f"{MM * off:.1f} mm, mean {MM * (last['height_mean'].mean() - hip_height):+.1f} mm",
        REPRODUCED if stable and steady else IN_PART if stable else NOT_REPRODUCED,
        links,
    )


def posture_carries(
    without: Mapping[str, End], with_it: Mapping[str, End], off: float, links: Sequence[Link]
) -> Claim:
    """Section 6.2: posture determines the forces; ``off`` is the largest of |sum of forces - weight|, N."""
    falls = [end.status == "fell" for end in without.values()]
    stands = [end.status == "completed" for end in with_it.values()]

    def summary(ends: Mapping[str, End]) -> str:
        return "; ".join(
            f"{name}: {'walks all cycles' if e.status == 'completed' else f'{e.status} at {e.time:.3f} s'}"
            for name, e in ends.items()
        )

    return Claim(
        "Foot forces depend on the posture; posture control obtains it",
        "sections 6, 6.2",
        f"{summary(without)}; {summary(with_it)}; the forces sum to the weight within {off:.0g} N",
        REPRODUCED if all(falls + stands) else IN_PART if any(falls) and any(stands) else NOT_REPRODUCED,
        links,
    )


def margin_is_short(planned: float, measured: float, length: float, which: str, links: Sequence[Link]) -> Claim:
    """Fig. 17 or 19: the centre of gravity is inside, but close to a boundary; margins in m."""
    claim, where = {
        "rear": (
            "When foot 3 is lifted the rear stability margin is very short, the COG stays inside",
            "section 6.3, Fig. 17",
        ),
        "front": (
            "Late in the transfer of foot 2 the COG is close to the front support boundary",
            "section 6.3, Fig. 19",
        ),
    }[which]
    inside, short = measured > 0.0, max(planned, measured) <= SHORT * length
    return Claim(
        claim,
        where,
        f"{which} margin {MM * planned:.2f} mm planned, {MM * measured:.1f} mm of the feet that carry; the body is "
        f"{MM * length:.0f} mm long",
        REPRODUCED if inside and short else IN_PART if inside else CONTRADICTED,
        links,
    )


def force_2_tells(lift_off: "pd.DataFrame", fallen_least: float, links: Sequence[Link]) -> Claim:
    """Fig. 17: F_n2 as an indicator; ``fallen_least`` is the least support force as another run falls, N."""
    last = lift_off.iloc[-1]
    positive, follows = lift_off["force_2_least"].min() > 0.0, last["correlation"] >= FOLLOWS
    return Claim(
        "F_n2 is another indicator for stability: at 0 the system is likely to fail",
        "section 6.3, Fig. 17",
        f"F_n2 is {last['force_2']:.2f} N (desired {last['desired_2']:.2f} N) when foot 3 leaves the ground, "
        f"{lift_off['force_2_least'].min():.2f} N at the least of all cycles; correlation with the rear margin "
        f"{last['correlation']:.3f}; where the machine falls, one of the three feet has {fallen_least:.2f} N left",
        REPRODUCED if positive and follows else IN_PART if positive or follows else NOT_REPRODUCED,
        links,
    )


def foot_1_is_late(
    touch_down: "pd.DataFrame", printed: "pd.DataFrame", least_planned: float, links: Sequence[Link]
) -> Claim:
    """Fig. 18: F_n1 when foot 3 takes over; ``printed`` is the same for eq. 24 as printed."""

    def late(table: "pd.DataFrame") -> "pd.DataFrame":
        return table[table["force_1"] > 0.0]

    def summary(table: "pd.DataFrame") -> str:
        own = late(table)
        if own.empty:
            return f"in none of {len(table)} cycles"
        return (
            f"in {len(own)} of {len(table)} cycles, by up to {MS * own['delay'].max():.0f} ms and "
            f"{own['force_1'].max():.1f} N, margin at least {MM * own['margin'].min():.0f} mm"
        )

    own = late(touch_down)
    often = len(own) >= OFTEN * len(touch_down) and touch_down["force_1"].iloc[-1] > 0.0
    harmless = own.empty or own["margin"].min() >= least_planned
    return Claim(
        "After foot 3 has touched down F_n1 is not 0 although F_d1 = 0, due to the delay of leg 1; it does no harm",
        "section 6.3, Fig. 18",
        f"foot 1 is late {summary(touch_down)}; {touch_down['force_1'].iloc[-1]:.2f} N in the last (foot 1 is not "
        f"late where foot 3 came down early). Eq. 24 as printed: {summary(printed)}",
        NOT_REPRODUCED if own.empty else REPRODUCED if often and harmless else IN_PART,
        links,
    )


def foot_2_restores(touch_down: "pd.DataFrame", links: Sequence[Link]) -> Claim:
    """Fig. 20: the front margin after the touch-down of foot 2."""
    last = touch_down.iloc[-1]
    rises = last["front_planned_after"] > last["front_planned"]
    never_lower, soon = last["front_after"] >= last["front"], last["restored"] <= AT_ONCE
    early = "before" if last["contact"] < 0.0 else "after"
    return Claim(
        "The touch-down of foot 2 restores stability immediately",
        "section 6.3, Fig. 20",
        f"planned front margin {MM * last['front_planned']:.0f} mm, then {MM * last['front_planned_after']:.0f} mm; "
        f"foot 2 carries {last['force_2']:.1f} N {MS * abs(last['contact']):.0f} ms {early} plan; then foot 1 is "
        f"down to {last['force_1_after']:.1f} N and the feet that carry leave {MM * last['front_after']:.0f} mm; "
        f"restored for good {MS * last['restored']:.0f} ms after contact in the last cycle, "
        f"{MS * touch_down['restored'].max():.0f} ms at the most",
        REPRODUCED if rises and never_lower else IN_PART if rises and soon else NOT_REPRODUCED,
        links,
    )


def feedback_diminishes(share: "pd.Series", links: Sequence[Link]) -> Claim:
    """Section 6.3; ``share`` is that of the feedforward per cycle, the first ones without it."""
    feedback = 1.0 - share[share > 0.0]
    first, last = (float(feedback.iloc[i]) for i in (0, -1))
    return Claim(
        "This is achieved in the absence of a model and with a diminishing contribution from the feedback control",
        "section 6.3",
        f"feedback has 100 % of the torque without CMAC, {PERCENT * first:.0f} % in cycle {feedback.index[0]}, "
        f"{PERCENT * last:.1f} % in cycle {feedback.index[-1]}",
        REPRODUCED if last <= HALVED * first else IN_PART if last < first else CONTRADICTED,
        links,
    )


def control_improves(learned: "pd.Series", alone: "pd.Series", how: str, links: Sequence[Link]) -> Claim:
    """Summary: errors of a learned cycle against those of feedback and posture control alone in the same cycle."""
    better = [learned[name] <= IMPROVED * alone[name] for name in ERRORS]
    errors = (
        f"{name} {scale * alone[key]:.2g} and {scale * learned[key]:.2g} {unit}"
        for key, (name, scale, unit) in ERRORS.items()
    )
    return Claim(
        f"Learning improves position and force control, also of the quadruped ({how})",
        "abstract, section 7",
        f"RMS errors of cycle {learned.name}, without and with CMAC: " + ", ".join(errors),
        REPRODUCED if all(better) else IN_PART if any(better) else NOT_REPRODUCED,
        links,
    )
