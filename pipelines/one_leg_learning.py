"""One leg learns to step and to press (Lin & Song 1997, sections 4 and 5, Fig. 7 to 13).

``python -m pipelines.one_leg_learning`` runs ``scenario=one_leg`` as published, then with a force ramp, without the
1/K_ap of eq. 13, on a smooth path, with an exact model instead of a CMAC, and for many more cycles.
"""

from functools import partial
from itertools import pairwise

import numpy as np

from cmacexp.metrics.registry import SHOWN
from cmacexp.recording.run_view import RunView
from cmacexp.report.run_figures import draw_over_cycle, draw_torques, draw_tracking
from cmacexp.study import Array, Declared, Results, compute_growth, declare, draw, of_completed
from pipelines import one_leg_learning_trace as trace

PUBLISHED, SMOOTH = "as published", "smooth path, without 1/K_ap"
EXACT = {PUBLISHED: [], SMOOTH: ["gait.vertical=two_cubics", "reference=aware"]}
VARIANTS = {
    PUBLISHED: [],
    "force ramp": ["gait.load_ramp=0.2"],
    "without 1/K_ap": ["reference=aware"],
    SMOOTH: EXACT[SMOOTH],
}
LAWS = {"as published (lead 0)": ["learning.lead=0"], "one sample earlier (lead 1)": ["learning.lead=1"]}
PAPER = {"variant": PUBLISHED, "feedforward": "cmac"}
ERRORS = {
    "transfer_rmse_x": "in x in transfer",
    "transfer_rmse_y": "in y in transfer",
    "support_rmse_x": "in x in support",
    "force_rmse": "force, RMS",
    "force_steady_state_error": "force, steady state",
}


WEIGHT = trace.in_cycle(1, trace.weight_at_foot)


def values(results: Results) -> Declared:
    """Return the cycles in which the long runs ended, and the measures of statics that the page shows."""
    statics = ("depth", "bias", "weight", "statics", "weightless")
    return {
        "ended": ", ".join(map(str, results.select(law=next(iter(LAWS))).cycles)),
        **{name: results.select(PAPER).measure(name)[0] for name in statics},
    }


def _view(results: Results, *cycles: int) -> RunView:
    """Return a view of some cycles of the run from which the paper's figures are drawn."""
    run = results.select(PAPER).run
    return RunView(run, run.read_trace(cycles))


LESS: Declared = {"limit": "at most 100 %", "opposite": "at least 100 %", "of": PAPER}
MORE: Declared = {"limit": "at least 100 %", "opposite": "at most 100 %", "of": PAPER}
STAYS = {"limit": "at most 1.1", "opposite": "at least 2"}
"""Limits of a final value relative to its least: it stayed bounded, and the opposite."""
RAMP = {**LESS, "quantity": "with a force ramp over that with a step, cycle 5",
"of": {**PAPER, "variant": "force ramp"},
        "over": {"variant": PUBLISHED}}  # fmt: skip


def find_largest_rise(results: Results) -> Array:
    """Return the largest ratio of feedback's torque share to that of the previous cycle, up to cycle 5, (runs,)."""
    shares = [1 - results.at(cycle, "feedforward_share") for cycle in range(1, 6)]
    return np.max([compute_growth(late, early) for early, late in pairwise(shares)], axis=0)


def find_rise_of_feedback(results: Results) -> Array:
    """Return the RMS feedback torque of the last cycles relative to its least, (runs,)."""
    return compute_growth(results.end("feedback_rms"), results.measure("least_feedback"))


def _compare(limits: Declared, cycle: int, before: int, *names: str) -> list[Declared]:
    """Return criteria of the errors ``names`` in ``cycle`` relative to those in cycle ``before``."""
    return [
        {"quantity": f"error in cycle {cycle} over that in cycle {before}", "case": ERRORS[name],
         "value": lambda runs, name=name: compute_growth(abs(runs.at(cycle, name)), abs(runs.at(before, name))),
         "of": PAPER, **limits}
        for name in names
    ]  # fmt: skip


RUN: Declared = {"set": ["scenario=one_leg", "record.cycles=[1,2,5]", "cycles=20"], "quick": {"cycles": 6}}
STUDY = declare(
    title="One leg learns to step and to press",
    question="What does a CMAC learn on one leg that steps and presses, and what errors remain?",
    runs=[
        {**RUN, "over": {"variant": VARIANTS}, "seeds": True},
        {**RUN, "set": [*RUN["set"], "feedforward=inverse_dynamics"], "over": {"variant": EXACT}},
        {"set": ["scenario=one_leg", "cycles=250", "record.cycles=[5,100]"], "over": {"law": LAWS}, "seeds": True,
         "quick": {"cycles": 12, "record.cycles": [5, 12]}},
    ],
    measures={
        "peak_x": trace.in_cycle(1, partial(trace.peak_error, axis="x", extent="stroke")),
        "peak_y": trace.in_cycle(1, partial(trace.peak_error, axis="y", extent="lift")),
        "weight": WEIGHT,
        "statics": lambda run: trace.feedback_force(run.config, WEIGHT(run)),
        "weightless": lambda run: trace.feedback_force(run.config, 0.0),
        "depth": lambda run: trace.reference_depth(run.config),
        "bias": lambda run: trace.learned_error(run.config),
        "least_feedback": lambda run: np.nanmin(run.pooled["feedback_rms"]),
        "largest_share": lambda run: np.nanmax(run.pooled["feedforward_share"]),
        "oscillation_second": trace.in_cycle(2, trace.force_oscillation),
        "oscillation_fifth": trace.in_cycle(5, trace.force_oscillation),
        "torque_oscillation": trace.in_cycle(5, trace.torque_oscillation),
        "torque_step": trace.in_cycle(5, trace.torque_step),
    },
    claims={
        "large_errors": {
            "words": "with feedback alone there are fairly large position control errors in both the X and Y "
            "directions",
            "where": "section 5, Fig. 10",
            "criteria": [
                {"quantity": "largest error in transfer, cycle 1", "of": PAPER,
                 "value": partial(Results.measure, name=f"peak_{axis}"), "case": f"in {axis}, over the {extent}",
                 "limit": "at least 5 %", "opposite": "at most 1 %"}
                for axis, extent in (("x", "stroke"), ("y", "lift"))
            ],
        },
        "errors_vanish": {
            "words": "with CMAC (after 12 s of learning) the position errors during the transfer phase are virtually "
            "eliminated, without increasing the gains",
            "where": "section 5, Fig. 11",
            "criteria": _compare({"limit": "at most 10 %", "opposite": "at least 50 %"}, 5, 1, *list(ERRORS)[:2]),
        },
        "force_of_feedback": {
            "words": "with feedback alone the foot force goes to 1.1 N, then decreases to approximately 0.9 N",
            "where": "section 5, Fig. 12",
            "criteria": [
                {"quantity": "force in support, cycle 1", "value": value, "of": PAPER, "case": case, "limit": limit}
                for value, case, limit in (
                    (lambda runs: (1 + runs.at(1, "force_overshoot")) * runs.value("force_control.desired_force"),
                     "largest", "1.05 to 1.15 N"),
                    (lambda runs: runs.at(1, "force_settled"), "mean of the second half", "0.85 to 0.95 N"),
                )
            ],
        },
        "some_improvement": {
            "words": "as CMAC is applied in the second cycle, some improvement of the force can be observed",
            "where": "section 5, Fig. 12",
            "criteria": _compare(LESS, 2, 1, "force_rmse", "force_steady_state_error"),
        },
        "below_5_percent": {
            "words": "in the second cycle the steady-state error of the force is reduced to less than 5 %",
            "where": "section 5, Fig. 12",
            "quantity": "size of the steady-state error, cycle 2", "of": PAPER,
            "value": lambda runs: abs(runs.at(2, "force_steady_state_error")), "limit": "at most 5 %",
        },
        "force_is_steady": {
            "words": "in the second cycle the foot force remains relatively steady during the support phase",
            "where": "section 5, Fig. 12",
            "quantity": "standard deviation over mean of the force in the second half of support, cycle 2",
            "value": lambda runs: compute_growth(runs.at(2, "force_ripple"), runs.at(2, "force_settled")),
            "of": PAPER, "limit": "at most 2 %",
            "opposite": "at least 10 %",
        },
        "more_oscillation": {
            "words": "in the fifth cycle the foot forces show more oscillations than in the second",
            "where": "section 5, Fig. 12",
            "quantity": "RMS of the force around its mean over 0.2 s, from 0.2 s after touch-down on, cycle 5 over "
            "cycle 2",
            "value": lambda runs: compute_growth(
                runs.measure("oscillation_fifth"), runs.measure("oscillation_second")
            ), **MORE,
        },
        "more_learning": {
            "words": "in the fifth cycle more learning does not bring better performance; the steady-state error has "
            "increased",
            "where": "section 5, Fig. 12",
            "criteria": _compare(MORE, 5, 2, "force_rmse", "force_steady_state_error"),
        },
        "torque_oscillates": {
            "words": "the learning torques oscillate where the torque function has abrupt changes, for example where "
            "the foot force jumps from 0 to 1 N, and are relatively smooth during the support phase",
            "where": "section 5, Fig. 13",
            "quantity": "RMS of joint 1's feedforward torque around its mean over 0.1 s, in the 0.3 s after "
            "touch-down over mid support, cycle 5",
            "value": lambda runs: runs.measure("torque_oscillation"), "of": PAPER, "limit": "at least 3",
            "opposite": "at most 1",
        },
        "major_part": {
            "words": "CMAC provides the major part of the overall control torques",
            "where": "section 5, Fig. 13",
            "quantity": "feedforward over all torque, both joints, cycle 5", "of": PAPER,
            "value": lambda runs: runs.at(5, "feedforward_share"), "limit": "at least 50 %",
            "opposite": "at most 50 %",
        },
        "ramp_is_milder": {
            "words": "if the force is a ramp rather than a step, the change of torques is expected to be less "
            "drastic",
            "where": "section 5",
            **RAMP, "value": lambda runs: runs.measure("torque_step"),
            "case": "largest change of joint 1's torque in a sample at touch-down",
        },
        "ramp_is_learned_better": {
            "words": "if the force is a ramp rather than a step, CMAC probably provides better approximation",
            "where": "section 5",
            "criteria": [
                {**RAMP, "value": lambda runs: runs.at(5, "feedback_rms"), "case": "RMS feedback torque"},
                {**RAMP, "value": lambda runs: 1 - runs.at(5, "feedforward_share"),
                 "case": "feedback over all torque"},
            ],
        },
        "all_improve": {
            "words": "CMAC improves force control and position control, in the free space and in the compliant space",
            "where": "section 5",
            "criteria": _compare(LESS, 5, 1, *list(ERRORS)[:4]),
        },
        "feedback_fades": {
            "words": "as CMAC progresses in learning, the share of feedback in the control output decreases",
            "where": "section 4",
            "criteria": [
                {"quantity": "share of feedback over that in the cycle before, largest up to cycle 5",
                 "value": find_largest_rise, **LESS},
                {"quantity": "share of feedback over the last cycles of the long run over its least", **STAYS,
                 "value": lambda runs: compute_growth(
                     1 - runs.end("feedforward_share"), 1 - runs.measure("largest_share")
                 ), "of": {"law": "as published (lead 0)"}},
            ],
        },
        "law_converges": {
            "words": "the learning law is convergent, and the learning control system has complete stability",
            "where": "section 4",
            "quantity": "RMS feedback torque over the last cycles of the long run over its least",
            "value": find_rise_of_feedback, "of": {"law": "as published (lead 0)"}, **STAYS,
        },
    },
    findings={
        "eliminated_later": {
            "says": "By the end of the run both position errors are virtually eliminated",
            "criteria": [
                {"quantity": "RMS error in the last cycles over that in cycle 1",
                 "value": lambda runs, name=name: compute_growth(abs(runs.end(name)), abs(runs.at(1, name))),
                 "of": PAPER, "case": ERRORS[name], "limit": "at most 10 %"}
                for name in list(ERRORS)[:2]
            ],
        },
        "statics": {
            "says": "Statics with the weight of the leg give the force at which feedback only settles",
            "quantity": "difference of the settled force from statics", "of": PAPER,
            "value": lambda runs: abs(
                compute_growth(runs.at(1, "force_settled"), runs.measure("statics")) - 1
            ), "limit": "at most 2 %",
        },
        "bias": {
            "says": "The force error that learning leaves is the bias of eq. 13, and `reference=aware` removes it",
            "criteria": [
                {"quantity": "difference of the final force error from the bias of eq. 13",
                 "value": lambda runs: abs(
                     compute_growth(runs.end("force_steady_state_error"), runs.measure("bias")) - 1
                 ), "of": PAPER, "limit": "at most 5 %"},
                {"quantity": "size of the final force error without the term",
                 "value": lambda runs: abs(runs.end("force_steady_state_error")),
                 "of": {**PAPER, "variant": "without 1/K_ap"}, "limit": "at most 0.5 %"},
            ],
        },
        "lead": {
            "says": "With a lead of one sample the feedback torque stays at its least",
            "quantity": "RMS feedback torque over the last cycles over its least",
            "value": find_rise_of_feedback, "of": {"law": "one sample earlier (lead 1)"},
            "limit": "at most 1.1",
        },
        **{
            f"{name}_{time}": {
                "says": f"On the {path}, the CMAC has overtaken exact inverse dynamics in y {when}",
                "quantity": f"RMS error in y in transfer {when}: CMAC over exact inverse dynamics", "value": value,
                "of": {"feedforward": "cmac", "variant": variant}, "over": {"feedforward": "inverse_dynamics"},
                "limit": "at most 1",
            }
            for name, path, variant in (
                ("published", "path as published", PUBLISHED), ("smooth", "smooth path", SMOOTH),
            )
            for time, when, value in (
                ("early", "in cycle 5", lambda runs: runs.at(5, "transfer_rmse_y")),
                ("late", "over the last cycles", lambda runs: runs.end("transfer_rmse_y")),
            )
        },
    },
    figures={
        "fig_07": lambda results: trace.trajectory(results.select(PAPER).run),
        **{
            name: lambda results, more=more: trace.motion(results.select(PAPER).run, *more)
            for name, more in (("fig_08", (1, "velocity", "m/s")), ("fig_09", (2, "acceleration", "m/s²")))
        },
        "fig_10": lambda results: draw_tracking(_view(results, 1))[0].figure,
        "fig_11": lambda results: draw_tracking(_view(results, 5))[0].figure,
        "fig_12": lambda results: draw(draw_over_cycle(_view(results, 1, 2, 5), "force", [1])),
        "fig_13": lambda results: draw_torques(_view(results, 5)).figure,
        "bias": {"metric": "force_steady_state_error", "by": "variant",
                 "of": {"feedforward": "cmac", "variant": [PUBLISHED, "without 1/K_ap"]}},
        "growth": [
            {"metric": name, "by": "law", "of": {"law": [*LAWS]}, "log": None}
            for name in ("feedback_rms", "transfer_rmse_x")
        ],
    },
    tables={
        f"errors_{cycle}": {
            "rows": "variant", "of": {"feedforward": "cmac", "variant": [*VARIANTS]},
            "columns": of_completed({
                f"{SHOWN[name].title}, {SHOWN[name].unit}": partial(
                    lambda runs, cycle, name: SHOWN[name].factor * runs.at(cycle, name), cycle=cycle, name=name
                )
                for name in (*ERRORS, "feedback_rms", "feedforward_share")
            }),
        }
        for cycle in (1, 2, 5)
    },
    values=values,
)  # fmt: skip
