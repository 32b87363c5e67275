"""One leg learns to step and to press (Lin & Song 1997, sections 4 and 5, Fig. 7 to 13).

``python -m pipelines.one_leg_learning`` runs ``scenario=one_leg`` as the paper does, then with a force ramp, without
the 1/K_ap of eq. 13, on a smooth path, with an exact model instead of a CMAC, and for far more cycles.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from cmacexp.data.run import Run
from cmacexp.metrics.registry import SHOWN
from cmacexp.study import (
    Claim,
    Criterion,
    DataFrame,
    Figure,
    Finding,
    Request,
    Results,
    Study,
    at_least,
    at_most,
    between,
    draw,
    grid,
)
from cmacexp.study.curves import over_cycles
from cmacexp.study.statements import Limit
from cmacexp.typing import Array
from pipelines import one_leg_learning_trace as trace
from pipelines.common_results import draw_cycles, percent
from pipelines.one_leg_learning_trace import CYCLES, FIFTH, FIRST, SECOND

RAMP = 0.2
"""Time over which the foot takes its desired force, s."""
PUBLISHED, RAMPED, AWARE, SMOOTH = "as published", "force ramp", "without 1/K_ap", "smooth path, without 1/K_ap"
VARIANTS = {
    PUBLISHED: (),
    RAMPED: (f"gait.load_ramp={RAMP}",),
    AWARE: ("reference=aware",),
    SMOOTH: ("gait.vertical=two_cubics", "reference=aware"),
}
NO_LEAD, LEAD = "as published (lead 0)", "one sample earlier (lead 1)"
LAWS = {NO_LEAD: ("learning.lead=0",), LEAD: ("learning.lead=1",)}
CMAC, EXACT = {"feedforward": "cmac"}, {"feedforward": "inverse_dynamics"}
PAPER = {"variant": PUBLISHED, **CMAC}
ERRORS = {
    "transfer_rmse_x": "in x in transfer",
    "transfer_rmse_y": "in y in transfer",
    "support_rmse_x": "in x in support",
    "force_rmse": "force, RMS",
    "force_steady_state_error": "force, steady state",
}
LESS, MORE = at_most(1.0), at_least(1.0)
ELIMINATED = at_most(0.10)
"""Position errors over those of the first cycle: virtually eliminated."""
AT_ITS_LEAST, GROWN = at_most(1.1), at_least(2.0)
"""A value at the end over its least: it stayed there, and the opposite."""


def runs(quick: bool) -> list[Request]:
    """The paper's run and what differs from it, an exact model on two paths, and long runs with and without lead."""
    shown = f"record.cycles=[{','.join(map(str, CYCLES))}]"
    short = ("scenario=one_leg", f"cycles={6 if quick else 20}", shown)
    late = f"record.cycles=[{FIFTH},{12 if quick else 100}]"
    long = ("scenario=one_leg", f"cycles={12 if quick else 250}", late)
    exact = {name: VARIANTS[name] for name in (PUBLISHED, SMOOTH)}
    return [
        *grid(*short, over={"variant": VARIANTS}, seeded=True),
        *grid(*short, "feedforward=inverse_dynamics", over={"variant": exact}),
        *grid(*long, over={"law": LAWS}, seeded=True),
    ]


MEASURES = {
    "peak_x": trace.in_cycle(FIRST, trace.peak_error("x", "stroke")),
    "peak_y": trace.in_cycle(FIRST, trace.peak_error("y", "lift")),
    "force_peak": trace.in_cycle(FIRST, trace.force_peak),
    "weight": trace.in_cycle(FIRST, trace.weight_at_foot),
    "oscillation_second": trace.in_cycle(SECOND, trace.force_oscillation),
    "oscillation_fifth": trace.in_cycle(FIFTH, trace.force_oscillation),
    "torque_oscillation": trace.in_cycle(FIFTH, trace.torque_oscillation),
    "torque_step": trace.in_cycle(FIFTH, trace.torque_step),
    "lift_off_late": trace.in_last_recorded(trace.feedback_at_lift_off),
}


def final_share(results: Results) -> Array:
    """(runs,): feedback's share over the last cycles over its least; of a run that ended before it is all."""
    least = [1.0 - np.nanmax(history) for history in results.history("feedforward_share")]
    return (1.0 - results.end("feedforward_share")) / least


def final_feedback(results: Results) -> Array:
    """(runs,): RMS feedback torque over the last cycles over its least; infinite if a run ended before."""
    return results.end("feedback_rms") / [np.nanmin(history) for history in results.history("feedback_rms")]


def _statics_deviation(results: Results) -> Array:
    """Settled force of the first cycle against statics with the leg's weight, relative."""
    expected = [trace.feedback_force(results.run.config, weight) for weight in results.measure("weight")]
    return np.abs(results.at(FIRST, "force_settled") / expected - 1.0)


def _bias_deviation(results: Results) -> Array:
    """Force error over the last cycles against that of the statics of eq. 13, relative."""
    return np.abs(results.end("force_steady_state_error") / trace.learned_error(results.run.config) - 1.0)


of_paper = partial(percent, of=PAPER)


def _compare(name: str, cycle: int, before: int, holds: Limit, fails: Limit) -> Criterion:
    """An error in one cycle over that in another."""
    words, sample = (
        f"error in cycle {cycle} over that in cycle {before}",
        f"abs({name}[{cycle}]) / abs({name}[{before}])",
    )
    return of_paper(words, sample, holds, fails, case=ERRORS[name])


def _ramp_over_step(quantity: str, sample: str) -> Criterion:
    """What the runs with a force ramp give over those with a step."""
    words = f"with a force ramp over that with a step, cycle {FIFTH}"
    return percent(words, sample, LESS, MORE, {"variant": RAMPED, **CMAC}, quantity, {"variant": PUBLISHED})


FEEDBACK_SHARES = [f"(1 - feedforward_share[{cycle}])" for cycle in range(FIRST, FIFTH + 1)]
LARGEST_RISE = f"max({', '.join(f'{late} / {early}' for early, late in pairwise(FEEDBACK_SHARES))})"
"""Feedback's share in a cycle over that in the cycle before, the largest up to the fifth cycle."""
CLAIMS = {
    "large_errors": Claim(
        "with feedback alone there are fairly large position control errors in both the X and Y directions",
        "section 5, Fig. 10",
        [
            of_paper(f"largest error in transfer, cycle {FIRST}", f"peak_{axis}", at_least(0.05),
                     at_most(0.01), case=f"in {axis}, over the {extent}")
            for axis, extent in (("x", "stroke"), ("y", "lift"))
        ],
    ),
    "errors_vanish": Claim(
        "with CMAC (after 12 s of learning) the position errors during the transfer phase are virtually eliminated, "
        "without increasing the gains",
        "section 5, Fig. 11",
        [_compare(f"transfer_rmse_{axis}", FIFTH, FIRST, ELIMINATED, at_least(0.5)) for axis in ("x", "y")],
    ),
    "force_of_feedback": Claim(
        "with feedback alone the foot force goes to 1.1 N, then decreases to approximately 0.9 N",
        "section 5, Fig. 12",
        [
            Criterion(f"force in support, cycle {FIRST}", "force_peak", between(1.05, 1.15),
                      unit="N", of=PAPER, case="largest"),
            Criterion(f"force in support, cycle {FIRST}", f"force_settled[{FIRST}]",
                      between(0.85, 0.95), unit="N", of=PAPER, case="mean of the second half"),
        ],
    ),
    "some_improvement": Claim(
        "as CMAC is applied in the second cycle, some improvement of the force can be observed",
        "section 5, Fig. 12",
        [_compare(name, SECOND, FIRST, LESS, MORE) for name in ("force_rmse", "force_steady_state_error")],
    ),
    "below_5_percent": Claim(
        "in the second cycle the steady-state error of the force is reduced to less than 5 %",
        "section 5, Fig. 12",
        [of_paper(f"size of the steady-state error, cycle {SECOND}", f"abs(force_steady_state_error[{SECOND}])",
                  at_most(0.05))],
    ),
    "force_is_steady": Claim(
        "in the second cycle the foot force remains relatively steady during the support phase",
        "section 5, Fig. 12",
        [of_paper(f"standard deviation over mean of the force in the second half of support, cycle {SECOND}",
                  f"force_ripple[{SECOND}] / force_settled[{SECOND}]", at_most(0.02), at_least(0.1))],
    ),
    "more_oscillation": Claim(
        "in the fifth cycle the foot forces show more oscillations than in the second",
        "section 5, Fig. 12",
        [of_paper(f"RMS of the force around its mean over {trace.FORCE_WINDOW:g} s, from {trace.LANDED:g} s after "
                  f"touch-down on, cycle {FIFTH} over cycle {SECOND}",
                  "oscillation_fifth / oscillation_second", MORE, LESS)],
    ),
    "more_learning": Claim(
        "in the fifth cycle more learning does not bring better performance; the steady-state error has increased",
        "section 5, Fig. 12",
        [_compare(name, FIFTH, SECOND, MORE, LESS) for name in ("force_rmse", "force_steady_state_error")],
    ),
    "torque_oscillates": Claim(
        "the learning torques oscillate where the torque function has abrupt changes, for example where "
        "the foot force jumps from 0 to 1 N, and are relatively smooth during the support phase",
        "section 5, Fig. 13",
        [Criterion(f"RMS of joint 1's feedforward torque around its mean over {trace.TORQUE_WINDOW:g} s, in the "
                   f"{trace.EVENT:g} s after touch-down over mid support, cycle {FIFTH}",
                   "torque_oscillation", at_least(3.0), at_most(1.0), of=PAPER)],
    ),
    "major_part": Claim(
        "CMAC provides the major part of the overall control torques",
        "section 5, Fig. 13",
        [of_paper(f"feedforward over all torque, both joints, cycle {FIFTH}", f"feedforward_share[{FIFTH}]",
                  at_least(0.5), at_most(0.5))],
    ),
    "ramp_is_milder": Claim(
        "if the force is a ramp rather than a step, the change of torques is expected to be less drastic",
        "section 5",
        [_ramp_over_step("largest change of joint 1's torque in a sample at touch-down", "torque_step")],
    ),
    "ramp_is_learned_better": Claim(
        "if the force is a ramp rather than a step, CMAC probably provides better approximation",
        "section 5",
        [
            _ramp_over_step("RMS feedback torque", f"feedback_rms[{FIFTH}]"),
            _ramp_over_step("feedback over all torque", f"1 - feedforward_share[{FIFTH}]"),
        ],
    ),
    "all_improve": Claim(
        "CMAC improves force control and position control, in the free space and in the compliant space",
        "section 5",
        [_compare(name, FIFTH, FIRST, LESS, MORE) for name in list(ERRORS)[:4]],
    ),
    "feedback_fades": Claim(
        "as CMAC progresses in learning, the share of feedback in the control output decreases",
        "section 4",
        [
            of_paper(f"share of feedback over that in the cycle before, largest up to cycle {FIFTH}",
                     LARGEST_RISE, LESS, MORE),
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


def _versus_exact(variant: str, when: str, sample: str) -> Finding:
    path = "path as published" if variant == PUBLISHED else "smooth path"
    return Finding(
        [Criterion(f"RMS error in y in transfer {when}: CMAC over exact inverse dynamics",
                   sample, LESS, of={"variant": variant, **CMAC}, over=EXACT)],
        says=f"On the {path}, the CMAC has overtaken exact inverse dynamics in y {when}",
    )  # fmt: skip


IN_FIFTH = (f"in cycle {FIFTH}", f"transfer_rmse_y[{FIFTH}]")
AT_END = ("over the last cycles", "transfer_rmse_y")
FINDINGS = {
    "eliminated_later": Finding(
        [of_paper(f"RMS error in the last cycles over that in cycle {FIRST}", f"abs({name}) / abs({name}[{FIRST}])",
                  ELIMINATED, case=ERRORS[name])
         for name in ("transfer_rmse_x", "transfer_rmse_y")],
        says="By the end of the run both position errors are virtually eliminated",
    ),
    "statics": Finding(
        [of_paper("difference of the settled force from statics", _statics_deviation, at_most(0.02))],
        says="Statics with the weight of the leg give the force at which feedback only settles",
    ),
    "bias": Finding(
        [
            of_paper("difference of the final force error from the bias of eq. 13", _bias_deviation, at_most(0.05)),
            percent("size of the final force error without the term", "abs(force_steady_state_error)",
                    at_most(0.005), of=CMAC, variant=AWARE),
        ],
        says="The force error that learning leaves is the bias of eq. 13, and `reference=aware` "
            "removes it",
    ),
    "lead": Finding(
        [Criterion("RMS feedback torque over the last cycles over its least", final_feedback, AT_ITS_LEAST,
                   of={"law": LEAD})],
        says="With a lead of one sample the feedback torque stays at its least",
    ),
    "lift_off": Finding(
        [percent(f"share of the squared feedback torque in the {trace.SWING_START:g} s after lift-off, in the last "
                 "cycle that was recorded", "lift_off_late", at_least(0.5), law=NO_LEAD)],
        says="Late in the run as published most of the squared feedback torque falls just after "
            "lift-off",
    ),
    "published_early": _versus_exact(PUBLISHED, *IN_FIFTH),
    "published_late": _versus_exact(PUBLISHED, *AT_END),
    "smooth_early": _versus_exact(SMOOTH, *IN_FIFTH),
    "smooth_late": _versus_exact(SMOOTH, *AT_END),
}  # fmt: skip


def draw_bias(results: Results) -> Figure:
    """Force error with and without the 1/K_ap of eq. 13, and what statics predict."""
    own = results.select(CMAC, variant=[PUBLISHED, AWARE])
    predicted = 100.0 * trace.learned_error(own.run.config)
    panel = over_cycles(own, "force_steady_state_error", "variant", title="steady-state error of the force")
    return draw([replace(panel, y_limits=[0.0, predicted])])


def errors_table(results: Results) -> DataFrame:
    """Errors and torques in the paper's cycles, mean over seeds."""
    import pandas as pd

    own = results.select(PAPER)
    shown = {name: SHOWN[name] for name in (*ERRORS, "feedback_rms", "feedforward_share")}
    return pd.DataFrame(
        {"cycle": cycle}
        | {f"{each.title}, {each.unit}": each.factor * own.at(cycle, name).mean() for name, each in shown.items()}
        for cycle in CYCLES
    )


def values(results: Results) -> dict[str, Any]:
    """What the page says of settings and statics."""
    paper, published = results.select(PAPER), results.select(law=NO_LEAD)
    config, weight = paper.run.config, float(paper.measure("weight")[0])
    return {
        "first": FIRST, "second": SECOND, "fifth": FIFTH, "ramp": RAMP, "band": 100.0 * trace.BAND,
        "long": published.value("cycles"), "ended": ", ".join(map(str, published.cycles)),
        "depth": 1e3 * trace.reference_depth(config), "bias": 100.0 * trace.learned_error(config), "weight": weight,
        "statics": trace.feedback_force(config, weight), "weightless": trace.feedback_force(config, 0.0),
    }  # fmt: skip


def _of_first_seed(drawing: Callable[[Run], Figure]) -> Callable[[Results], Figure]:
    return lambda results: drawing(results.select(PAPER).run)


STUDY = Study(
    title="One leg learns to step and to press",
    question="What does a CMAC learn on one leg that steps and presses, and what errors remain?",
    runs=runs,
    measures=MEASURES,
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "one_leg": _of_first_seed(trace.glance),
        "fig_07": _of_first_seed(trace.trajectory),
        "fig_08": _of_first_seed(partial(trace.motion, order=1, name="velocity", unit="m/s")),
        "fig_09": _of_first_seed(partial(trace.motion, order=2, name="acceleration", unit="m/s²")),
        "fig_10": _of_first_seed(partial(trace.tracking, cycle=FIRST)),
        "fig_11": _of_first_seed(partial(trace.tracking, cycle=FIFTH)),
        "fig_12": _of_first_seed(trace.forces),
        "fig_13": _of_first_seed(trace.torques),
        "bias": draw_bias,
        "growth": lambda r: draw_cycles(r.select(law=list(LAWS)), ("feedback_rms", "transfer_rmse_x"), by="law"),
    },
    tables={"errors": errors_table},
    values=values,
)
