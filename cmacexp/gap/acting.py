"""Learners that act on the identified plant: what the log predicts and what is obtained, as torque and tracking."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cmacexp.gap.analysis import FIRST, Gap, compare_rms, make_values
from cmacexp.gap.identify import LEVELS, Fit, Problem, make_regressors
from cmacexp.gap.learners import Fixed, Learner, Maker, make_tables, place_below
from cmacexp.gap.machine import Expansion
from cmacexp.gap.replay import Drive, replay
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
    chosen = [
        name for name in ("stroke before", "CMAC over phase", "CMAC over angles and velocities") if name in tables
    ]
    plan = low_pass(signals.command, log.period)
    rate = differentiate(plan, log.period)
    motion = (plan, rate, differentiate(rate, log.period))
    joints = {"model": make_values(len(log.joints), *problem.machine.losses), "identified": known.values}
    makers: dict[str, Maker] = {ALONE: lambda: Fixed(signals, np.zeros_like(plan))}
    makers |= {name: tables[name] for name in chosen}
    for name, values in joints.items():
        level = known.level if name == "identified" else LEVELS[0]
        machine = (gap.problem.apply(known) if name == "identified" else gap.problem).machine
        losses = np.einsum("kjp,jp->kj", make_regressors(problem, level, motion), values)
        inverse = machine.compute_torque(*motion, log.orientation) + losses
        makers |= place_below(problem, f"inverse dynamics of the {name} joints", inverse)
    as_logged: Mapping[str, Maker] = {name: tables[name] for name in chosen}
    logged = log.command_velocity
    return {
        "unit": "% of the drives alone",
        "as_logged": {
            name: {
                "torque_predicted": gap.values["left"][name]["value"],
                **_run(problem, plant, make(), logged, plan),
            }
            for name, make in as_logged.items()
        },
        "with_velocity": {name: _run(problem, plant, make(), rate, plan) for name, make in makers.items()},
    }


def _run(problem: Problem, plant: Fit, learner: Learner, rate: Array, plan: Array) -> dict[str, Any]:
    """One learner that predicts each stroke, acts, and learns what feedforward and feedback supplied."""
    signals, log = problem.signals, problem.signals.log
    assert log.command is not None  # else nothing could be identified
    logged, logged_velocity = problem.replay_all(plant.values, plant.delay)
    alone = signals.compute_torque(logged)
    expansions = [
        problem.machine.expand(b, plan, differentiate(plan, log.period), log.orientation)
        for b in problem.machine.blocks
    ]
    begin = int(signals.bounds[0])
    state, left, tracking = (logged[begin], logged_velocity[begin]), list[float](), list[float]()
    for stroke in range(1, signals.count + 1):
        rows, forward = signals.rows(stroke), learner.predict(stroke)
        angle = np.empty_like(forward)
        ends = tuple(each.copy() for each in state)
        for block, expansion in zip(problem.machine.blocks, expansions, strict=True):
            cut = Expansion(*(np.concatenate([each[rows], each[rows][-1:]]) for each in expansion))
            inputs = (log.command[rows][:, block], rate[rows][:, block], forward[:, block])
            command, given, torque = (np.concatenate([each, each[-1:]]) for each in inputs)
            drive = Drive(command, given, torque, log.kp[block], log.kd[block])
            at = (state[0][block], state[1][block])
            params = problem.make_params(block, plant.values, plant.delay)
            done = replay(cut, drive, params, log.period, at)
            angle[:, block] = done.angle[:-1]
            ends[0][block], ends[1][block] = done.angle[-1], done.velocity[-1]
        state = (ends[0], ends[1])
        feedback = log.kp * (log.command[rows] - angle) + log.kd * (rate[rows] - differentiate(angle, log.period))
        learner.learn(stroke, forward + feedback)
        left.append(compare_rms(feedback, alone[rows]))
        tracking.append(compare_rms(angle - log.command[rows], logged[rows] - log.command[rows]))
    return {
        name: {
            "mean": float(np.mean(own[FIRST - 1 :])),
            "worst": float(np.max(own[FIRST - 1 :])),
            "strokes": [round(each, 2) for each in own],
        }
        for name, own in {"torque_obtained": left, "tracking": tracking}.items()
    }
