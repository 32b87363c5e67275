"""Learners that act on the identified plant: what the log predicts and what is obtained, as torque and tracking."""

from typing import Any

import numpy as np

from cmacexp.gap.analysis import FIRST, Gap, compare_rms
from cmacexp.gap.identify import Fit, Problem
from cmacexp.gap.learners import PLACED, Fixed, Learner, Maker, make_tables, place_below
from cmacexp.gap.machine import Expansion
from cmacexp.gap.replay import Drive
from cmacexp.gap.signals import differentiate, low_pass
from cmacexp.typing import Array

ALONE = "desired velocity alone"


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
    command, _, _, kp, kd = problem.drive
    logged, velocity = problem.replay(plant.values, plant.delay)
    alone = signals.compute_torque(logged)
    expansions = problem.expand(plan, differentiate(plan, period))
    state, left, tracking = (logged[begin], velocity[begin]), list[float](), list[float]()
    for stroke in range(1, signals.count + 1):
        rows = signals.rows(stroke)
        forward = learner.predict(rows)
        held = np.append(np.arange(len(forward)), len(forward) - 1)  # after the last row the state is read
        drive = Drive(command[rows][held], rate[rows][held], forward[held], kp, kd)
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
