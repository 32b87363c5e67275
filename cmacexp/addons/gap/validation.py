"""The identified plant: chosen by cross-validation, fitted, compared on unseen strokes; what a log does not show.

Learners act on it: what the log predicts of them, and what is obtained, as torque and as tracking.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from cmacexp.addons.gap.analysis import FIRST, Gap, Report, add_learner, compare_rms
from cmacexp.addons.gap.identify import KNOWN, LEVELS, MASS_PRIOR, NAMES, TILT_PRIOR, Fit, Level, Problem, fit
from cmacexp.addons.gap.learners import PLACED, Both, Fixed, Iterative, Learner, Maker, make_tables, place_below
from cmacexp.addons.gap.machine import Expansion
from cmacexp.addons.gap.replay import make_drive
from cmacexp.addons.gap.signals import Signals, differentiate, low_pass
from cmacexp.typing import Array, Mask

IDENTIFIED = "identified, refitted after every second stroke"
ABOVE = "CMAC over phase"
"""Table that is placed above the identified plant, beside ILC."""
SETTLE = 0.2
"""Beginning of a log that does not count: the state of the robot before it is unknown, s."""
CORRELATED = 0.8
"""Correlation with the rotor inertia from which on a delay is not known apart from it."""
ALONE = "desired velocity alone"


def identify(gap: Gap, set_done: Report = lambda done: None) -> None:
    """Choose a model of joints, fit it, validate it on unseen strokes, and let it predict and act."""
    problem, count = gap.problem, gap.signals.count
    inner, train = split_strokes(count)
    chosen, models = choose_level(problem)
    set_done(0.3)
    forward = fit(problem, chosen, rows_of(gap.signals, 1, train))
    reverse = fit(problem, chosen, rows_of(gap.signals, train + 1, count))
    whole = gap.fitted = fit(problem, chosen, rows_of(gap.signals, 1, count), forward.values)
    set_done(0.6)
    for name, own in {"identified": forward, "identified, the reverse": reverse}.items():
        applied = problem.apply(own)
        along = applied.expand(*applied.replay(own.values, own.delay))  # so that the equations hold to all orders
        gap.replays[name], _ = applied.replay(own.values, own.delay, along)
    middle = max(train + 1, count - 1)
    parts = {"before": (1, train), "middle": (train + 1, middle), "last": (count, count), "all": (1, count)}
    gap.values |= {
        "validation": {
            "unit": "mrad",
            "fitted_on": [1, train],
            "reverse_fitted_on": [train + 1, count],
            "choice": {
                "models": models,
                "chosen": chosen.name,
                "fitted_on": [1, inner],
                "scored_on": [inner + 1, train],
            },
            "distance": {
                name: {part: measure_distance(gap.signals, angle, *own) for part, own in parts.items()}
                for name, angle in gap.replays.items()
            },
        },
        "parameters": describe_parameters(problem, whole),
        "masses": {
            problem.machine.find_link(joint)[0]: {"value": value, "deviation": deviation}
            for joint, (value, deviation) in whole.masses.items()
        },
        "delay": {"unit": "s", "value": whole.delay, "deviation": whole.delay_deviation},
        "covariances": [own.tolist() for own in whole.covariances],
        "refused": list(refuse_parameters(problem, whole)),
    }
    for name, make in list_identified(problem, chosen, gap.makers["model"]).items():
        add_learner(gap, name, make)
    gap.values["acting"] = act(gap, whole, forward)


def rows_of(signals: Signals, first: int, last: int) -> Mask:
    """Rows (n,) of strokes ``first`` to ``last``; those before the first stroke, but for SETTLE, belong to it."""
    rows = np.zeros(len(signals.log.time), dtype=bool)
    begin = round(SETTLE / signals.log.period) if first == 1 else int(signals.bounds[first - 1])
    rows[begin : int(signals.bounds[last])] = True
    return rows


def measure_distance(signals: Signals, angle: Array, first: int, last: int) -> float:
    """RMS distance of angles (n, J) from the measured ones in strokes ``first`` to ``last``, mrad."""
    rows = slice(int(signals.bounds[first - 1]), int(signals.bounds[last]))
    return float(1e3 * np.sqrt(((angle - signals.log.angle)[rows] ** 2).mean()))


def split_strokes(count: int) -> tuple[int, int]:
    """The last stroke that models of joints are fitted to, and the last by which they are chosen: 1/3 and 2/3."""
    train = max(2, round(count * 2 / 3))
    return max(1, train // 2), train


def choose_level(problem: Problem) -> tuple[Level, list[dict[str, Any]]]:
    """The model of joints that predicts the second third of the strokes best when fitted to those before; and all."""
    (inner, train), models = split_strokes(problem.signals.count), []
    levels = LEVELS if problem.masses else LEVELS[:-1]
    for level in levels:
        found = fit(problem, level, rows_of(problem.signals, 1, inner))
        angle, _ = problem.apply(found).replay(found.values, found.delay)
        distance = measure_distance(problem.signals, angle, inner + 1, train)
        models.append({"model": level.name, "parameters": int(level.free.sum()), "mrad": distance})
    return min(zip(levels, models, strict=True), key=lambda each: float(each[1]["mrad"]))[0], models  # type: ignore[arg-type]


def describe_parameters(problem: Problem, found: Fit) -> dict[str, Any]:
    """Parameters by joint with their standard errors, and the range over which friction and spring are given."""
    described = {}
    for j, joint in enumerate(problem.signals.log.joints):
        free = [k for k in range(len(NAMES)) if found.level.free[k]]
        described[joint] = {
            NAMES[k]: {"value": float(found.values[j, k]), "deviation": float(found.deviation[j, k])} for k in free
        } | {
            "coulomb_friction": {
                "value": found.values[j, len(NAMES) :].tolist(),
                "deviation": found.deviation[j, len(NAMES) :].tolist(),
            },
            "range": problem.ranges[:, j].tolist(),
        }
    return described


def refuse_parameters(problem: Problem, found: Fit) -> Iterator[str]:
    """What this log does not identify, by name, a sentence each."""
    machine, joints = problem.machine, problem.signals.log.joints
    unknown = {machine.find_link(j)[0]: None for j in range(len(joints)) if j not in problem.masses}
    if unknown:
        limit = 100.0 * KNOWN * MASS_PRIOR
        yield f"masses of {', '.join(unknown)}: beside the joints they are not known to {limit:.0f} %"
    if (error := problem.tilt_error) > KNOWN * TILT_PRIOR:
        yield f"tilt of the base: its standard error is {np.degrees(error):.1f} degrees"
    strongest = found.delay_correlation[np.abs(found.delay_correlation).argmax()]
    if abs(strongest) > CORRELATED:
        yield f"delay apart from rotor inertia: their correlation is up to {strongest:.2f}"
    for j, joint in enumerate(joints):
        for k, name in enumerate(NAMES[:2]):
            if found.deviation[j, k] > max(found.values[j, k], 1e-9):
                yield f"{name.replace('_', ' ')} of {joint}: its standard error exceeds its value"
        if found.deviation[j, len(NAMES) :].max() > found.values[j, len(NAMES) :].mean():
            yield f"Coulomb friction of {joint}: its standard error exceeds its mean"


class Identified:
    """The plant fitted to the strokes so far, anew after every second one; until then the torque of a model.

    ``fit_to`` gives the fit to all strokes up to one.
    """

    def __init__(self, problem: Problem, before: Learner, fit_to: Callable[[int], Fit]):
        self.problem, self.before, self.fit_to, self.torque = problem, before, fit_to, np.zeros(0)

    def predict(self, rows: slice) -> Array:
        """The torque of the drives that move the plant."""
        return self.torque[rows] if self.torque.size else self.before.predict(rows)

    def learn(self, rows: slice, torque: Array) -> None:
        """Fit to the measured angles of all strokes so far."""
        stroke = int(self.problem.signals.stroke[rows.start])
        if stroke % 2 == 0 and stroke < self.problem.signals.count:
            found = self.fit_to(stroke)
            angle, _ = self.problem.apply(found).replay(found.values, found.delay)
            self.torque = self.problem.signals.compute_torque(angle)


def list_identified(problem: Problem, level: Level, before: Maker) -> Mapping[str, Maker]:
    """Makers of the identified plant, alone and below tables, by name; ``before`` predicts until the first fit."""

    @cache
    def fit_to(stroke: int) -> Fit:
        start = fit_to(stroke - 2).values if stroke > 2 else None
        return fit(problem, level, rows_of(problem.signals, 1, stroke), start)

    def make() -> Learner:
        return Identified(problem, before(), fit_to)

    found: dict[str, Maker] = {IDENTIFIED: make}
    if problem.signals.repeats:
        found |= {
            f"{IDENTIFIED}, and ILC": lambda: Both(make(), Iterative(problem.signals, 0.5)),
            f"{IDENTIFIED}, and {ABOVE}": lambda: Both(make(), make_tables(problem)[ABOVE]()),
        }
    return found


def act(gap: Gap, plant: Fit, known: Fit) -> dict[str, Any]:
    """Torque and tracking error, in percent of those of the drives alone, on the plant fitted to the whole log.

    ``as_logged`` has the drives of the log; learners without a model act, beside what the log predicts for them.
    ``with_velocity`` feeds the desired velocity forward too, and has inverse dynamics of the plan, by the joints of
    the model and by those ``known`` from the first strokes, below the learners.
    """
    problem, signals, log = gap.problem.apply(plant), gap.signals, gap.signals.log
    tables = make_tables(problem)
    as_logged = {name: tables[name] for name in PLACED if name in tables}
    plan = low_pass(signals.command, log.period)
    rate = differentiate(plan, log.period)
    motion = (plan, rate, differentiate(rate, log.period))
    makers: dict[str, Maker] = {ALONE: lambda: Fixed(np.zeros_like(plan)), **as_logged}
    models = {
        "model": (gap.problem, gap.problem.machine.losses),
        "identified": (gap.problem.apply(known), known.values),
    }
    for name, (model, values) in models.items():
        rigid = model.machine.compute_torque(*motion, log.orientation)
        inverse = rigid + model.compute_joint_torque(values, motion)
        makers |= place_below(problem, f"inverse dynamics of the {name} joints", inverse)
    return {
        "unit": "% of the drives alone",
        "as_logged": {
            name: {
                "torque_predicted": gap.values["left"][name]["value"],
                **_run(problem, plant, make(), log.command_velocity, plan),
            }
            for name, make in as_logged.items()
        },
        "with_velocity": {name: _run(problem, plant, make(), rate, plan) for name, make in makers.items()},
    }


def _run(problem: Problem, plant: Fit, learner: Learner, rate: Array, plan: Array) -> dict[str, Any]:
    """One learner that predicts each stroke, acts, and learns what feedforward and feedback supplied."""
    signals, period, begin = problem.signals, problem.signals.log.period, int(problem.signals.bounds[0])
    command, kp, kd = signals.command, signals.log.kp, signals.log.kd
    logged, velocity = problem.replay(plant.values, plant.delay)
    alone = signals.compute_torque(logged)
    expansions = problem.expand(plan, differentiate(plan, period))
    state, left, tracking = (logged[begin], velocity[begin]), list[float](), list[float]()
    for stroke in range(1, signals.count + 1):
        rows = signals.rows(stroke)
        forward = learner.predict(rows)
        held = np.append(np.arange(len(forward)), len(forward) - 1)  # after the last row the state is read
        drive = make_drive(command[rows][held], rate[rows][held], forward[held], kp, kd)
        along = [Expansion(*(each[rows][held] for each in own)) for own in expansions]
        replayed = problem.replay(plant.values, plant.delay, along, drive, state)
        state, angle = (replayed[0][-1], replayed[1][-1]), replayed[0][:-1]
        feedback = kp * (command[rows] - angle) + kd * (rate[rows] - differentiate(angle, period))
        learner.learn(rows, forward + feedback)
        left.append(compare_rms(feedback, alone[rows]))
        tracking.append(compare_rms(angle - command[rows], logged[rows] - command[rows]))
    return {
        name: {
            "mean": float(np.mean(own[FIRST - 1 :])),
            "worst": float(np.max(own[FIRST - 1 :])),
            "strokes": [round(each, 2) for each in own],
        }
        for name, own in {"torque_obtained": left, "tracking": tracking}.items()
    }
