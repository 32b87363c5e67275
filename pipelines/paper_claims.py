"""Claims of Lin & Song 1997 as quantities of a run with limits, for :mod:`pipelines.paper_settings`.

The limits were fixed before the joint search was run, but after the printed numbers and first trials were known. The
figures of the paper are not at hand, only its text: what the text does not say of Fig. 7 to 20 is not used.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from cmacexp.study import Limit, at_least, at_most, between

Values = Mapping[str, float]
"""Measured quantities of a setting, by the names in :mod:`pipelines.paper_measures`; none if a run ended early."""


class Criterion(NamedTuple):
    """A quantity, and the range in which the claim is true."""

    quantity: str
    """Description for readers."""
    value: str
    """Name of the quantity, or two names with ``/`` between them: the ratio of the first to the second."""
    limit: Limit
    unit: str = ""

    def measure(self, values: Values) -> float:
        """Return the quantity from the measured ``values``; NaN if undefined."""
        name, _, reference = self.value.partition("/")
        divisor = values.get(reference, math.nan) if reference else 1.0
        return values.get(name, math.nan) / divisor if divisor else math.nan

    def holds(self, values: Values) -> bool:
        """Return True if the quantity lies in the range; an undefined quantity does not."""
        return self.limit.low <= self.measure(values) <= self.limit.high


class Claim(NamedTuple):
    """A claim in the words of the paper, which is true if all its criteria hold."""

    words: str
    where: str
    criteria: tuple[Criterion, ...]

    def holds(self, values: Values) -> bool:
        """Return True if all criteria hold."""
        return all(criterion.holds(values) for criterion in self.criteria)


def _over(quantity: str, name: str, cycle: int, first: int, limit: Limit) -> Criterion:
    """Return the criterion of a quantity in a cycle relative to that in the cycle ``first``."""
    return Criterion(f"{quantity}, cycle {cycle} over cycle {first}", f"{name}_{cycle}/{name}_{first}", limit)


LEG = {
    "large_errors": Claim(
        "with feedback only there are fairly large position control errors in both the X and Y directions",
        "section 5, Fig. 10",
        (
            Criterion("largest error in x in transfer over the stroke, cycle 1", "peak_x_1", at_least(0.05)),
            Criterion("largest error in y in transfer over the lift, cycle 1", "peak_y_1", at_least(0.05)),
        ),
    ),
    "peak": Claim(
        "with feedback only the foot force goes to 1.1 N",
        "section 5, Fig. 12",
        (Criterion("largest force, cycle 1", "force_peak_1", between(1.05, 1.15), "N"),),
    ),
    "settles": Claim(
        "then it decreases to approximately 0.9 N",
        "section 5, Fig. 12",
        (
            Criterion(
                "mean force in the second half of support, cycle 1", "force_settled_1", between(0.85, 0.95), "N"
            ),
        ),
    ),
    "improves": Claim(
        "with CMAC in cycle 2 some improvement can be observed",
        "section 5, Fig. 12",
        (
            _over("RMS force error", "force_rmse", 2, 1, at_most(1.0)),
            _over("steady-state error of the force", "steady", 2, 1, at_most(1.0)),
        ),
    ),
    "below_5_percent": Claim(
        "the steady-state error is reduced to less than 5 %",
        "section 5, Fig. 12",
        (Criterion("steady-state error of the force, cycle 2", "steady_2", at_most(0.05)),),
    ),
    "steady": Claim(
        "the foot force remains relatively steady during the support phase",
        "section 5, Fig. 12",
        (
            Criterion(
                "standard deviation of the force over its mean, cycle 2", "ripple_2/force_settled_2", at_most(0.02)
            ),
        ),
    ),
    "no_better": Claim(
        "in cycle 5 more learning does not bring better performance",
        "section 5, Fig. 12",
        (_over("RMS force error", "force_rmse", 5, 2, at_least(1.0)),),
    ),
    "oscillates": Claim(
        "the foot forces show more oscillations",
        "section 5, Fig. 12",
        (_over("oscillation of the force", "oscillation", 5, 2, at_least(1.0)),),
    ),
    "error_grows": Claim(
        "and the steady-state error has increased",
        "section 5, Fig. 12",
        (_over("steady-state error of the force", "steady", 5, 2, at_least(1.0)),),
    ),
    "errors_vanish": Claim(
        "after 12 s of learning the position errors during the transfer phase are virtually eliminated",
        "section 5, Fig. 11",
        (
            _over("error in x in transfer", "transfer_x", 5, 1, at_most(0.1)),
            _over("error in y in transfer", "transfer_y", 5, 1, at_most(0.1)),
        ),
    ),
    "all_improve": Claim(
        "CMAC improves force control and position control, in the free space and in the compliant space",
        "section 5",
        (
            _over("error in x in transfer", "transfer_x", 5, 1, at_most(1.0)),
            _over("error in y in transfer", "transfer_y", 5, 1, at_most(1.0)),
            _over("error in x in support", "support_x", 5, 1, at_most(1.0)),
            _over("RMS force error", "force_rmse", 5, 1, at_most(1.0)),
        ),
    ),
}
"""Claims on one leg that the search may use."""
FEEDBACK = ("large_errors", "peak", "settles")
"""Claims on cycle 1, in which the network does not act."""

LEG_APART = {
    "torque_oscillates": Claim(
        "the learning torques oscillate where the torque function has abrupt changes, and are smooth in support",
        "section 5, Fig. 13",
        (
            Criterion(
                "oscillation of the learnt torque at touch-down over mid support",
                "torque_oscillation_5",
                at_least(3.0),
            ),
        ),
    ),
    "major_part": Claim(
        "CMAC provides the major part of the overall control torques",
        "section 5, Fig. 13",
        (Criterion("share of the feedforward in the torque, cycle 5", "share_5", at_least(0.5)),),
    ),
    "feedback_fades": Claim(
        "as CMAC progresses in learning, the share of feedback in the control output decreases",
        "section 4",
        (Criterion("share of feedback over that of the cycle before, largest", "largest_rise", at_most(1.0)),),
    ),
    "ramp_is_milder": Claim(
        "with a ramped force the change of torques is expected to be less drastic",
        "section 5",
        (
            Criterion(
                "largest change of torque at touch-down, ramp over step",
                "ramp_torque_step_5/torque_step_5",
                at_most(1.0),
            ),
        ),
    ),
    "ramp_is_learned_better": Claim(
        "with a ramped force CMAC probably provides better approximation",
        "section 5",
        (Criterion("RMS feedback torque, ramp over step, cycle 5", "ramp_feedback_5/feedback_5", at_most(1.0)),),
    ),
    "response": Claim(
        "an advantage is shorter response time in the feedforward control",
        "section 6.3",
        (
            Criterion(
                "time from the planned lift-off until the foot is free, cycle 5 over 1",
                "release_5/release_1",
                at_most(1.0),
            ),
        ),
    ),
}
"""Claims on one leg that are kept apart from the search, and predicted by the setting that it finds."""

METHODS = ("stiffness", "damping", "combined", "explicit")
MASS = {
    **{
        f"{method}_settles": Claim(
            f"with the reference of {equation} {method} control presses with the desired force in steady state",
            f"section 3, {equation}",
            (Criterion("RMS force error in the second half of the run over F_d", f"rest_{method}", at_most(0.02)),),
        )
        for method, equation in zip(METHODS, ("eq. 9", "eq. 11", "eq. 13", "eq. 15"), strict=True)
    },
    "dashpot": Claim(
        "damping control behaves like a mass-dashpot system: the force is proportional to the velocity",
        "section 3.2, eq. 10",
        (
            Criterion(
                "settled force at twice the reference velocity over that at once", "doubled", between(1.96, 2.04)
            ),
        ),
    ),
    "unstable_gain": Claim(
        "the stiffness/admittance matrix method may become unstable if the gains are not selected properly",
        "section 1",
        (
            Criterion(
                "RMS force error over F_d with 1,000 times P_fn and V_fn, combined control",
                "rest_large_gain",
                at_least(0.1),
            ),
        ),
    ),
    "combined_best": Claim(
        "combined stiffness and damping control provides the best dynamic behaviour",
        "sections 3, 7",
        (
            Criterion(
                "overshoot of combined control over the least of the others",
                "overshoot/other_overshoot",
                at_most(1.0),
            ),
            Criterion("ITAE of combined control over the least of the others", "itae/other_itae", at_most(1.0)),
        ),
    ),
}
"""Claims on the point mass; *others* are the methods that come to rest."""

WALK = {
    "walks": Claim(
        "force/position feedback, posture control, and CMAC provide stable and steady walking",
        "section 6.3",
        (
            Criterion("part of the cycles that are walked", "done", at_least(0.9)),
            Criterion("largest tilt in a cycle at the end", "tilt", at_most(0.02), "rad"),
            Criterion("largest difference from the planned height at the end, over it", "height_off", at_most(0.01)),
        ),
    ),
    "rear": Claim(
        "when foot 3 is lifted the COG remains in the support pattern, and the rear margin is very short",
        "section 6.3, Fig. 17",
        (Criterion("rear margin over the length of the body", "rear", between(0.0, 0.1)),),
    ),
    "late": Claim(
        "immediately after foot 3 touches down F_n1 is not 0; the delay has no adverse effect on stability",
        "section 6.3, Fig. 18",
        (
            Criterion("part of the cycles in which foot 1 carries then", "late", at_least(0.5)),
            Criterion("least margin until foot 1 lifts over the least planned one", "margin_late", at_least(1.0)),
        ),
    ),
    "front": Claim(
        "while foot 2 is still in transfer the COG is close to the front support boundary",
        "section 6.3, Fig. 19",
        (Criterion("front margin over the length of the body", "front", between(0.0, 0.1)),),
    ),
    "restored": Claim(
        "stability is immediately restored by leg 2",
        "section 6.3, Fig. 20",
        (
            Criterion("time from the contact of foot 2 until the margin is restored", "restored", at_most(0.1), "s"),
            Criterion("least front margin after the contact over that before it", "front_gain", at_least(1.0)),
        ),
    ),
    "feedback": Claim(
        "the contribution from the feedback control diminishes",
        "section 6.3",
        (Criterion("share of feedback at the end over that in cycle 2", "feedback_end/feedback_2", at_most(0.8)),),
    ),
    "improves": Claim(
        "learning improves the accuracy of position and force control, also of the quadruped",
        "abstract, section 7",
        tuple(
            Criterion(f"{name} at the end over that without CMAC", f"{key}/{key}_alone", at_most(0.8))
            for key, name in (
                ("transfer_x", "error in x in transfer"),
                ("transfer_y", "error in y in transfer"),
                ("force_three", "force error with three feet down"),
                ("force_cycle", "force error over the whole cycle"),
            )
        ),
    ),
    "wave": Claim(
        "wave gait with a duty factor of 0.8, at least three feet are on the ground",
        "sections 6, 6.1, Fig. 14",
        (
            Criterion("largest difference of a leg's contact from the duty factor", "duty_factor_off", at_most(0.05)),
            Criterion("largest difference of a leg's lifting from the wave, of a cycle", "wave_off", at_most(0.05)),
            Criterion("part of the time in which fewer than three feet carry", "two_feet", at_most(0.0)),
        ),
    ),
}
"""Claims on the quadruped; *at the end* is the median of the last 5 cycles, as of the events."""

WALK_APART = {
    "posture": Claim(
        "foot contact forces depend on the posture, and posture control obtains the desired one",
        "sections 6, 6.2",
        (
            Criterion(
                "part of the cycles that are walked without posture control", "done_without_posture", at_most(0.5)
            ),
        ),
    ),
    "position_only": Claim(
        "on soft terrains position control alone may lose stability",
        "section 1",
        (
            Criterion(
                "part of the cycles that are walked under position control only", "done_position_only", at_most(0.5)
            ),
        ),
    ),
    "duty_factor": Claim(
        "the larger the duty factor, the higher is the effect of the leg dynamics on walking performance",
        "section 6.1",
        (
            Criterion(
                "error in y in transfer without CMAC, duty factor 0.9 over 0.8",
                "transfer_y_duty/transfer_y_alone",
                at_least(1.0),
            ),
        ),
    ),
}
"""Claims on the quadruped that are kept apart from the search."""

NOT_TESTED = {
    "the learning law is convergent, and the system has complete stability": "section 4, a proof of Ref. 12: "
    "one_leg_learning tests it",
    "CMAC learning is robust to collisions": "section 4, of the simulations of others: hashing tests it",
    "improved robustness toward the sensor noises": "section 6.3: quadruped_walking tests it",
    "the smaller P_fn, the stiffer is stiffness control": "section 3.1: force_methods tests it",
    "the objectives of section 2 can be achieved by the LEAD": "section 2: lead_design tests it",
    "when F_n2 = 0 the system is likely to fail": "section 6.3: a machine that falls has a foot without load, so no "
    "test could come out otherwise",
    "the main drawback of other networks is long training time": "section 1: about a network of Ref. 17, not at hand",
    "rolling, pitching and ground depression can be seen in the animation": "section 7: about a program",
}
"""Claims without a criterion here, and where they are tested, or why not."""
