"""What the study of long learning may find, and the runs that decide it."""

from functools import partial
from typing import Any

from cmacexp.cmac.rules import RULES
from cmacexp.study import Criterion, Finding, Results, at_least, at_most
from cmacexp.study.samples import per_seed, relative, share_done
from cmacexp.typing import Array
from pipelines import long_learning_measures as measures
from pipelines.long_learning_measures import FORCE, GRID, LATE, LEG, LONG, PAPER, RATE, SETTING, TRANSFER, WALK

RATES = (0.05, 0.1, 0.1953125, 0.4, 0.8, 1.5)
PAPER_RATE, FASTEST = RATES[2], RATES[-1]
SLOWER = {"part": RATE, "learning.rate": list(RATES[:-1])}
RAMPED, FELT = "ramp", "ramp, force feedback"
"""Settings of the quadruped that are compared."""
STEADY = at_most(1.25)
"""Limit of the largest error over the least in the second half of a run that lasts."""
ENDS = at_most(0.9)
"""Limit of the share of its cycles that a run completes if it ends before its time."""
PERCENT: dict[str, Any] = {"unit": "%", "scale": 100.0}
VARIES = "largest error over the least in the second half of the run"
WARNED = {"part": [GRID, LATE, RATE]}


def _least_of_others(results: Results, lead: int, name: str) -> Array:
    """(seeds,): least error at the end of the other rules with a lead, over the paper's rule with lead 1."""
    own = results.select(PAPER, lead="lead 1")
    others = results.select({"learning.rule": [rule for rule in RULES if rule != "paper"], "learning.lead": lead})
    return per_seed(others, relative(others, own, partial(measures.final, name=name)), min)


def _one_less(results: Results) -> Array:
    """(runs,): share done with a lead of a sample less than from torque to feedback."""
    chosen = [row for row in results.rows if row.settings["learning.lead"] == row.settings["actuator.delay"]]
    return share_done(Results(chosen))


def _at_other_rates(results: Results) -> Array:
    """(seeds,): largest error at the end over that with the paper's rate."""
    own = results.select({"learning.rate": PAPER_RATE})
    return per_seed(results, relative(results, own, measures.final), max)


def _with_feedback(results: Results) -> Array:
    """(seeds,): force error at the end with stronger force feedback over that without."""
    felt, ramped = (results.select(settings=name) for name in (FELT, RAMPED))
    return relative(felt, ramped, partial(measures.final, name=FORCE))


def _paper(machine: str, lead: int) -> dict[str, Any]:
    return {"part": GRID, "machine": machine, "learning.lead": lead, **PAPER}


def _done(what: str, **of: Any) -> Criterion:
    return Criterion(f"cycles done of those asked for, {what}", share_done, ENDS, **PERCENT, **of)


FINDINGS = {
    "lead": Finding(
        [
            *(_done(f"{machine}, lead 0", of=_paper(machine, 0)) for machine in (LEG, WALK)),
            Criterion(f"{VARIES}, one leg, lead 1", measures.variation, STEADY, of={"part": LONG, **PAPER}),
        ],
        yes="With lead 0, as published, the paper's rule does not last: one leg ends after {value} of its cycles, "
        "the quadruped after {values[1]}. With lead 1 it lasts on one leg.",
        no="The lead alone does not decide whether the paper's rule lasts: with lead 0 one leg completes {value} of "
        "its cycles and the quadruped {values[1]}; with lead 1 errors of one leg vary {values[2]}-fold in the second "
        "half.",
        unclear="Whether the lead decides if the paper's rule lasts differs between seeds.",
    ),
    "body": Finding(
        [Criterion(f"{VARIES}, force", partial(measures.variation, name=FORCE), STEADY, of=_paper(WALK, 1))],
        yes="Lead 1 is enough under a body too: force errors vary by a factor of {value} in the second half.",
        no="Lead 1 alone is not enough under a body: force errors vary by a factor of {value} in the second half.",
        unclear="Whether lead 1 is enough under a body differs between seeds.",
    ),
    **{
        f"rules_{machine}": Finding(
            [
                Criterion(
                    f"least {what} error of the other rules with lead 1 over that of the paper's rule",
                    partial(_least_of_others, lead=1, name=name),
                    at_most(0.9),
                    of={"part": GRID, "machine": machine},
                )
            ],
            yes=f"With lead 1 ({machine}) another rule leaves {{value}} times the {what} error of the paper's.",
            no=f"With lead 1 ({machine}) no other rule leaves a {what} error smaller by a tenth than the paper's.",
            unclear=f"Whether another rule leaves a smaller {what} error ({machine}) differs between seeds.",
        )
        for machine, what, name in ((LEG, "transfer", TRANSFER), (WALK, "force", FORCE))
    },
    "substitute": Finding(
        [
            Criterion(
                "least error of the other rules with lead 0 over that of the paper's rule with lead 1",
                partial(_least_of_others, lead=0, name=TRANSFER),
                at_most(1.1),
                of={"part": GRID, "machine": LEG},
            )
        ],
        yes="On one leg a rule can replace the right lead: with lead 0 one leaves {value} times the error of the "
        "paper's rule with lead 1.",
        no="On one leg no rule replaces the right lead: with lead 0 the least error of any other is {value} times "
        "that of the paper's rule with lead 1.",
        unclear="Whether another rule can replace the right lead on one leg differs between seeds.",
    ),
    "late": Finding(
        [
            Criterion(f"{VARIES}, auto", measures.variation, STEADY, of={"part": LATE, "learning.lead": "auto"}),
            Criterion("cycles done of those asked for, one less", _one_less, ENDS, **PERCENT, of={"part": LATE}),
        ],
        yes="The lead must not be less than the number of samples from torque to feedback, which "
        "`learning.lead=auto` counts: with one less, runs end after {values[1]} of their cycles.",
        no="The number of samples from torque to feedback does not decide: with `learning.lead=auto` errors vary "
        "{value}-fold in the second half; with one less, runs complete {values[1]} of their cycles.",
        unclear="The runs do not decide whether the lead must be the number of samples from torque to feedback.",
    ),
    "rate": Finding(
        [
            Criterion(
                "largest error at the end with another rate over that with the paper's, lead 1",
                _at_other_rates,
                at_most(1.1),
                of={**SLOWER, "learning.lead": 1},
            ),
            _done(f"rate {FASTEST}, lead 1", of={"part": RATE, "learning.lead": 1, "learning.rate": FASTEST}),
        ],
        yes=f"With lead 1, no rate up to {RATES[-2]} ends with a clearly larger error; with {FASTEST} "
        "one leg ends after {values[1]} of its cycles.",
        no=f"With lead 1, rates up to {RATES[-2]} end with up to {{value}} times the error of the paper's; with "
        f"{FASTEST} one leg completes {{values[1]}} of its cycles.",
        unclear="What the rate changes with lead 1 differs between seeds.",
    ),
    "settings": Finding(
        [
            Criterion(
                "force error at the end with ramp and stronger force feedback, over that with the ramp alone",
                _with_feedback,
                at_most(0.5),
                of={"part": SETTING},
            ),
            Criterion(
                f"{VARIES}, force, with both",
                partial(measures.variation, name=FORCE),
                STEADY,
                of={"part": SETTING, "settings": FELT},
            ),
        ],
        yes="Stronger force feedback keeps the quadruped's force error small: {value} times that without it. "
        "`scenario=quadruped_lasting` has these settings.",
        no="Stronger force feedback does not keep the quadruped's force error small: it is {value} times that "
        "without, and varies {values[1]}-fold.",
        unclear="Whether stronger force feedback keeps the quadruped's force error small differs between seeds.",
    ),
    "drift": Finding(
        [
            Criterion(
                "runs that end before their time in which drift is detected",
                measures.detected_if_ended,
                at_least(0.8),
                **PERCENT,
                of=WARNED,
            ),
            Criterion(
                "error in the cycle of detection over the least up to it",
                measures.error_when_detected,
                STEADY,
                of=WARNED,
            ),
        ],
        yes="Drift is detected in {value} of the runs that diverge or fall, when errors are {values[1]} times their "
        "least: learning can be stopped in time.",
        no="Drift is no sufficient warning: it is detected in {value} of the runs that diverge or fall, when errors "
        "are {values[1]} times their least.",
        unclear="Whether drift warns in time is not settled: it is detected in {value} of the runs that diverge or "
        "fall, when errors are {values[1]} times their least.",
    ),
    **{
        f"growth_{machine}": Finding(
            [
                Criterion(
                    f"largest distance of predicted from measured growth per cycle, paper's rule, {machine}",
                    partial(measures.growth_miss, machine=machine),
                    at_most(0.01),
                )
            ],
            yes=f"For the paper's rule ({machine}) the linearised loop predicts the growth per cycle to within "
            "{value} with every lead: `python -m cmacexp.stability` computes it without a long run.",
            no=f"For the paper's rule ({machine}) the linearised loop misses the growth per cycle by up to "
            "{value}: the prediction does not replace a long run.",
            unclear=f"How well the growth per cycle is predicted ({machine}) differs between seeds: {{value}}.",
        )
        for machine in (LEG, WALK)
    },
}
