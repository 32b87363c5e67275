"""What Lin & Song 1997, section 6, claim of the quadruped, what the study finds besides, and what decides it."""

import numpy as np

from cmacexp.study import Claim, Criterion, Finding, Results, at_least, at_most, between
from cmacexp.study.statements import Limit
from cmacexp.typing import Array
from pipelines.quadruped_walking_events import LATE
from pipelines.quadruped_walking_measures import (
    ALL,
    FEEDBACK,
    LADDER,
    LEAD,
    LONG,
    NO_CMAC,
    NO_POSTURE,
    NOISE,
    PRINTED,
    PUBLISHED,
    Sample,
    at_end,
    bursts,
    height_off,
    in_part,
    least_force_at_fall,
    noise_ratio,
    over_cycles,
    walked,
)

WALKS, FALLS = at_least(0.9), at_most(0.5)
"""Parts of the cycles that are walked."""
STEADY, LEANS = at_most(0.02), at_least(0.05)
"""Tilt, rad."""
SHORT, OUTSIDE = between(0.0, 0.1), at_most(0.0)
"""A margin as a part of the length of the body."""
AT_ONCE, LATER = at_most(0.1), at_least(0.3)
"""Seconds to restore stability: a sixth and half of a transfer."""
IMPROVED, NOT_IMPROVED = at_most(0.8), at_least(1.0)
"""What is to be less, over what it is to be less than: of errors, of the feedback and of what noise changes."""
NEAR, FAR = at_most(0.05), at_least(0.1)
"""Departures from the gait as parts of a cycle: a quarter and half of a transfer."""
LITTLE_MORE = 1.25
"""Errors with noise over those without, up to which noise costs little accuracy."""
LASTS = 0.9
"""Part of the cycles from which on a law lasts."""
BURST = 2.0
"""Ratio of errors from which on they have grown again."""
LATE_CYCLES = f"median of the last {LATE} cycles"
ERRORS = {
    "transfer_rmse_x": "transfer error in x",
    "transfer_rmse_y": "transfer error in y",
    "force_rmse_three_feet": "force error with three feet down",
    "force_rmse_cycle": "force error over the whole cycle",
}


def _criterion(
    controller: str, quantity: str, sample: Sample, holds: Limit, fails: Limit | None = None, unit: str = ""
) -> Criterion:
    """Of the runs of a controller; ``unit`` % makes a fraction a percentage."""
    of = {"part": LADDER, "controller": controller}
    return Criterion(quantity, sample, holds, fails, unit, 100.0 if unit == "%" else 1.0, of)


def _margin_while_late(results: Results) -> Array:
    """Least margin while foot 1 is late, over the least planned margin."""
    return over_cycles("margin", np.min)(results) / results.at(1, "stability_margin_min")


def _feedback_left(results: Results) -> Array:
    """Share of the feedback in the torque at the end over that in the first cycle with CMAC."""
    first = int(results.value("learning.start_cycle"))
    left: Array = (1.0 - results.end("feedforward_share", LATE)) / (1.0 - results.at(first, "feedforward_share"))
    return left


def _improvement(controller: str, metric: str) -> Sample:
    """An error at the end over that without CMAC."""

    def sample(results: Results) -> Array:
        ladder = in_part(results, LADDER)
        learned, alone = (ladder.select(controller=name).end(metric, LATE) for name in (controller, NO_CMAC))
        ratio: Array = learned / alone[0]
        return ratio

    return sample


def _claims(controller: str, how: str) -> dict[str, Claim]:
    """The claims about the full controller, with one of its references."""

    def measured(*arguments: object) -> Criterion:
        return _criterion(controller, *arguments)  # type: ignore[arg-type]

    return {
        f"walks_{how}": Claim(
            f"Force/position feedback, posture control, and CMAC provide stable and steady walking ({how})",
            "section 6.3",
            [
                measured("part of the cycles that are walked", walked, WALKS, FALLS, "%"),
                Criterion(f"largest tilt in a cycle, {LATE_CYCLES}", lambda r: r.end("tilt_max", LATE), STEADY, LEANS,
                          "mrad", 1e3, {"part": LADDER, "controller": controller}),
                measured(f"largest departure from the planned height in the last {LATE} cycles", height_off,
                         at_most(0.01), at_least(0.05), "%"),
            ],
        ),
        f"rear_{how}": Claim(
            f"When foot 3 is lifted the COG remains in the support pattern, the rear margin is very short ({how})",
            "section 6.3, Fig. 17",
            [measured(f"rear margin over the length of the body, {LATE_CYCLES}", at_end("rear", -np.inf), SHORT,
                      OUTSIDE, "%")],
        ),
        f"late_{how}": Claim(
            "Immediately after foot 3 touches down F_n1 is not 0 although F_d1 = 0, due to the delay of leg 1; the "
            f"delay has no adverse effect on stability ({how})",
            "section 6.3, Fig. 18",
            [
                measured("part of the cycles in which foot 1 carries then",
                         over_cycles("force_1", lambda force: float((force > 0.0).mean())), at_least(0.5),
                         at_most(0.05), "%"),
                measured("least margin until foot 1 lifts, over the least planned margin", _margin_while_late,
                         at_least(1.0), at_most(0.0)),
            ],
        ),
        f"front_{how}": Claim(
            f"While foot 2 is still in transfer the COG is close to the front support boundary ({how})",
            "section 6.3, Fig. 19",
            [measured(f"front margin over the length of the body, {LATE_CYCLES}", at_end("front", -np.inf), SHORT,
                      OUTSIDE, "%")],
        ),
        f"restored_{how}": Claim(
            f"Stability is immediately restored by leg 2, which is gaining a firm support ({how})",
            "section 6.3, Fig. 20",
            [
                measured(f"time from the contact of foot 2 until the margin is restored, {LATE_CYCLES}",
                         at_end("restored", np.inf), AT_ONCE, LATER, "s"),
                measured(f"least front margin after the contact over that before it, {LATE_CYCLES}",
                         at_end("front_gain", -np.inf), at_least(1.0), at_most(0.0)),
            ],
        ),
        f"feedback_{how}": Claim(
            f"The contribution from the feedback control diminishes ({how})",
            "section 6.3",
            [measured("share of feedback in the torque at the end over that in the first cycle with CMAC",
                      _feedback_left, IMPROVED, NOT_IMPROVED)],
        ),
        f"improves_{how}": Claim(
            f"Learning improves the accuracy of position and force control, also of the quadruped ({how})",
            "abstract, section 7",
            [Criterion(f"{name} at the end over that without CMAC", _improvement(controller, metric), IMPROVED,
                       NOT_IMPROVED, of={"part": LADDER, "controller": [controller, NO_CMAC]})
             for metric, name in ERRORS.items()],
        ),
    }  # fmt: skip


CLAIMS = {
    "wave": Claim(
        "Wave gait with a duty factor of 0.8: foot lifting propagates from the hind to the front legs, the sides are "
        "half a cycle out of phase, at least three feet are on the ground",
        "sections 6, 6.1, Fig. 14",
        [
            _criterion(ALL, f"largest departure of a leg's contact from the duty factor, {LATE_CYCLES}",
                       at_end("duty_factor_off", np.inf), NEAR, FAR, "%"),
            _criterion(ALL, f"largest departure of a leg's lifting from the wave, of a cycle, {LATE_CYCLES}",
                       at_end("wave_off", np.inf), NEAR, FAR, "%"),
            _criterion(ALL, "part of the time in which fewer than three feet carry",
                       over_cycles("two_feet", np.mean), at_most(0.0), at_least(0.01), "%"),
        ],
    ),
    "posture": Claim(
        "The foot contact forces depend on the posture of the machine, and posture control obtains the desired one",
        "sections 6, 6.2",
        [
            _criterion(name, f"part of the cycles that are walked, {name}", walked, *limits, "%")
            for name, limits in (
                (FEEDBACK, (FALLS, WALKS)), (NO_POSTURE, (FALLS, WALKS)),
                (NO_CMAC, (WALKS, FALLS)), (ALL, (WALKS, FALLS)),
            )
        ],
    ),
    "indicator": Claim(
        "The foot force F_n2 is another indicator for stability; when it is 0 the system is likely to fail",
        "section 6.3, Fig. 17",
        [
            _criterion(ALL, f"correlation of F_n2 with the rear margin while foot 3 is aloft, {LATE_CYCLES}",
                       at_end("correlation"), at_least(0.9), at_most(0.0)),
            Criterion("least force of a supporting foot as the machine falls, over the weight", least_force_at_fall,
                      at_most(0.02), at_least(0.1), "%", 100.0,
                      {"part": LADDER, "controller": [FEEDBACK, NO_POSTURE]}),
        ],
    ),
    **_claims(PRINTED, "eq. 24 as printed"),
    **_claims(ALL, "aware reference"),
    "noise": Claim(
        "Improved robustness toward the sensor noises because the input of CMAC comes directly from trajectory "
        "planning, not from measurement",
        "section 6.3",
        [
            Criterion(f"what noise changes in {what}, last {LATE} cycles, with CMAC over without",
                      noise_ratio(column), IMPROVED, NOT_IMPROVED, of={"controller": [ALL, NO_CMAC]})
            for what, column in (("the feet's positions", "feet"), ("the contact forces", "force"))
        ],
    ),
}  # fmt: skip

FINDINGS = {
    "lean": Finding(
        [
            Criterion(
                f"largest tilt in a cycle, median of the last {LATE}, {name}",
                lambda r: r.end("tilt_max", LATE),
                limit,
                unit="mrad",
                scale=1e3,
                of={"part": LADDER, "controller": controller},
            )
            for controller, name, limit in (
                (PRINTED, "eq. 24 as printed", at_least(0.05)),
                (ALL, "aware reference", at_most(0.02)),
            )
        ],
        yes="Once the CMAC has learnt, the body leans by {value} under eq. 24 as printed, and by {values[1]} with "
        "the aware reference: use `reference=aware` under a body.",
        no="Once the CMAC has learnt, the body leans by {value} under eq. 24 as printed and by {values[1]} with the "
        "aware reference: this does not single out the aware reference.",
        unclear="These runs do not decide whether the aware reference keeps the body level where eq. 24 as printed "
        "does not.",
    ),
    "rocking": Finding(
        [
            Criterion(f"part of the squared force error {what}, last {LATE} cycles", at_end(column), at_least(0.5),
                      unit="%", scale=100.0, of={"part": LADDER, "controller": ALL})
            for what, column in (
                ("where four feet are planned to be down", "four_feet"),
                ("there that moves load between the diagonal pairs of feet", "diagonal"),
            )
        ],
        yes="Most of the force error that is left ({value} of its square) falls where four feet are planned to be "
        "down, and {values[1]} of that moves load from one diagonal pair of feet to the other.",
        no="The force error that is left is not mainly load that moves between the diagonal pairs of four feet.",
        unclear="The runs do not decide whether the force error that is left is mainly load that moves between the "
        "diagonal pairs of four feet.",
    ),
    "noise_cost": Finding(
        [
            Criterion(f"transfer error in {side} at the end, all sensors noisy over perfect ones", sample,
                      at_most(LITTLE_MORE), of={"controller": ALL})
            for side, sample in (
                (side, lambda r, m=f"transfer_rmse_{side}": (
                    in_part(r, NOISE).end(m, LATE) / in_part(r, LADDER).end(m, LATE)
                )) for side in "xy"
            )
        ],
        yes="With CMAC all noises together cost little accuracy: errors are {value} and {values[1]} times those with "
        "perfect sensors in x and y.",
        no="With CMAC all noises together cost accuracy: errors are {value} and {values[1]} times those with perfect "
        "sensors in x and y.",
        unclear="The seeds differ too much to say whether all noises together cost accuracy with CMAC.",
    ),
    "lasting": Finding(
        [
            Criterion(f"part of the cycles that are walked, {law}", walked, limit, unit="%", scale=100.0,
                      of={"part": LONG, "law": law})
            for law, limit in ((PUBLISHED, at_most(LASTS)), (LEAD, at_least(LASTS)))
        ],
        yes="The law as published does not last: it ends after {value} of the cycles, and with a lead of one sample "
        "the machine completes {values[1]} of them. Set `learning.lead=1`.",
        no="A lead of one sample does not decide whether learning lasts: with the law as published the machine "
        "completes {value} of the cycles, with the lead {values[1]}.",
        unclear="The seeds differ too much to say whether a lead of one sample decides how long learning lasts.",
    ),
    "bursts": Finding(
        [Criterion("largest transfer error in x in the last fifth of the cycles over the median of the second fifth",
                   bursts, at_least(BURST), of={"part": LONG, "law": LEAD})],
        yes="Even with the lead errors do not stay small: in the last fifth of the cycles the transfer error in x "
        "rises to {value} times its median in the second fifth.",
        no="With the lead errors stay small: in the last fifth of the cycles the transfer error in x is at most "
        "{value} times its median in the second fifth.",
        unclear="The seeds differ too much to say whether errors stay small with the lead.",
    ),
}  # fmt: skip
