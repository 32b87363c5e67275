"""What an external component costs a step beside its own work: components that only replay a run of built-in ones."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.timing import Row, Table, compared, in_turn, make_config
from cmacexp.config import Config
from cmacexp.control import Action
from cmacexp.data.signals import ARRAYS
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.plants import Measurement
from cmacexp.typing import Array
from tests.support.rollout import Rollout, roll_out

TARGET = "10 us on top"


class Replay:
    """A component that does nothing but give one prepared answer after the other, whatever it is asked."""

    acts = True

    def __init__(self, answers: list[Any]):
        self.next_answer = iter(answers).__next__

    def reset(self, *known: object) -> None:
        """Nothing to prepare."""

    def give(self, *inputs: object) -> Any:
        """Give the next answer, as any of the four components."""
        return self.next_answer()

    step = measure = act = predict = give


METHODS = {"plant": "step", "sensors": "measure", "controller": "act", "feedforward": "predict"}


def stack_array(columns: dict[str, Array], name: str) -> Array:
    """An array that components exchange, of its columns."""
    return np.stack([columns[column] for column in ARRAYS[name] if column in columns], axis=-1)


def measurements(scenario: Scenario, rollout: Rollout) -> list[Measurement]:
    """What plant or sensors gave at the start of every step."""
    legs, pose = rollout.columns(), rollout.body_columns()
    q, dq, foot, velocity = (stack_array(legs, name) for name in ("q", "dq", "foot", "velocity"))
    rate = [scenario.first.body_rate] * len(q)
    columns = (q, dq, foot, velocity, legs["force"].copy(), stack_array(pose, "body"), rate)
    return [Measurement(*row) for row in zip(*columns, strict=True)]


def answers(config: Config) -> dict[str, list[Any]]:
    """What each part of a run gave, step by step."""
    scenario = make_scenario(config)
    rollout = roll_out(scenario)
    seen = measurements(scenario, rollout)
    feedback, feedforward, reference = (
        stack_array(rollout.columns(), name) for name in ("feedback", "feedforward", "reference")
    )
    return {
        "plant": [*seen[1:], seen[-1]],
        "sensors": seen,
        "controller": [Action(*row) for row in zip(feedback, feedforward, reference, strict=True)],
        "feedforward": list(feedforward[scenario.setup.plan.start_step :]),
    }


def in_loop(config: Config, given: dict[str, list[Any]]) -> Callable[[], float]:
    """A worker: seconds a step of a run with these external parts."""

    def run() -> float:
        scenario = replace(make_scenario(config), **{key: Replay(listed) for key, listed in given.items()})
        rollout = roll_out(scenario)
        assert rollout.status == "completed", rollout.cause
        return rollout.seconds / rollout.steps

    return run


def alone(given: dict[str, list[Any]]) -> Callable[[], float]:
    """A worker: seconds a step of the calls of these parts alone."""

    def run() -> float:
        two = ("controller", "feedforward")
        calls = [
            (getattr(Replay(listed), METHODS[key]), (None, None) if key in two else (None,), len(listed))
            for key, listed in given.items()
        ]
        began = time.perf_counter()
        for call, arguments, steps in calls:
            for _ in range(steps):
                call(*arguments)
        return (time.perf_counter() - began) / max(steps for *_, steps in calls)

    return run


def tables(quick: bool) -> list[Table]:
    """Each part external by itself, and all of them, in both scenarios."""
    rows: list[Row] = []
    for scenario in ("one_leg", "quadruped"):
        config = make_config(f"scenario={scenario}", "learning.start_cycle=1")
        given = answers(config)
        sets = {key: {key: given[key]} for key in given} | {"all": {k: given[k] for k in given if k != "feedforward"}}
        workers: dict[str, Callable[[], float]] = {}
        for key, some in sets.items():
            workers[key], workers[f"{key} alone"] = in_loop(config, some), alone(some)
        times = in_turn(workers, 7 if quick else 31)
        for key in sets:
            rows.append(compared(times, f"{scenario}, {key}", key, f"{key} alone", "the part's own calls", TARGET))
    return [Table("An external part, a step", rows)]
