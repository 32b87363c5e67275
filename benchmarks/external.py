"""Overhead per step of external components, measured with components that replay a recorded run."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.timing import Row, Table, compared, in_turn
from cmacexp.config import Config
from cmacexp.config.compose import compose_config
from cmacexp.control import Action
from cmacexp.data.signals import ARRAYS
from cmacexp.loop.scenario import Scenario, make_scenario
from cmacexp.plants import Measurement
from cmacexp.typing import Array
from tests.support.rollout import Rollout, roll_out

TARGET = "10 us on top"


class Replay:
    """A component that returns recorded answers in order and ignores its inputs."""

    acts = True

    def __init__(self, answers: list[Any]):
        self.next_answer = iter(answers).__next__

    def reset(self, *setup: object) -> None:
        """Do nothing; the answers are recorded."""

    def give(self, *inputs: object) -> Any:
        """Return the next answer; serves as the method of all four component types."""
        return self.next_answer()

    step = measure = act = predict = give


METHODS = {"plant": ("step", 1), "sensors": ("measure", 1), "controller": ("act", 2), "feedforward": ("predict", 2)}
"""Method of each type of component, and number of its arguments."""


def stack_array(columns: dict[str, Array], name: str) -> Array:
    """Stack the trace columns of array ``name`` to the array (steps, legs, n) that components exchange."""
    return np.stack([columns[column] for column in ARRAYS[name] if column in columns], axis=-1)


def measurements(scenario: Scenario, rollout: Rollout) -> list[Measurement]:
    """Return the measurement at the start of each step of a recorded run."""
    legs = rollout.columns()
    q, dq, foot, velocity = (stack_array(legs, name) for name in ("q", "dq", "foot", "velocity"))
    body = stack_array(rollout.body_columns(), "body")
    columns = (q, dq, foot, velocity, legs["force"].copy(), body, [scenario.first.body_rate] * len(q))
    return [Measurement(*row) for row in zip(*columns, strict=True)]


def answers(config: Config) -> dict[str, list[Any]]:
    """Run a config and return the recorded outputs of each step, by component type."""
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


def in_loop(config: Config, recorded: dict[str, list[Any]]) -> Callable[[], float]:
    """Return a worker that gives the time per step of a run with replaying components, s.

    ``recorded`` holds the outputs of each replaced component, by component type; the others stay built in.
    """

    def run() -> float:
        scenario = replace(make_scenario(config), **{key: Replay(outputs) for key, outputs in recorded.items()})
        rollout = roll_out(scenario)
        assert rollout.status == "completed", rollout.cause
        return rollout.seconds / rollout.steps

    return run


def without_loop(recorded: dict[str, list[Any]]) -> Callable[[], float]:
    """Return a worker that gives the time per step of only calling the replaying components, s."""

    def run() -> float:
        calls = [
            (getattr(Replay(outputs), METHODS[key][0]), (None,) * METHODS[key][1], len(outputs))
            for key, outputs in recorded.items()
        ]
        began = time.perf_counter()
        for call, arguments, steps in calls:
            for _ in range(steps):
                call(*arguments)
        return (time.perf_counter() - began) / max(steps for *_, steps in calls)

    return run


def tables(quick: bool) -> list[Table]:
    """Return the overhead with each component external, and with all of them, in both scenarios."""
    rows: list[Row] = []
    for scenario in ("one_leg", "quadruped"):
        config = compose_config([f"scenario={scenario}", "learning.start_cycle=1"])
        recorded = answers(config)
        sets = {key: {key: recorded[key]} for key in recorded}
        sets["all"] = {key: outputs for key, outputs in recorded.items() if key != "feedforward"}
        workers: dict[str, Callable[[], float]] = {}
        for key, some in sets.items():
            workers[key] = in_loop(config, some)
            workers[f"{key} alone"] = without_loop(some)
        times = in_turn(workers, 7 if quick else 31)
        for key in sets:
            rows.append(compared(times, f"{scenario}, {key}", key, f"{key} alone", "the part's own calls", TARGET))
    return [Table("An external part, a step", rows)]
