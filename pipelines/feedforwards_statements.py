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
        yes="CMAC gets far below every model tried, exact or not, on one leg and on four.",
        no="CMAC does not get far below every model tried on both machines.",
        unclear="Whether CMAC gets far below every model tried on both machines is unclear.",
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
        yes="The exact model and CMAC both gain much from a path without jumps: plan such paths first.",
        no="A path without jumps does not help both the exact model and CMAC much.",
        unclear="Whether a path without jumps helps both the exact model and CMAC much is unclear.",
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
        yes=f"At its best rate CMAC is as accurate in cycle {EARLY} as any other learner at its own.",
        no=f"At its best rate CMAC is less accurate in cycle {EARLY} than another learner at its own.",
        unclear=f"Which learner is the most accurate in cycle {EARLY} at its best rate is unclear.",
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
        yes="Even the slowest takes a small part of the sampling period: time is no reason to choose.",
        no="The slowest takes a large part of the sampling period: time is a reason to choose.",
        unclear="Whether time is a reason to choose is unclear.",
    ),
    "keep": Finding(
        [
            _criterion(
                change,
                f"{TENTH}, CMAC with its weights over CMAC from nothing",
                samples.carried_over,
                at_most(CLEARLY),
            )
            for change in CHANGES
        ],
        yes="After each of these changes CMAC learns faster with its weights than from nothing: keep them.",
        no="After some of these changes CMAC does not learn faster with its weights than from nothing.",
        unclear="Whether CMAC learns faster with its weights after each of these changes is unclear.",
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
