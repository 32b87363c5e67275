"""What Lin & Song 1997 claim of one leg (sections 4, 5), and what the study of one leg asks besides."""

from collections.abc import Callable
from typing import Any

import numpy as np

from cmacexp.study import Claim, Criterion, Finding, Results, at_least, at_most, between
from cmacexp.study.statements import Limit
from cmacexp.typing import Array
from pipelines.one_leg_learning_measures import (
    EVENT,
    FORCE_WINDOW,
    LANDED,
    SWING_START,
    TORQUE_WINDOW,
    feedback_force,
    learned_error,
)

FIRST, SECOND, FIFTH = CYCLES = (1, 2, 5)
"""Cycles that the paper shows."""
PUBLISHED, RAMPED, AWARE, SMOOTH = "as published", "force ramp", "without 1/K_ap", "smooth path, without 1/K_ap"
NO_LEAD, LEAD = "as published (lead 0)", "one sample earlier (lead 1)"
CMAC, EXACT = {"feedforward": "cmac"}, {"feedforward": "inverse_dynamics"}
PAPER = {"variant": PUBLISHED, **CMAC}
ERRORS = {
    "transfer_rmse_x": "RMS error in x in transfer",
    "transfer_rmse_y": "RMS error in y in transfer",
    "support_rmse_x": "RMS error in x in support",
    "force_rmse": "RMS force error",
    "force_steady_state_error": "steady-state error of the force",
}
LESS, MORE = at_most(1.0), at_least(1.0)
ELIMINATED, LEFT = at_most(0.10), at_least(0.5)
"""Position errors over those of the first cycle: virtually eliminated, and the opposite."""
AT_ITS_LEAST, GROWN = at_most(1.1), at_least(2.0)
"""A value at the end over its least: it stayed there, and the opposite."""
Sample = Callable[[Results], Array]


def measure(name: str) -> Sample:
    """A measure of the study."""
    return lambda results: results.measure(name)


def at(cycle: int, name: str) -> Sample:
    """The size of a metric in one cycle."""
    return lambda results: np.abs(results.at(cycle, name))


def end(name: str) -> Sample:
    """The size of a metric over the last cycles."""
    return lambda results: np.abs(results.end(name))


def over(top: Sample, bottom: Sample) -> Sample:
    """The ratio of two samples, seed by seed."""
    return lambda results: top(results) / bottom(results)


def within(settings: dict[str, Any], sample: Sample) -> Sample:
    """A sample of the runs with these settings alone."""
    return lambda results: sample(results.select(settings))


def feedback_share(cycle: int) -> Sample:
    """Feedback over feedforward and feedback, absolute torques, in one cycle."""
    return lambda results: 1.0 - results.at(cycle, "feedforward_share")


def largest_rise_of_share(results: Results) -> Array:
    """(runs,): feedback's share in a cycle over that in the cycle before, the largest up to the fifth cycle."""
    shares = np.array([feedback_share(cycle)(results) for cycle in range(FIRST, FIFTH + 1)])
    rise: Array = (shares[1:] / shares[:-1]).max(axis=0)
    return rise


def final_share(results: Results) -> Array:
    """(runs,): feedback's share over the last cycles over its least; of a run that ended before it is all."""
    least = np.array([1.0 - np.nanmax(history) for history in results.history("feedforward_share")])
    ratios: Array = (1.0 - results.end("feedforward_share")) / least
    return ratios


def final_feedback(results: Results) -> Array:
    """(runs,): RMS feedback torque over the last cycles over its least; infinite if a run ended before."""
    least = np.array([np.nanmin(history) for history in results.history("feedback_rms")])
    ratios: Array = results.end("feedback_rms") / least
    return ratios


def statics_deviation(results: Results) -> Array:
    """(runs,): settled force of the first cycle against statics with the leg's weight, relative."""
    expected = np.array([feedback_force(results.run.config, weight) for weight in results.measure("weight")])
    deviation: Array = np.abs(results.at(FIRST, "force_settled") / expected - 1.0)
    return deviation


def bias_deviation(results: Results) -> Array:
    """(runs,): force error over the last cycles against that of the statics of eq. 13, relative."""
    deviation: Array = np.abs(results.end("force_steady_state_error") / learned_error(results.run.config) - 1.0)
    return deviation


def percent(
    quantity: str, sample: Sample, holds: Limit, fails: Limit | None = None, of: dict[str, Any] = PAPER
) -> Criterion:
    """A criterion in per cent."""
    return Criterion(quantity, sample, holds, fails, unit="%", scale=100.0, of=of)


def compare(name: str, cycle: int, before: int, holds: Limit, fails: Limit) -> Criterion:
    """An error in one cycle over that in another."""
    words = f"{ERRORS[name]}, cycle {cycle} over cycle {before}"
    return percent(words, over(at(cycle, name), at(before, name)), holds, fails)


def ramp_over_step(quantity: str, sample: Sample) -> Criterion:
    """What the runs with a force ramp give over those with a step."""
    ratio = over(within({"variant": RAMPED}, sample), within(PAPER, sample))
    return percent(
        f"{quantity}, cycle {FIFTH}, ramp over step", ratio, LESS, MORE, of={"variant": [PUBLISHED, RAMPED]}
    )


CLAIMS = {
    "large_errors": Claim(
        "with feedback alone there are fairly large position control errors in both the X and Y directions",
        "section 5, Fig. 10",
        [
            percent(f"largest error in x in transfer, cycle {FIRST}, over the stroke", measure("peak_x"),
                    at_least(0.05), at_most(0.01)),
            percent(f"largest error in y in transfer, cycle {FIRST}, over the lift", measure("peak_y"),
                    at_least(0.05), at_most(0.01)),
        ],
    ),
    "errors_vanish": Claim(
        "with CMAC (after 12 s of learning) the position errors during the transfer phase are virtually eliminated, "
        "without increasing the gains",
        "section 5, Fig. 11",
        [compare(f"transfer_rmse_{axis}", FIFTH, FIRST, ELIMINATED, LEFT) for axis in ("x", "y")],
    ),
    "force_of_feedback": Claim(
        "with feedback alone the foot force goes to 1.1 N, then decreases to approximately 0.9 N",
        "section 5, Fig. 12",
        [
            Criterion(f"largest force in support, cycle {FIRST}", measure("force_peak"), between(1.05, 1.15),
                      unit="N", of=PAPER),
            Criterion(f"mean force in the second half of support, cycle {FIRST}", at(FIRST, "force_settled"),
                      between(0.85, 0.95), unit="N", of=PAPER),
        ],
    ),
    "some_improvement": Claim(
        "as CMAC is applied in the second cycle, some improvement of the force can be observed",
        "section 5, Fig. 12",
        [compare(name, SECOND, FIRST, LESS, MORE) for name in ("force_rmse", "force_steady_state_error")],
    ),
    "below_5_percent": Claim(
        "in the second cycle the steady-state error of the force is reduced to less than 5 %",
        "section 5, Fig. 12",
        [percent(f"size of the steady-state error, cycle {SECOND}", at(SECOND, "force_steady_state_error"),
                 at_most(0.05))],
    ),
    "force_is_steady": Claim(
        "in the second cycle the foot force remains relatively steady during the support phase",
        "section 5, Fig. 12",
        [percent(f"standard deviation over mean of the force in the second half of support, cycle {SECOND}",
                 over(at(SECOND, "force_ripple"), at(SECOND, "force_settled")), at_most(0.02), at_least(0.1))],
    ),
    "more_oscillation": Claim(
        "in the fifth cycle the foot forces show more oscillations than in the second",
        "section 5, Fig. 12",
        [percent(f"RMS of the force around its mean over {FORCE_WINDOW:g} s, from {LANDED:g} s after touch-down on, "
                 f"cycle {FIFTH} over cycle {SECOND}",
                 over(measure("oscillation_fifth"), measure("oscillation_second")), MORE, LESS)],
    ),
    "more_learning": Claim(
        "in the fifth cycle more learning does not bring better performance; the steady-state error has increased",
        "section 5, Fig. 12",
        [compare(name, FIFTH, SECOND, MORE, LESS) for name in ("force_rmse", "force_steady_state_error")],
    ),
    "torque_oscillates": Claim(
        "the learning torques oscillate where the torque function has abrupt changes, for example where "
        "the foot force jumps from 0 to 1 N, and are relatively smooth during the support phase",
        "section 5, Fig. 13",
        [Criterion(f"RMS of joint 1's feedforward torque around its mean over {TORQUE_WINDOW:g} s, in the {EVENT:g} "
                   f"s after touch-down over mid support, cycle {FIFTH}", measure("torque_oscillation"),
                   at_least(3.0), at_most(1.0), of=PAPER)],
    ),
    "major_part": Claim(
        "CMAC provides the major part of the overall control torques",
        "section 5, Fig. 13",
        [percent(f"feedforward over all torque, both joints, cycle {FIFTH}", at(FIFTH, "feedforward_share"),
                 at_least(0.5), at_most(0.5))],
    ),
    "ramp_is_milder": Claim(
        "if the force is a ramp rather than a step, the change of torques is expected to be less drastic",
        "section 5",
        [ramp_over_step("largest change of joint 1's torque in a sample at touch-down", measure("torque_step"))],
    ),
    "ramp_is_learned_better": Claim(
        "if the force is a ramp rather than a step, CMAC probably provides better approximation",
        "section 5",
        [
            ramp_over_step("RMS feedback torque", at(FIFTH, "feedback_rms")),
            ramp_over_step("feedback over all torque", feedback_share(FIFTH)),
        ],
    ),
    "all_improve": Claim(
        "CMAC improves force control and position control, in the free space and in the compliant space",
        "section 5",
        [compare(name, FIFTH, FIRST, LESS, MORE) for name in list(ERRORS)[:4]],
    ),
    "feedback_fades": Claim(
        "as CMAC progresses in learning, the share of feedback in the control output decreases",
        "section 4",
        [
            percent(f"share of feedback over that in the cycle before, largest up to cycle {FIFTH}",
                    largest_rise_of_share, LESS, MORE),
            Criterion("share of feedback over the last cycles of the long run over its least", final_share,
                      AT_ITS_LEAST, GROWN, of={"law": NO_LEAD}),
        ],
    ),
    "law_converges": Claim(
        "the learning law is convergent, and the learning control system has complete stability",
        "section 4",
        [Criterion("RMS feedback torque over the last cycles of the long run over its least", final_feedback,
                   AT_ITS_LEAST, GROWN, of={"law": NO_LEAD})],
    ),
}  # fmt: skip


def _versus_exact(variant: str, when: str, sample: Sample) -> Finding:
    ratio = over(within(CMAC, sample), lambda results: sample(results.select(EXACT))[:1])
    path = "path as published" if variant == PUBLISHED else "smooth path"
    words = f"On the {path} the error in y with the CMAC {when} is {{value}} times that with exact inverse dynamics"
    quantity = f"RMS error in y in transfer, CMAC over exact inverse dynamics, {when}"
    return Finding(
        [Criterion(quantity, ratio, LESS, of={"variant": variant})],
        yes=f"{words}: learning has passed the model.",
        no=f"{words}: learning has not passed the model.",
        unclear=f"{words}: the runs do not decide which is smaller.",
    )


FINDINGS = {
    "eliminated_later": Finding(
        [percent(f"{ERRORS[name]}, last cycles over cycle {FIRST}", over(end(name), at(FIRST, name)), ELIMINATED)
         for name in ("transfer_rmse_x", "transfer_rmse_y")],
        yes="By the end of the run both errors are virtually eliminated: {values[0]} in x and {values[1]} in y.",
        no="By the end of the run the errors are not both virtually eliminated: {values[0]} in x, {values[1]} in y.",
        unclear="The runs do not decide whether both errors are virtually eliminated at their end.",
    ),
    "statics": Finding(
        [percent("deviation of the settled force from statics", statics_deviation, at_most(0.02))],
        yes="Statics with the weight of the leg give the force at which feedback alone settles.",
        no="Statics with the weight of the leg do not give the force at which feedback alone settles.",
        unclear="The runs do not decide whether statics give the force at which feedback alone settles.",
    ),
    "bias": Finding(
        [
            percent("deviation of the final force error from the bias of eq. 13", bias_deviation, at_most(0.05)),
            percent("size of the final force error without the term", end("force_steady_state_error"),
                    at_most(0.005), of={"variant": AWARE, **CMAC}),
        ],
        yes="The force error that learning leaves is this bias: it has the predicted size, and without the term the "
        "error is {values[1]}. Use `reference=aware` where the force is to be exact.",
        no="The force error that learning leaves is not this bias, or not this bias alone.",
        unclear="The runs do not decide whether the force error that learning leaves is this bias.",
    ),
    "lead": Finding(
        [Criterion("RMS feedback torque over the last cycles over its least", final_feedback, AT_ITS_LEAST,
                   of={"law": LEAD})],
        yes="With a lead of one sample the feedback torque ends at {value} times its least.",
        no="With a lead of one sample the feedback torque grows again: it ends at {value} times its least.",
        unclear="The runs do not decide whether the feedback torque grows again with a lead of one sample.",
    ),
    "lift_off": Finding(
        [percent(f"share of the squared feedback torque in the {SWING_START:g} s after lift-off, late in the run",
                 measure("lift_off_late"), at_least(0.5), of={"law": NO_LEAD})],
        yes="Late in the run as published most of the squared feedback torque falls just after lift-off.",
        no="Late in the run as published most of the squared feedback torque does not fall just after lift-off.",
        unclear="The runs do not decide whether most of the squared feedback torque falls just after lift-off.",
    ),
    "published_early": _versus_exact(PUBLISHED, f"in cycle {FIFTH}", at(FIFTH, "transfer_rmse_y")),
    "published_late": _versus_exact(PUBLISHED, "over the last cycles", end("transfer_rmse_y")),
    "smooth_early": _versus_exact(SMOOTH, f"in cycle {FIFTH}", at(FIFTH, "transfer_rmse_y")),
    "smooth_late": _versus_exact(SMOOTH, "over the last cycles", end("transfer_rmse_y")),
}  # fmt: skip
