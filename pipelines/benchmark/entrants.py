"""Entrants of the benchmark: machines with their frozen tasks, and methods.

A task is a change for a machine that walks; a method has overrides, and hyperparameters that are tuned.
"""

import hashlib
import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, TypeVar

from cmacexp.config.cmac import CmacConfig
from cmacexp.config.component import config_class, current_folder_importable, find_class
from cmacexp.config.schema import LearningConfig
from cmacexp.errors import require, require_name
from cmacexp.feedforward import IdentifiedModel, IterativeLearning, RadialBasis
from cmacexp.feedforward.network import BuiltInFeedforward
from pipelines.worlds import FIRST_TUNING, draw_world

VERSION = 1
"""Version of the tasks; raise it with any change of a task or a world, as results of two versions are not comparable.

Version 2 of the benchmark added the log track and has the same tasks.
"""
PROTOCOL = ("learning.lead=auto", "learning.rate=auto", "learning.guard=none", "warn=false")
"""Overrides of every run. The guard is off, so that a method that diverges is visible."""
STROKE, SPEED, STIFFNESS, NOISE, DELAY, PAYLOAD, SLOPE = TASKS = (
    "stroke", "speed", "stiffness", "noise", "delay", "payload", "slope",
)  # fmt: skip
DECIDING = 20
"""Number of worlds from which on methods are ranked."""
STRESS = "delay of two"
"""Task that is run and shown, but does not count."""


@dataclass(frozen=True)
class Machine:
    """A machine that walks, and its changes after the cycles ``before``."""

    scenario: str
    """Scenario of its worlds."""
    overrides: Sequence[str]
    changes: Mapping[str, Sequence[str]]
    """Overrides of each task, which replace those of the world."""
    worlds: int = 20
    """Number of worlds in which methods are tested."""
    before: int = 20
    """Cycles before the change."""
    after: int = 20
    """Cycles after the change."""
    last: int = 5
    """Number of last cycles whose median error is the end error."""
    tuning_worlds: int = 3
    draws: int = 30
    """Number of random settings to tune a method; 0: methods run with default settings only."""

    def draw(self, number: int, tuning: bool = False) -> tuple[str, ...]:
        """Draw the overrides of a world for tests or, if ``tuning``, for tuning."""
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
    return Machine(
        "robot",
        ("scenario=robot", f"machine={name}"),
        _changes(
            "0.15", "1.6", "3", [f"payload.weight={payload:g}"], ["terrain.slope=0.05", "terrain.slope_start=0.2"]
        ),
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
    """Replace overrides of a world by those of a task; a value ``x1.2`` multiplies the world's value."""
    values = dict(text.split("=", 1) for text in world)
    for key, value in (text.split("=", 1) for text in change):
        values[key] = f"{float(values[key]) * float(value[1:]):.6g}" if value.startswith("x") else value
    return [f"{key}={value}" for key, value in values.items()]


def make_quick(machine: Machine) -> Machine:
    """Return the machine with few short runs, for a smoke test."""
    return replace(machine, worlds=2, before=3, after=3, last=2, tuning_worlds=1, draws=min(2, machine.draws))


def hash_tasks(machines: Mapping[str, Machine]) -> str:
    """Compute the SHA-256 of the definition of all tasks, including worlds."""
    plain = {
        name: asdict(machine) | {"drawn": [machine.draw(n, tuning) for tuning in (False, True) for n in range(3)]}
        for name, machine in machines.items()
    }
    return hashlib.sha256(json.dumps([VERSION, PROTOCOL, plain], sort_keys=True).encode()).hexdigest()


FEEDFORWARD, CONTROLLER = "feedforward", "controller"
ALONE, CMAC = "feedback only", "CMAC"
EACH_CYCLE = "model, identified each cycle"
"""Model with as many cycles of data as the learners."""
METHODS_PACKAGE = "pipelines.benchmark.methods"
T = TypeVar("T")


@dataclass(frozen=True)
class Method:
    """A method of the benchmark."""

    name: str
    overrides: Sequence[str]
    tuned: Sequence[tuple[str, Any]] = ()
    """Tuned keys, and the candidates or range of each, as in ``tuned`` of :func:`cmacexp.config.number`."""
    learns: bool = False
    """True if the method keeps what it has learnt, so that learning can be guarded."""


def _list_tuned(group: str, schema: type[Any] | None) -> list[tuple[str, Any]]:
    """List the fields of a config class that declare ``tuned``: keys, and candidates or range.

    Raises:
        BadInput: an end of a range, from which values are drawn log-uniformly, is not above 0.
    """
    declared = [
        (f"{group}.{field.name}", field.metadata.get("tuned")) for field in (fields(schema) if schema else ())
    ]
    for key, tuned in declared:
        require(
            not isinstance(tuned, tuple) or min(tuned) > 0.0,
            "--method",
            key,
            f"has tuned={tuned}: both ends must be above 0, its logarithm is drawn",
        )
    return [(key, tuned) for key, tuned in declared if tuned]


LEARNING = _list_tuned("learning", LearningConfig)
CMAC_SIZE = _list_tuned("cmac", CmacConfig)


def enter(target: str, name: str | None = None, has_rate: bool | None = None) -> Method:
    """Return the method of a custom class: a feedforward, or a controller, which runs without another feedforward.

    It is tuned over the fields of its ``Config`` that declare ``tuned``. A feedforward that ``has_rate`` (None: if it
    is built into the compiled loop), and a feedforward without such fields, are also tuned over ``learning.rate``.

    Raises:
        BadInput: the class does not exist, or is neither a feedforward nor a controller.
    """
    component = find_class("--method", target)
    group = FEEDFORWARD if hasattr(component, "predict") else CONTROLLER
    complete = group == FEEDFORWARD or hasattr(component, "act")
    require(complete, "--method", target, "must be a feedforward with predict, or a controller with act")
    tuned = _list_tuned(group, config_class(component))
    rate_acts = issubclass(component, BuiltInFeedforward) if has_rate is None else has_rate
    if group == FEEDFORWARD and (rate_acts or not tuned):
        tuned += LEARNING
    return Method(
        name or target.rpartition(".")[2],
        (*(["feedforward=none"] if group == CONTROLLER else []), f"{group}._target_={target}"),
        tuned,
        learns=group == FEEDFORWARD and hasattr(component, "learnt"),
    )


def list_methods() -> list[Method]:
    """List all methods of the benchmark."""
    of_rbf, of_ilc = (_list_tuned(FEEDFORWARD, network.Config) for network in (RadialBasis, IterativeLearning))
    model = ("feedforward=inverse_dynamics",)
    # A prior of 1e6 keeps the nominal parameters: the nominal model along a plan whose velocity does not jump.
    smooth = replace(enter(f"{METHODS_PACKAGE}.regressor.Identified", "model, smooth plan"), learns=False)
    return [
        Method(ALONE, ("feedforward=none",)),
        Method("model", model),
        Method("model 20 % light", (*model, "feedforward.mass_factor=0.8")),
        Method("model 20 % heavy", (*model, "feedforward.mass_factor=1.2")),
        replace(smooth, overrides=(*smooth.overrides, "++feedforward.prior=1e6"), tuned=()),
        replace(smooth, name="model, identified"),
        Method(
            EACH_CYCLE, ("feedforward=identified",), _list_tuned(FEEDFORWARD, IdentifiedModel.Config), learns=True
        ),
        Method(CMAC, ("feedforward=cmac",), [*LEARNING, *CMAC_SIZE], learns=True),
        Method("CMAC on model", ("feedforward=cmac_on_model",), [*LEARNING, *CMAC_SIZE], learns=True),
        Method("RBF", ("feedforward=rbf",), [*LEARNING, *of_rbf], learns=True),
        Method("ILC", ("feedforward=ilc",), [*LEARNING, *of_ilc], learns=True),
        enter("pipelines.perceptron.Perceptron", "MLP", has_rate=True),
        enter(f"{METHODS_PACKAGE}.norm_optimal.NormOptimal", "norm-optimal ILC"),
        enter(f"{METHODS_PACKAGE}.fourier.RandomFourier", "Fourier features"),
        enter(f"{METHODS_PACKAGE}.regressor.AdaptiveRegressor", "adaptive regressor", has_rate=False),
        enter(f"{METHODS_PACKAGE}.playing.Repetitive", "repetitive control"),
    ]


def slug(name: str) -> str:
    """Convert a name to its form on the command line, such as ``cmac_on_model``."""
    return "_".join("".join(letter if letter.isalnum() else " " for letter in name.lower()).split())


def choose_names(option: str, names: str | None, allowed: Collection[str]) -> list[str]:
    """Split the comma-separated names of a command-line option; None selects all allowed names.

    Raises:
        BadInput: a name is not allowed.
    """
    chosen = [*allowed] if names is None else [slug(name) for name in names.split(",")]
    for name in chosen:
        require_name(option, name, allowed)
    return chosen


def choose(
    names: str | None, targets: Sequence[str], methods: Mapping[str, T], enter_class: Callable[[str], T]
) -> dict[str, T]:
    """Choose methods by name, and add the methods of custom classes.

    Args:
        names: names of methods in their form on the command line, separated by commas; None selects all.
        targets: custom classes, each as ``module.Class``.
        methods: all methods by name.
        enter_class: returns the method of a target.

    Raises:
        BadInput: a method does not exist, or a class has the name of another method; and as ``enter_class``.
    """
    by_slug = {slug(name): name for name in methods}
    chosen = {by_slug[key]: methods[by_slug[key]] for key in choose_names("--methods", names, by_slug)}
    for target in targets:
        name = target.rpartition(".")[2]
        require(
            name not in {*methods, *chosen},
            "--method",
            target,
            "a method of that name takes part already; rename the class",
        )
        with current_folder_importable():
            chosen[name] = enter_class(target)
    return chosen


def choose_methods(names: str | None, targets: Sequence[str]) -> dict[str, Method]:
    """Choose methods of the benchmark by name, and add custom classes; feedback only is first. See :func:`choose`."""
    methods = {method.name: method for method in list_methods()}
    return {ALONE: methods[ALONE]} | choose(names, targets, methods, enter)
