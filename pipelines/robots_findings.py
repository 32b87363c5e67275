"""What the study of robots asks of its walks: targets, comparisons, and controls that must fail."""

from collections.abc import Callable
from functools import partial
from typing import Any

from cmacexp.metrics.registry import SHOWN
from cmacexp.study import Criterion, Finding, Results, at_least, at_most
from cmacexp.study.samples import growth, quotients, ratio
from cmacexp.study.statements import Limit
from cmacexp.typing import Array
from pipelines.common_results import itself, percent
from pipelines.robots_runs import (
    ALONE,
    ALONE_LIGHT,
    BY_RULE,
    CMAC,
    CMAC_LIGHT,
    DRIFTED,
    EARLY,
    EXACT,
    FEEDFORWARDS,
    GROUND,
    HEAVY,
    ILC,
    JUDGED,
    LEAD,
    LEARNERS,
    LEFT_OUT,
    LONG,
    ON_MODEL,
    OTHERS,
    PLANAR,
    POSTURE_RATE,
    RBF,
    ROBOTS,
    SHORT,
    STARTS,
    TRIED,
    TRIED_FOR,
    WITH_LEAD,
    WITHOUT,
    WITHOUT_LEAD,
)

POSITION, FORCE, JOINTS, TILT = "transfer_rmse", "force_rmse", "joint_rmse", "tilt_max"
SHARE, FEEDBACK = "feedforward_share", "feedback_rms"
WORDS = {POSITION: "transfer", FORCE: "force"}
"""Of their errors."""
FELT = 1.1
"""Factor of an error by which a difference counts."""
LEFT = {POSITION: 0.05, FORCE: 0.25}
"""Largest error over that of feedback only that counts as little, of every robot on every ground: a twentieth of the
transfer error, a quarter of the force error, which contacts keep up in every cycle."""
KINDS = (ALONE, EXACT, CMAC, ILC, RBF, ALONE_LIGHT, HEAVY, ON_MODEL, CMAC_LIGHT)
"""All feedforwards; the last four on a lighter robot."""
OVER_ALONE = "{} over that of feedback only"


def last(results: Results, name: str) -> Array:
    """(runs,): a metric of the last planned cycle; the worst value of a run that ended before."""
    return results.end(name, cycles=1)


def judged(results: Results, name: str, kind: str, cycle: int = JUDGED) -> Array:
    """(runs,): a metric with one feedforward: of one that learns in a cycle, of others in their last."""
    own = results.select(kind=kind)
    return own.at(cycle, name) if kind in LEARNERS else last(own, name)


def compared(name: str, kind: str, other: str, cycle: int = JUDGED) -> Callable[[Results], Array]:
    """A sample: a metric with one feedforward over that with another, seed by seed."""
    return lambda results: quotients(judged(results, name, kind, cycle), judged(results, name, other, cycle))


def _each(
    criterion: Callable[..., Criterion], words: str, sample: Any, limit: Limit, part: str = FEEDFORWARDS, **of: Any
) -> list[Criterion]:
    """A criterion for each robot, with one limit for all of them."""
    return [criterion(words, sample, limit, of={"part": part, "robot": robot} | of, case=robot) for robot in ROBOTS]


def _at_end(name: str, limit: Limit, kind: str = CMAC) -> list[Criterion]:
    """A criterion of a metric of every robot when learners are compared."""
    shown = SHOWN[name]
    criterion = partial(Criterion, unit=shown.unit, scale=shown.factor)
    return _each(criterion, shown.title, partial(judged, name=name, kind=kind), limit, kind=kind)


def _beside(name: str, *kinds: str, part: str = FEEDFORWARDS) -> list[Criterion]:
    """What a ratio is made of: the metric itself of every robot."""
    return [
        itself(SHOWN[name].title, name, partial(judged, name=name, kind=kind), f"{robot}, {kind}",
               {"part": part, "robot": robot, "kind": kind})
        for robot in ROBOTS
        for kind in kinds
    ]  # fmt: skip


def _left(name: str, kind: str, part: str = FEEDFORWARDS) -> list[Criterion]:
    """What is left of an error of feedback only on every robot, and both errors."""
    alone = ALONE_LIGHT if kind in (HEAVY, ON_MODEL) else ALONE
    words = OVER_ALONE.format(f"{WORDS[name]} error")
    ratios = _each(percent, words, compared(name, kind, alone), at_most(LEFT[name]), part, kind=[kind, alone])
    return [*ratios, *_beside(name, alone, kind, part=part)]


def _position(kind: str) -> Finding:
    return Finding(
        _at_end(POSITION, at_most(0.5e-3), kind),
        says=f"With “{kind}” the transfer error of every robot is at most 0.5 mm",
    )


def _force(kind: str) -> Finding:
    return Finding(
        _left(FORCE, kind),
        says=f"With “{kind}” the force error of every robot is at most a quarter of that with feedback only",
    )


def _beats_model(name: str) -> Finding:
    words = f"{WORDS[name]} error over that with the nominal model"
    return Finding(
        [*_each(percent, words, compared(name, CMAC, EXACT), at_most(1.0)), *_beside(name, EXACT, CMAC)],
        says=f"On every robot the {WORDS[name]} error with the CMAC is below that with the nominal model",
    )


def _on_rigid(name: str) -> Finding:
    words = f"{100 * LEFT[name]:g} % of that with feedback only"
    return Finding(
        _left(name, CMAC, GROUND),
        says=f"On the rigid floor learning lowers the {WORDS[name]} error of every robot to at most {words}",
    )


def _felt(name: str) -> Finding:
    """Whether a part of the method is worth its while; a walk that falls without it has an infinite error."""

    force = partial(Results.at, cycle=TRIED_FOR, name=FORCE)
    whole, without = {"part": STARTS, "period": BY_RULE}, {"part": LEFT_OUT, "without": name}
    words = f"force error of cycle {TRIED_FOR}"
    return Finding(
        [
            Criterion(f"{words} without it, over that with every part", ratio(force, without, whole),
                      at_least(FELT), of={"part": [STARTS, LEFT_OUT], "robot": TRIED}),
            *(itself(words, FORCE, force, case, {**of, "robot": TRIED})
              for case, of in (("with every part", whole), ("without it", without))),
        ],
        says=f"The part “{name}” of the method lowers the force error",
    )  # fmt: skip


def _growth(results: Results) -> Array:
    """(runs,): feedback torque of the last cycle over that of the cycle in which learners are compared."""
    return growth(last(results, FEEDBACK), results.at(JUDGED, FEEDBACK))


def _grows(lead: str, limit: Limit) -> list[Criterion]:
    torque, own = partial(itself, "feedback torque", FEEDBACK), {"part": LEAD, "lead": lead}
    return [
        Criterion(f"feedback torque of cycle {DRIFTED} over that of cycle {JUDGED}", _growth, limit, of=own),
        torque(partial(Results.at, cycle=JUDGED, name=FEEDBACK), f"cycle {JUDGED}", own),
        torque(partial(last, name=FEEDBACK), f"cycle {DRIFTED}", own),
    ]


def _completed(**of: Any) -> list[Criterion]:
    return [percent("walks that complete", lambda results: results.completed, at_least(0.7), of=of)]


def _planar() -> list[Criterion]:
    """Force error with the rate of the load over that without, in the last cycle, and both errors."""
    with_rate, without = {"force_control.load_rate": True}, {"force_control.load_rate": False}
    force, own = partial(last, name=FORCE), {"part": PLANAR}
    return [
        Criterion("force error with the rate of the load over that without", ratio(force, with_rate, without),
                  at_most(1.0), of=own),
        *(itself("force error", FORCE, force, case, own | of)
          for case, of in (("with the rate", with_rate), ("without it", without))),
    ]  # fmt: skip


FINDINGS = {
    "completed": Finding(
        [
            percent("walks that complete", lambda results: results.completed, at_least(0.7), case=kind,
                    part=FEEDFORWARDS, kind=kind)
            for kind in KINDS
        ],
        says="With every feedforward at least 70 % of the walks complete",
    ),
    **{f"position_{kind}": _position(kind) for kind in (ALONE, EXACT, HEAVY, CMAC, ON_MODEL, ILC, RBF)},
    **{f"force_{kind}": _force(kind) for kind in (EXACT, HEAVY, CMAC, ON_MODEL, ILC, RBF)},
    "position_left": Finding(
        _left(POSITION, CMAC),
        says="With the CMAC the transfer error of every robot is at most 5 % of that with feedback "
            "only",
    ),
    "posture": Finding(
        [*_at_end(JOINTS, at_most(1e-3)), *_at_end(TILT, at_most(1e-3))],
        says="With the CMAC the joint error and the tilt of the trunk are at most 1 mrad on every "
            "robot",
    ),
    "share": Finding(
        _each(percent, "feedforward over all torque", partial(judged, name=SHARE, kind=CMAC), at_least(0.95)),
        says="The CMAC provides at least 95 % of the torque on every robot",
    ),
    "better_position": _beats_model(POSITION),
    "better_force": _beats_model(FORCE),
    "on_model": Finding(
        [
            criterion
            for name, what in WORDS.items()
            for criterion in _each(
                Criterion, f"{what} error of cycle {EARLY} over that of the CMAC without a model",
                compared(name, ON_MODEL, CMAC_LIGHT, EARLY), at_most(FELT),
            )
        ],
        says=f"By cycle {EARLY}, a CMAC on the wrong model is as accurate as a CMAC without one on "
            "every robot",
    ),
    "lasts": Finding(
        _completed(part=STARTS, period=SHORT),
        says=f"Sampled every millisecond, walks from disturbed starts complete {LONG} cycles",
    ),
    "lasts_by_rule": Finding(
        _completed(part=STARTS, period=BY_RULE),
        says=f"With the sampling period by rule, walks from disturbed starts complete {LONG} cycles",
    ),
    "further": Finding(
        _completed(part=OTHERS),
        says="The other robots walk with the same rule, with feedback only and with the CMAC",
    ),
    "rigid_position": _on_rigid(POSITION),
    "rigid_force": _on_rigid(FORCE),
    **{f"felt_{name}": _felt(name) for name in WITHOUT},
    "falls": Finding(
        [
            percent("planned time walked", lambda results: results.measure("walked"), at_most(0.9), part=LEFT_OUT,
                    without=POSTURE_RATE)
        ],
        says="Without the posture rate the robot falls while it learns",
    ),
    "grows": Finding(
        _grows(WITHOUT_LEAD, at_least(FELT)),
        says="Without lead the feedback torque grows again",
    ),
    "holds": Finding(
        _grows(WITH_LEAD, at_most(FELT)),
        says="With a lead of one sample the feedback torque stays low",
    ),
    "planar": Finding(
        _planar(),
        says="The rate of the load lowers the force error of the paper's planar quadruped as well",
    ),
}  # fmt: skip
