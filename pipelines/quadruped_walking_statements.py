"""What the paper says of its quadruped, and what else the walks show: claims, findings, and their limits."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cmacexp.study import Claim, Criterion, Finding, Results, at_least, at_most, between
from cmacexp.study.samples import Sample, quotients
from cmacexp.study.statements import Limit
from cmacexp.typing import Array
from pipelines import quadruped_walking_events as measured
from pipelines.common_results import percent
from pipelines.quadruped_walking_events import LATE, event, late

LADDER, NOISE, LONG = "ladder", "noise", "long"
"""Parts of the study."""
FEEDBACK, NO_POSTURE, NO_CMAC = "feedback", "feedback + CMAC", "feedback + posture"
ALL = "all"
PRINTED: dict[str, Any] = {"reference": "literal"}
AWARE: dict[str, Any] = {"reference": "aware"}
"""Eq. 24 as printed, by which claims are judged, and without its term F_d/K_ap once a CMAC acts."""
PUBLISHED, LEAD = "as published", "lead of one sample"
WALKS, FALLS = at_least(0.9), at_most(0.5)
"""Parts of the cycles that are walked."""
STEADY, LEANS = at_most(0.02), at_least(0.05)
"""Tilt, rad."""
SHORT, OUTSIDE = between(0.0, 0.1), at_most(0.0)
"""A margin as a part of the length of the body."""
IMPROVED, NOT_IMPROVED = at_most(0.8), at_least(1.0)
"""What is to be less, over what it is to be less than: of errors, of the feedback and of what noise changes."""
NEAR, FAR = at_most(0.05), at_least(0.1)
"""Departures from the gait as parts of a cycle: a quarter and half of a transfer."""
LATE_CYCLES = f"median of the last {LATE} cycles"
ERRORS = {
    "transfer_rmse_x": "transfer, in x",
    "transfer_rmse_y": "transfer, in y",
    "force_rmse_three_feet": "force, three feet down",
    "force_rmse_cycle": "force, whole cycle",
}


def noise_ratio(column: str) -> Sample:
    """What noise changes with CMAC, over what they change without; one value for each seed."""

    def sample(results: Results) -> Array:
        table = results.computed["noise"]
        own = table[table["reference"] == results.value("reference")]
        by_seed = own.pivot_table(index="seed", columns="controller", values=column)
        return quotients(by_seed[ALL].to_numpy(), by_seed[NO_CMAC].to_numpy())

    return sample


of_ladder = partial(percent, of={"part": LADDER})


def _tilt(case: str, holds: Limit, fails: Limit | None = None, **of: Any) -> Criterion:
    quantity = f"largest tilt in a cycle, {LATE_CYCLES}"
    return Criterion(quantity, f"tilt_max[-{LATE}:]", holds, fails, "mrad", 1e3, {"part": LADDER} | of, case)


class Said(NamedTuple):
    """A sentence of the paper: a claim with its reference as printed, and a finding with the other one."""

    words: str
    where: str
    measure: Callable[[dict[str, Any]], list[Criterion]]
    """The criteria, given the reference."""
    says: str
    """The finding, after "With `reference=aware`"."""

    def find(self) -> Finding:
        """What the sentence is worth with the aware reference."""
        return Finding(self.measure(AWARE), says=f"With `reference=aware` {self.says}")


SAID = {
    "walks": Said(
        "Force/position feedback, posture control, and CMAC provide stable and steady walking",
        "section 6.3",
        lambda reference: [
            of_ladder("part of the cycles that are walked", "done", WALKS, FALLS, controller=ALL, **reference),
            _tilt("", STEADY, LEANS, controller=ALL, **reference),
            of_ladder(f"largest difference from the planned height in the last {LATE} cycles", measured.height_off,
                      at_most(0.01), at_least(0.05), controller=ALL, **reference),
        ],
        "the machine walks to the end, level and at the planned height",
    ),
    "rear": Said(
        "When foot 3 is lifted the COG remains in the support pattern, the rear margin is very short",
        "section 6.3, Fig. 17",
        lambda reference: [
            of_ladder(f"rear margin over the length of the body, {LATE_CYCLES}", late("rear", -np.inf), SHORT,
                      OUTSIDE, controller=ALL, **reference)
        ],
        "the rear margin is short when foot 3 is lifted",
    ),
    "late": Said(
        "Immediately after foot 3 touches down F_n1 is not 0 although F_d1 = 0, due to the delay of leg 1; the "
        "delay has no adverse effect on stability",
        "section 6.3, Fig. 18",
        lambda reference: [
            of_ladder("part of the cycles in which foot 1 carries then",
                      event("force_1", lambda force: float((force > 0.0).mean())), at_least(0.5), at_most(0.05),
                      controller=ALL, **reference),
            Criterion("least margin until foot 1 lifts, over the least planned margin",
                      measured.margin_while_late, at_least(1.0), at_most(0.0),
                      of={"part": LADDER, "controller": ALL, **reference}),
        ],
        "foot 1 still carries when foot 3 touches down, and the margin stays above the least planned one",
    ),
    "front": Said(
        "While foot 2 is still in transfer the COG is close to the front support boundary",
        "section 6.3, Fig. 19",
        lambda reference: [
            of_ladder(f"front margin over the length of the body, {LATE_CYCLES}", late("front", -np.inf), SHORT,
                      OUTSIDE, controller=ALL, **reference)
        ],
        "the front margin is short while foot 2 is in transfer",
    ),
    "restored": Said(
        "Stability is immediately restored by leg 2, which is gaining a firm support",
        "section 6.3, Fig. 20",
        lambda reference: [
            Criterion(f"time from the contact of foot 2 until the margin is restored, {LATE_CYCLES}",
                      late("restored", np.inf), at_most(0.1), at_least(0.3), "s",  # transfer: 0.6 s
                      of={"part": LADDER, "controller": ALL, **reference}),
            Criterion(f"least front margin after the contact over that before it, {LATE_CYCLES}",
                      late("front_gain", -np.inf), at_least(1.0), at_most(0.0),
                      of={"part": LADDER, "controller": ALL, **reference}),
        ],
        "leg 2 restores the front margin at once",
    ),
    "feedback": Said(
        "The contribution from the feedback control diminishes",
        "section 6.3",
        lambda reference: [
            Criterion("share of feedback in the torque at the end over that in the first cycle with CMAC",
                      measured.feedback_left, IMPROVED, NOT_IMPROVED,
                      of={"part": LADDER, "controller": ALL, **reference})
        ],
        "the share of feedback in the torque falls clearly",
    ),
    "improves": Said(
        "Learning improves the accuracy of position and force control, also of the quadruped",
        "abstract, section 7",
        lambda reference: [
            Criterion("error at the end over that without CMAC",
                      f"{metric}[-{LATE}:]", IMPROVED, NOT_IMPROVED, case=name,
                      of={"part": LADDER, "controller": ALL, **reference}, over={"controller": NO_CMAC})
            for metric, name in ERRORS.items()
        ],
        "the CMAC lowers errors in transfer and of the force",
    ),
    "wave": Said(
        "Wave gait with a duty factor of 0.8: foot lifting propagates from the hind to the front legs, the sides are "
        "half a cycle out of phase, at least three feet are on the ground",
        "sections 6, 6.1, Fig. 14",
        lambda reference: [
            of_ladder(f"largest difference of a leg's contact from the duty factor, {LATE_CYCLES}",
                      late("duty_factor_off", np.inf), NEAR, FAR, controller=ALL, **reference),
            of_ladder(f"largest difference of a leg's lifting from the wave, of a cycle, {LATE_CYCLES}",
                      late("wave_off", np.inf), NEAR, FAR, controller=ALL, **reference),
            of_ladder("part of the time in which fewer than three feet carry", event("two_feet", np.mean),
                      at_most(0.0), at_least(0.01), controller=ALL, **reference),
        ],
        "feet touch down and lift as the wave gait plans, and at least three of them carry",
    ),
    "posture": Said(
        "The foot contact forces depend on the posture of the machine, and posture control obtains the desired one",
        "sections 6, 6.2",
        lambda reference: [
            of_ladder("part of the cycles that are walked", "done", *limits, case=name, controller=name,
                      **reference)
            for name, limits in (
                (FEEDBACK, (FALLS, WALKS)), (NO_POSTURE, (FALLS, WALKS)),
                (NO_CMAC, (WALKS, FALLS)), (ALL, (WALKS, FALLS)),
            )
        ],
        "the machine walks with posture control and falls without it",
    ),
    "indicator": Said(
        "The foot force F_n2 is another indicator for stability; when it is 0 the system is likely to fail",
        "section 6.3, Fig. 17",
        lambda reference: [
            Criterion(f"correlation of F_n2 with the rear margin while foot 3 is aloft, {LATE_CYCLES}",
                      late("correlation"), at_least(0.9), at_most(0.0),
                      of={"part": LADDER, "controller": ALL, **reference}),
            of_ladder("least force of a supporting foot as the machine falls, over the weight",
                      measured.least_force_at_fall, at_most(0.02), at_least(0.1),
                      controller=[FEEDBACK, NO_POSTURE], **reference),
        ],
        "the force of foot 2 follows the rear margin, and a supporting foot carries nothing when the machine falls",
    ),
    "noise": Said(
        "Improved robustness toward the sensor noises because the input of CMAC comes directly from trajectory "
        "planning, not from measurement",
        "section 6.3",
        lambda reference: [
            Criterion(f"change by noise with CMAC over that without, last {LATE} cycles", noise_ratio(column),
                      IMPROVED, NOT_IMPROVED, of={"part": NOISE, **reference}, case=what)
            for what, column in (("the feet's positions", "feet"), ("the contact forces", "force"))
        ],
        "the CMAC makes the walk more robust to noise",
    ),
}  # fmt: skip
"""What the paper says of its quadruped."""
CLAIMS = {name: Claim(said.words, said.where, said.measure(PRINTED)) for name, said in SAID.items()}

FINDINGS = {
    **{f"aware_{name}": said.find() for name, said in SAID.items()},
    "lean": Finding(
        [
            _tilt("eq. 24 as printed", LEANS, controller=ALL, **PRINTED),
            _tilt("aware reference", STEADY, controller=ALL, **AWARE),
        ],
        says="Once the CMAC has learnt, the body leans under eq. 24 as printed, and does not with "
            "`reference=aware`",
    ),
    "rocking": Finding(
        [
            of_ladder(f"part of the squared force error {what}, last {LATE} cycles", late(column), at_least(0.5),
                      controller=ALL, **AWARE)
            for what, column in (
                ("where four feet are planned to be down", "four_feet"),
                ("there that moves load between the diagonal pairs of feet", "diagonal"),
            )
        ],
        says="Most of the force error that is left falls where four feet are planned to be down, and "
            "most of that moves load from one diagonal pair of feet to the other",
    ),
    "noise_cost": Finding(
        [
            Criterion("transfer error at the end, all sensors noisy over perfect ones",
                      f"transfer_rmse_{side}[-{LATE}:]", at_most(1.25), case=f"in {side}",
                      of={"controller": ALL, "part": NOISE, **AWARE}, over={"part": LADDER})
            for side in "xy"
        ],
        says="With CMAC, noise on all sensors costs little accuracy",
    ),
    "lasting": Finding(
        [
            percent("part of the cycles that are walked", "done", limit, case=law, part=LONG, law=law)
            for law, limit in ((PUBLISHED, at_most(0.9)), (LEAD, at_least(0.9)))
        ],
        says="With the law as published the walk ends early, with a lead of one sample "
            "(`learning.lead=1`) it completes",
    ),
    "bursts": Finding(
        [Criterion("largest transfer error in x in the last fifth of the cycles over the median of the second fifth",
                   measured.bursts, at_least(2.0), of={"part": LONG, "law": LEAD})],
        says="Even with the lead, errors grow again",
    ),
}  # fmt: skip
