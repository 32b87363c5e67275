"""The tasks of the benchmark: machines that walk, what changes for them, and how often it is tried. Frozen."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from pipelines.worlds import FIRST_TUNING, draw_world

VERSION = 1
"""Of the tasks; version 2 of the benchmark has the same ones, beside the log track. Whoever changes one of them, or a
world, raises it: results of two versions are never compared."""
PROTOCOL = ("learning.lead=auto", "learning.rate=auto", "learning.guard=none", "warn=false")
"""Of every run. Nothing guards learning: a method that does harm shows it."""
STROKE, SPEED, STIFFNESS, NOISE, DELAY, PAYLOAD, SLOPE = TASKS = (
    "stroke", "speed", "stiffness", "noise", "delay", "payload", "slope",
)  # fmt: skip
STRESS = "delay of two"
"""Is tried and shown, but does not count."""


@dataclass(frozen=True)
class Machine:
    """A machine that walks, and what changes after the cycles ``before``."""

    scenario: str
    """Of its worlds."""
    overrides: Sequence[str]
    changes: Mapping[str, Sequence[str]]
    """Overrides of each task, which replace those of the world."""
    worlds: int = 20
    """In which methods are tested."""
    before: int = 20
    """Cycles with which a method starts."""
    after: int = 20
    """Cycles after the change."""
    last: int = 5
    """Cycles at the end whose median error is the end error."""
    tuning_worlds: int = 3
    draws: int = 30
    """Settings that are drawn to tune a method; 0: this machine is for default settings alone."""

    def draw(self, number: int, tuning: bool = False) -> tuple[str, ...]:
        """Overrides of a world in which methods are tested, or tuned."""
        return draw_world(self.scenario, FIRST_TUNING + number if tuning else number)


def _changes(
    stroke: str, cycle_time: str, bias: str, payload: Sequence[str], slope: Sequence[str]
) -> dict[str, Sequence[str]]:
    return {
        STROKE: [f"gait.stroke={stroke}"],
        SPEED: [f"gait.cycle_time={cycle_time}"],
        STIFFNESS: ["terrain.step_time=0", "terrain.step_factor=2"],
        NOISE: ["sensors.force.noise_relative=0.3", f"sensors.force.bias={bias}"],
        DELAY: ["plant.delay=1"],
        PAYLOAD: payload,
        SLOPE: ["terrain.patch_spread=0.5", *slope],
    }


def _robot(name: str, payload: float) -> Machine:
    slope = ["terrain.slope=0.05", "terrain.slope_start=0.2"]
    return Machine(
        "robot",
        ("scenario=robot", f"machine={name}"),
        _changes("0.15", "1.6", "3", [f"payload.weight={payload:g}"], slope),
        worlds=5,
        before=10,
        after=10,
        last=3,
        draws=0,
    )


LEG, QUADRUPED, GO1, MINI_CHEETAH = "leg", "quadruped", "go1", "mini_cheetah"
MACHINES = {
    LEG: Machine(
        "one_leg",
        ("scenario=one_leg", "reference=aware"),
        _changes("0.25", "2.4", "0.1", ["plant.mass_factor=x1.2"], ["terrain.slope=0.05"])
        | {STRESS: ["plant.delay=2"]},
    ),
    QUADRUPED: Machine(
        "quadruped_lasting",
        ("scenario=quadruped_lasting", "gait.duty_factor=0.9"),
        _changes("0.35", "2.4", "1", ["payload.weight=8"], ["terrain.slope=0.05"]),
    ),
    GO1: _robot("go1", 25.0),
    MINI_CHEETAH: _robot("mini_cheetah", 18.0),
}


def change_world(world: Sequence[str], change: Sequence[str]) -> list[str]:
    """The overrides of a world with those of a task: ``x1.2`` is a factor of the value that the world has."""
    values = dict(text.split("=", 1) for text in world)
    for text in change:
        key, value = text.split("=", 1)
        values[key] = f"{float(values[key]) * float(value[1:]):.6g}" if value.startswith("x") else value
    return [f"{key}={value}" for key, value in values.items()]


def make_quick(machine: Machine) -> Machine:
    """The same with few short runs, which only check the machinery."""
    return replace(machine, worlds=2, before=3, after=3, last=2, tuning_worlds=1, draws=min(2, machine.draws))


def hash_tasks(machines: Mapping[str, Machine]) -> str:
    """SHA-256 of all that defines the tasks, worlds included."""
    plain = {
        name: asdict(machine) | {"drawn": [machine.draw(n, tuning) for tuning in (False, True) for n in range(3)]}
        for name, machine in machines.items()
    }
    return hashlib.sha256(json.dumps([VERSION, PROTOCOL, plain], sort_keys=True).encode()).hexdigest()
