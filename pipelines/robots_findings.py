"""What the study of robots asks of its walks: targets, comparisons, and controls that must fail."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from cmacexp.metrics.registry import SHOWN
from cmacexp.study import Criterion, Finding, Results, at_least, at_most
from cmacexp.study.statements import Limit
from cmacexp.typing import Array
from pipelines.common_results import percent
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
FELT = 1.1
"""Factor of an error by which a difference counts."""
FORCE_LEFT = dict.fromkeys(ROBOTS, 0.25) | {"Mini Cheetah": 0.35, "HyQReal1": 0.30}
"""Largest force error that counts as far below that of feedback alone, over the latter."""
LEFT_ON_RIGID = {
    POSITION: dict.fromkeys(ROBOTS, 0.05) | {"HyQReal1": 0.1},
    FORCE: dict.fromkeys(ROBOTS, 0.7) | {"HyQReal1": 0.9},
}
"""Likewise on a rigid floor, of position and of force."""
OVER_ALONE = "{} over that of feedback alone"


def last(results: Results, name: str) -> Array:
    """(runs,): a metric of the last planned cycle; the worst value of a run that ended before."""
    return results.end(name, cycles=1)


def judged(results: Results, name: str, kind: str, cycle: int = JUDGED) -> Array:
    """(runs,): a metric with one feedforward: of one that learns in a cycle, of others in their last."""
    own = results.select(kind=kind)
    return own.at(cycle, name) if kind in LEARNERS else last(own, name)


def over(values: Array, others: Array) -> Array:
    """Quotients; infinite where a value is itself, that of a walk that fell."""
    values, others = np.broadcast_arrays(values, others)
    return np.divide(values, others, out=np.full(values.shape, np.inf), where=np.isfinite(values))


def compared(name: str, kind: str, other: str, cycle: int = JUDGED) -> Callable[[Results], Array]:
    """A sample: a metric with one feedforward over that with another, seed by seed."""
    return lambda results: over(judged(results, name, kind, cycle), judged(results, name, other, cycle))


def _each(
    criterion: Callable[..., Criterion], words: str, sample: Any, limits: Mapping[str, Limit], **of: Any
) -> list[Criterion]:
    """A criterion for each robot that has a limit."""
    return [
        criterion(words, sample, limit, of={"part": FEEDFORWARDS, "robot": robot} | of, case=robot)
        for robot, limit in limits.items()
    ]


def _every(limit: Limit) -> dict[str, Limit]:
    return dict.fromkeys(ROBOTS, limit)


def _up_to(limits: Mapping[str, float]) -> dict[str, Limit]:
    return {robot: at_most(limit) for robot, limit in limits.items()}


def _at_end(name: str, limit: Limit, kind: str = CMAC) -> list[Criterion]:
    """A criterion of a metric of every robot when learners are compared."""
    shown = SHOWN[name]
    criterion = partial(Criterion, unit=shown.unit, scale=shown.factor)
    return _each(criterion, shown.title, partial(judged, name=name, kind=kind), _every(limit), kind=kind)


def _position(kind: str) -> Finding:
    return Finding(
        _at_end(POSITION, at_most(0.5e-3), kind),
        yes=f"With “{kind}” the feet of every robot follow their paths within 0.5 mm.",
        no=f"With “{kind}” the feet of some robots leave their paths by more than 0.5 mm.",
    )


def _force(kind: str) -> Finding:
    alone = ALONE_LIGHT if kind in (HEAVY, ON_MODEL) else ALONE
    words, sample = OVER_ALONE.format("force error"), compared(FORCE, kind, alone)
    return Finding(
        _each(percent, words, sample, _up_to(FORCE_LEFT), kind=[kind, alone]),
        yes=f"With “{kind}” the force error of every robot is far below that of feedback alone.",
        no=f"With “{kind}” much of the force error of feedback alone is left on some robots.",
    )


def _beats_model(name: str, robots: Mapping[str, Limit], what: str) -> Finding:
    where = (
        " and ".join(robots) if len(robots) == 1 else "every robot" if len(robots) == len(ROBOTS) else "light robots"
    )
    return Finding(
        _each(percent, f"{what} error over that of the exact model", compared(name, CMAC, EXACT), robots),
        yes=f"On {where}, the {what} error of CMAC is below that of the exact model.",
        no=f"On {where}, the {what} error of CMAC can be above that of the exact model.",
    )


def _on_rigid(name: str, what: str) -> Finding:
    words, sample = OVER_ALONE.format(f"{what} error"), compared(name, CMAC, ALONE)
    return Finding(
        _each(percent, words, sample, _up_to(LEFT_ON_RIGID[name]), part=GROUND),
        yes=f"On the rigid floor learning lowers the {what} error of every robot.",
        no=f"On the rigid floor learning leaves some robots a {what} error above its limit.",
    )


def _felt(name: str) -> Finding:
    """Whether a part of the method is worth its while; a walk that falls without it has an infinite error."""

    def sample(results: Results) -> Array:
        whole = results.select(part=STARTS, period=BY_RULE)
        return over(results.select(part=LEFT_OUT, without=name).at(TRIED_FOR, FORCE), whole.at(TRIED_FOR, FORCE))

    words = f"force error of cycle {TRIED_FOR} without it, over that with every part"
    return Finding(
        [Criterion(words, sample, at_least(FELT), of={"part": [STARTS, LEFT_OUT], "robot": TRIED})],
        yes=f"The part “{name}” of the method lowers the force error.",
        no=f"The part “{name}” of the method hardly changes the force error, or raises it.",
    )


def growth(results: Results) -> Array:
    """(runs,): feedback torque of the last cycle over that of the cycle in which learners are compared."""
    return over(last(results, FEEDBACK), results.at(JUDGED, FEEDBACK))


def _grows(lead: str, limit: Limit) -> list[Criterion]:
    words = f"feedback torque of cycle {DRIFTED} over that of cycle {JUDGED}"
    return [Criterion(words, growth, limit, of={"part": LEAD, "lead": lead})]


def _completed(**of: Any) -> list[Criterion]:
    return [percent("walks that complete", lambda results: results.completed, at_least(0.7), of=of)]


def _planar(results: Results) -> Array:
    """(seeds,): force error with the rate of the load over that without, in the last cycle."""
    with_rate, without = (last(results.select({"force_control.load_rate": on}), FORCE) for on in (True, False))
    return over(with_rate, without)


FINDINGS = {
    **{f"position_{kind}": _position(kind) for kind in (ALONE, EXACT, HEAVY, CMAC, ON_MODEL, ILC, RBF)},
    **{f"force_{kind}": _force(kind) for kind in (EXACT, HEAVY, CMAC, ON_MODEL, ILC, RBF)},
    "position_left": Finding(
        _each(percent, OVER_ALONE.format("transfer error"), compared(POSITION, CMAC, ALONE), _every(at_most(0.05))),
        yes="CMAC leaves little of the transfer error of feedback alone.",
        no="CMAC leaves much of the transfer error of feedback alone on some robots.",
    ),
    "posture": Finding(
        [*_at_end(JOINTS, at_most(1e-3)), *_at_end(TILT, at_most(1e-3))],
        yes="Errors of joints and tilt of the trunk are small on every robot with CMAC.",
        no="Errors of joints or tilt of the trunk are large on some robots with CMAC.",
    ),
    "share": Finding(
        _each(percent, "share of the feedforward", partial(judged, name=SHARE, kind=CMAC), _every(at_least(0.95))),
        yes="CMAC takes over nearly all of the torque on every robot.",
        no="On some robots feedback still gives much of the torque beside CMAC.",
    ),
    "better_position": _beats_model(POSITION, _every(at_most(1.0)), "transfer"),
    "better_force": _beats_model(FORCE, {r: at_most(1.0) for r in ROBOTS if r != "HyQReal1"}, "force"),
    "heavy_force": _beats_model(FORCE, {"HyQReal1": at_most(1.0)}, "force"),
    "on_model": Finding(
        [
            criterion
            for name, what in ((POSITION, "transfer"), (FORCE, "force"))
            for criterion in _each(
                Criterion, f"{what} error of cycle {EARLY} over that of CMAC alone",
                compared(name, ON_MODEL, CMAC_LIGHT, EARLY), _every(at_most(FELT)),
            )
        ],
        yes=f"By cycle {EARLY}, CMAC on the wrong model is as accurate as CMAC alone on every robot.",
        no=f"By cycle {EARLY}, CMAC on the wrong model is less accurate than CMAC alone on some robots.",
    ),
    "lasts": Finding(
        _completed(part=STARTS, period=SHORT),
        yes=f"Sampled every millisecond, walks from disturbed starts last {LONG} cycles.",
        no=f"Sampled every millisecond, some walks from disturbed starts end before {LONG} cycles.",
    ),
    "lasts_by_rule": Finding(
        _completed(part=STARTS, period=BY_RULE),
        yes=f"With the sampling period by rule, walks from disturbed starts last {LONG} cycles, too.",
        no=f"With the sampling period by rule, some walks from disturbed starts end before {LONG} cycles.",
    ),
    "further": Finding(
        _completed(part=OTHERS),
        yes="The other robots walk with the same rule, alone and with CMAC.",
        no="Some of the other robots fall with the same rule.",
    ),
    "rigid_position": _on_rigid(POSITION, "transfer"),
    "rigid_force": _on_rigid(FORCE, "force"),
    **{f"felt_{name}": _felt(name) for name in WITHOUT},
    "falls": Finding(
        [
            percent("planned time walked", lambda results: results.measure("walked"), at_most(0.9), part=LEFT_OUT,
                    without=POSTURE_RATE)
        ],
        yes="Without the posture rate the robot falls while it learns.",
        no="Without the posture rate the robot keeps walking while it learns.",
    ),
    "grows": Finding(
        _grows(WITHOUT_LEAD, at_least(FELT)),
        yes="Without lead the feedback torque grows again.",
        no="Without lead the feedback torque stays low.",
    ),
    "holds": Finding(
        _grows(WITH_LEAD, at_most(FELT)),
        yes="With a lead of one sample the feedback torque stays low.",
        no="With a lead of one sample the feedback torque grows again, too.",
    ),
    "planar": Finding(
        [Criterion("force error with the rate of the load over that without", _planar, at_most(1.0),
                   of={"part": PLANAR}, case="planar quadruped")],
        yes="The rate of the load lowers the force error of the paper's planar quadruped as well.",
        no="The rate of the load raises the force error of the paper's planar quadruped.",
    ),
}  # fmt: skip
