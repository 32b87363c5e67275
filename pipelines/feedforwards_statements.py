"""What the paper claims of CMAC beside other feedforwards, and what the study asks besides."""

from collections.abc import Callable, Sequence
from functools import partial

from cmacexp.study import Claim, Criterion, Finding, Results, at_least, at_most
from cmacexp.study.statements import Limit
from cmacexp.typing import Array
from pipelines import feedforwards_samples as samples
from pipelines.feedforwards_kinds import CMAC, EXACT, HEAVY, LIGHT, RBF
from pipelines.feedforwards_samples import CHANGES, EARLY, LATE, LEG, RATE, SMOOTH, STROKES, WALK

Sample = Callable[[Results], Sequence[float] | Array]
AS_GOOD, CLEARLY, HALF = 1.25, 0.8, 0.5
"""Ratios of errors or cycles: the largest that count as as good, as clearly better, and as far below."""
LONG, LITTLE = 2.0, 0.25
"""Cycles over those of CMAC that count as long; error over that of feedback alone that generalisation may leave."""
SHORT = 0.1
"""Time of a step over the sampling period up to which time is no reason to choose."""


def _criterion(
    group: str | list[str],
    quantity: str,
    sample: Sample,
    holds: Limit,
    fails: Limit | None = None,
    percent: bool = False,
) -> Criterion:
    where = group if isinstance(group, str) else LEG
    unit, scale = ("%", 100.0) if percent else ("", 1.0)
    return Criterion(f"{where}: {quantity}", sample, holds, fails, unit=unit, scale=scale, of={"group": group})


TENTH = "cycles to a tenth of the error of feedback alone"
RAPID = f"{TENTH}, CMAC over the fastest of RBF, MLP, ILC"
LEFT = "learnt with the default stroke, error of {} in the first cycle over that of feedback alone"
LONG_TRAINING = (
    "the drawback of a neural network that is trained to compensate for the model is its long training time"
)
CLAIMS = {
    "rapid": Claim(
        "CMAC is suited to real-time control by its simple design and rapid learning",
        "section 1",
        [
            _criterion(group, RAPID, samples.against_fastest, at_most(AS_GOOD), at_least(LONG))
            for group in (LEG, WALK)
        ],
    ),
    "training": Claim(
        LONG_TRAINING,
        "section 1, of its reference 17",
        [_criterion(LEG, f"{TENTH}, MLP over CMAC", samples.training_time, at_least(LONG), at_most(1.0))],
    ),
    "generalises": Claim(
        "CMAC generalises: it generates similar outputs for similar inputs",
        "section 1",
        [
            _criterion(stroke, LEFT.format(CMAC), samples.left_at_first, at_most(LITTLE), at_least(1.0), percent=True)
            for stroke in STROKES
        ],
    ),
}
FINDINGS = {
    "models": Finding(
        [
            _criterion(
                group,
                f"error of CMAC in cycle {LATE} over the least of the models, exact or with masses 20 % off",
                partial(samples.cmac_against, kinds=(EXACT, LIGHT, HEAVY)),
                at_most(HALF),
            )
            for group in (LEG, WALK)
        ],
        yes=f"In cycle {LATE} the error of CMAC is far below that of every model tried, on one leg and on four.",
        no=f"In cycle {LATE} the error of CMAC is not far below that of every model tried on both machines.",
        unclear=f"Whether the error of CMAC in cycle {LATE} is far below that of every model tried is unclear.",
    ),
    "jumps": Finding(
        [
            _criterion(
                [LEG, SMOOTH],
                f"error of {kind} in cycle {LATE} without jumps of the planned speed, over that with them",
                partial(samples.without_jumps, kind=kind),
                at_most(HALF),
            )
            for kind in (EXACT, CMAC)
        ],
        yes="The exact model and CMAC are both far more accurate on a path without jumps: plan such paths first.",
        no="The exact model and CMAC are not both far more accurate on a path without jumps.",
        unclear="Whether the exact model and CMAC are both far more accurate on a path without jumps is unclear.",
    ),
    "best_rate": Finding(
        [
            _criterion(
                [LEG, RATE],
                f"error in cycle {EARLY}, CMAC over the least of RBF, MLP, ILC, at the best rate of each",
                samples.at_best_rate,
                at_most(AS_GOOD),
            )
        ],
        yes=f"Each at its best rate, CMAC is in cycle {EARLY} about as accurate as RBF, MLP and ILC, or more.",
        no=f"Each at its best rate, CMAC is in cycle {EARLY} less accurate than one of RBF, MLP and ILC.",
        unclear=f"Whether CMAC is in cycle {EARLY} as accurate as RBF, MLP and ILC at their best rates is unclear.",
    ),
    "time": Finding(
        [
            _criterion(
                LEG,
                "least time of a step, the largest of all, over the sampling period",
                samples.slowest_step,
                at_most(SHORT),
                percent=True,
            )
        ],
        yes="A step of the slowest takes {value} of the sampling period: computing time need not decide the choice.",
        no="A step of the slowest takes {value} of the sampling period: computing time limits the choice.",
        unclear="A step of the slowest takes {value} of the sampling period: that may limit the choice.",
    ),
    "keep": Finding(
        [
            _criterion(
                change,
                f"{TENTH}, counted from where learning begins, CMAC with its weights over CMAC from nothing",
                samples.carried_over,
                at_most(CLEARLY),
            )
            for change in CHANGES
        ],
        yes="After each of these changes CMAC needs fewer cycles with its weights than from nothing: keep them.",
        no="After some of these changes CMAC does not need fewer cycles with its weights than from nothing.",
        unclear="Whether CMAC needs fewer cycles with its weights after each of these changes is unclear.",
    ),
    "carries_more": Finding(
        [
            _criterion(
                stroke, LEFT.format(RBF), partial(samples.left_at_first, kind=RBF), at_most(LITTLE), percent=True
            )
            for stroke in STROKES
        ],
        yes="RBF carries most of what it has learnt over to another stroke.",
        no="RBF does not carry most of what it has learnt over to both other strokes.",
        unclear="Whether RBF carries most of what it has learnt over to another stroke is unclear.",
    ),
}
