"""The paper's walk with a body that has mass: the quadruped in MuJoCo, with friction under its feet.

``python -m pipelines.dynamic_body`` (needs the extra ``mujoco``). Lin & Song 1997 balance the body in every instant;
here it floats. The study walks with the paper's constants, then makes the changes of
``conf/for_plant/mujoco_quadruped.yaml`` one after the other, leaves out one at a time, and walks for long from
disturbed starts.
"""

from functools import partial
from typing import Any

import numpy as np

from cmacexp.cli.study import main
from cmacexp.study import Criterion, Finding, Results, Study, at_least, at_most, between
from cmacexp.typing import Array
from pipelines import dynamic_body_views as views
from pipelines.dynamic_body_views import QUANTITIES, last
from pipelines.dynamic_body_walks import (
    ALL,
    CMAC,
    COMPARED,
    COMPENSATOR,
    FEEDBACK,
    FEEDFORWARD,
    FINER,
    LEADLESS,
    LEADS,
    NAMED,
    NAMES,
    NONE,
    SAMPLING,
    runs,
    without,
)

WHOLE = 0.9
"""Share of the planned time from which a walk counts as walked to the end."""
BETTER_FORCE, BETTER_SLOW = 0.45, 0.35
"""Force error over that of feedback alone that counts as much smaller: whole, and slower than CUT_OFF."""
GOOD = {"transfer_rmse_x": 3e-3, "transfer_rmse_y": 1.5e-3, "tilt_max": 0.01, "off_course": 0.05}
"""Largest errors of a walk that has learnt, SI units."""
FELT, ALIKE, LASTS = 1.1, 0.1, 0.7
"""Factor of the force error by which a difference counts; largest relative difference between starts that counts as
none; share of walks that has to complete."""
WITH, WITHOUT = LEADS
FORCE = "force_rmse_cycle"
EVERY, LEFT_OUT = {"part": "left out", "walk": ALL}, {"part": "left out", "feedforward": CMAC}
STARTS = {"part": "starts", "walk": WITH}


def _decide(topic: str, yes: str, no: str, *criteria: Criterion) -> Finding:
    """A finding whether ``topic`` is so."""
    return Finding(criteria, yes, no, f"The runs do not decide whether {topic} (measured: {{value}}).")


def _walks(words: str, **of: Any) -> Finding:
    """Whether walks last."""
    share = Criterion(
        "planned time walked", lambda r: r.measure("walked"), at_least(WHOLE), unit="%", scale=100.0, of=of
    )
    return _decide(
        f"the machine walks to the end {words}",
        f"The machine walks to the end {words}.",
        f"The machine does not walk to the end {words}: it lasts {{value}} of the planned time.",
        share,
    )


def _over_feedback(name: str, holds: Any, **of: Any) -> Criterion:
    """A metric or measure of the last cycle over that of feedback alone on the same plan."""

    def sample(results: Results) -> Array:
        kinds = results.by("feedforward")
        ratio: Array = last(kinds[CMAC], name) / last(kinds[FEEDBACK], name)
        return ratio

    return Criterion(f"{QUANTITIES[name].title} over that of feedback alone", sample, holds, of=of)


def _limited(name: str, limit: float, **of: Any) -> Criterion:
    """A metric or measure of the last cycle itself."""
    shown = QUANTITIES[name]
    sample = partial(last, name=name)
    return Criterion(shown.title, sample, at_most(limit), unit=shown.unit, scale=shown.factor, of=of)


def _ratio(words: str, key: str, one: str, other: str, holds: Any, name: str = FORCE, **of: Any) -> Criterion:
    """A metric or measure of the last cycle where a setting has one value, over that where it has another."""

    def sample(results: Results) -> Array:
        ratio: Array = last(results.select({key: one}), name) / last(results.select({key: other}), name)
        return ratio

    return Criterion(words, sample, holds, of=of)


def _felt(name: str) -> Finding:
    words = f"force error of cycle {COMPARED} without it, over that with all changes"
    what, ratio = NAMED[name], "the error without it, over that with all changes, is {value}"
    return _decide(
        f"the {what} lowers the force error of cycle {COMPARED}",
        f"The {what} lowers the force error of cycle {COMPARED}: {ratio}.",
        f"The {what} does not clearly lower the force error of cycle {COMPARED}: {ratio}.",
        _ratio(words, "walk", without(name), ALL, at_least(FELT), **LEFT_OUT),
    )


def _growth(results: Results) -> Array:
    """(starts,): force error of the last cycle over that of the cycle in which the changes are compared."""
    growth: Array = last(results, FORCE) / results.at(COMPARED, FORCE)
    return growth


def _difference(results: Results) -> list[float]:
    """The largest difference between the starts' force errors in the last cycle, over their median."""
    errors = last(results, FORCE)
    return [float(np.ptp(errors) / np.median(errors)) if np.isfinite(errors).all() else np.inf]


FINDINGS = {
    "published_feedforward": _walks(
        "with a feedforward and the paper's sampling and LEAD compensator", part="published", variant=FEEDFORWARD
    ),
    "published_feedback": _walks("with the paper's constants and feedback alone", part="published", variant=FEEDBACK),
    "published_finer": _decide(
        "finer steps of integration change how long feedback alone walks",
        "Finer steps of integration do not change how long feedback alone walks.",
        "Finer steps of integration change how long feedback alone walks: {value} times as long.",
        _ratio(
            "time walked in finer steps over that in coarse ones", "variant", FINER, FEEDBACK,
            between(1.0 / FELT, FELT), "walked", part="published",
        ),
    ),
    "sampling": _walks("sampled faster, all other constants as published", part="published", variant=SAMPLING),
    "compensator": _walks(
        "with a weaker LEAD compensator, all other constants as published", part="published", variant=COMPENSATOR
    ),
    "none_path": _decide(
        "learning improves foot positions without the changes",
        "Without the changes learning improves foot positions: {values[0]} times the error of feedback alone in x, "
        "{values[1]} times in y.",
        "Without the changes learning does not improve foot positions: {values[0]} times the error of feedback alone "
        "in x, {values[1]} times in y.",
        *(_over_feedback(f"transfer_rmse_{axis}", at_most(1.0), part="made", walk=NONE) for axis in "xy"),
    ),
    "none_force": _decide(
        "learning improves contact forces without the changes",
        "Without the changes learning improves contact forces: {value} times the error of feedback alone.",
        "Without the changes learning makes contact forces worse or ends the walk: {value} times the error of "
        "feedback alone.",
        _over_feedback(FORCE, at_most(1.0), part="made", walk=NONE),
    ),
    "faster": _walks("at the paper's learning rate without the changes", part="faster"),
    "all_force": _decide(
        "learning makes contact forces much better with all changes",
        "With all changes learning makes contact forces much better: {values[0]} times the error of feedback alone, "
        f"and {{values[1]}} times its part below {views.CUT_OFF:g} Hz.",
        "Even with all changes learning does not make contact forces much better: {values[0]} times the error of "
        f"feedback alone, and {{values[1]}} times its part below {views.CUT_OFF:g} Hz.",
        _over_feedback(FORCE, at_most(BETTER_FORCE), **EVERY),
        _over_feedback("slow_force", at_most(BETTER_SLOW), **EVERY),
    ),
    "all_path": _decide(
        "foot positions, tilt and course are good with all changes",
        "With all changes foot positions, tilt and course are good: errors of {values[0]} in x and {values[1]} in y, "
        "tilt {values[2]}, distance walked {values[3]} off the plan.",
        "Even with all changes foot positions, tilt and course are not all good: errors of {values[0]} in x and "
        "{values[1]} in y, tilt {values[2]}, distance walked {values[3]} off the plan.",
        *(_limited(name, limit, **EVERY, feedforward=CMAC) for name, limit in GOOD.items()),
    ),
    **{f"felt_{name}": _felt(name) for name in NAMES},
    "starts_last": _decide(
        "what is learnt lasts",
        "What is learnt lasts: {values[0]} of the walks complete, and the force error ends at {values[1]} times that "
        f"of cycle {COMPARED}.",
        "What is learnt does not last in every respect: {values[0]} of the walks complete, and the force error ends "
        f"at {{values[1]}} times that of cycle {COMPARED}.",
        Criterion("walks that complete", lambda r: r.completed, at_least(LASTS), unit="%", scale=100.0, of=STARTS),
        Criterion(f"force error at the end over that of cycle {COMPARED}", _growth, at_most(FELT), of=STARTS),
        _limited("off_course", GOOD["off_course"], **STARTS),
    ),
    "starts_alike": _decide(
        "the start makes much difference",
        "The start makes little difference: force errors at the end differ by at most {value} of their median.",
        "The start makes a difference: force errors at the end differ by up to {value} of their median.",
        Criterion("largest difference", _difference, at_most(ALIKE), unit="%", scale=100.0, of=STARTS),
    ),
    "starts_lead": _decide(
        "lead lowers the force error of a long walk",
        "Lead lowers the force error of a long walk: without it, it is {value} times as large at the end.",
        "Lead does not lower the force error of a long walk: without it, it is {value} times as large at the end.",
        _ratio(
            "force error without lead over that with it", "walk", WITHOUT, WITH, at_least(FELT), part="starts",
            start=LEADLESS,
        ),
    ),
}  # fmt: skip


def values(results: Results) -> dict[str, Any]:
    """Settings that the page names."""
    published, all_changes = results.select(part="published"), results.select(part="left out", walk=ALL)
    learning, starts = all_changes.select(feedforward=CMAC), results.select(STARTS)
    return {
        "cycles": learning.value("cycles"),
        "mass": learning.value("machine.body_mass"),
        "paper_period": 1e3 * published.run.config["sampling_period"],
        "paper_alpha": published.run.config["controller"]["lead_alpha"],
        "period": 1e3 * learning.value("sampling_period"),
        "alpha": learning.value("controller.lead_alpha"),
        "cut_off": views.CUT_OFF,
        "settled": all_changes.select(feedforward=FEEDBACK).value("cycles"),
        "starts": len(starts),
        "leadless": len(results.select(part="starts", walk=WITHOUT)),
        "long": starts.value("cycles"),
        "spread": starts.value("plant.start_spread"),
        "yaw": float(starts.measure("yaw").max()),
    }


STUDY = Study(
    title="A body with mass",
    question="Does the quadruped walk when its body floats, and which settings let learning improve contact forces "
    "as well as positions?",
    runs=runs,
    measures=views.MEASURES,
    findings=FINDINGS,
    figures={
        "ladder": views.draw_ladder, "learning": views.draw_learning, "foot": views.draw_foot,
        "starts": views.draw_starts,
    },
    tables={"published": views.table_published, "walks": views.table_walks},
    values=values,
)  # fmt: skip

if __name__ == "__main__":
    main(__file__)
