"""What takes part in the benchmark: machines with their tasks, which are frozen, and methods.

A task is what changes for a machine that walks; a method is its overrides, and what it is tuned over.
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
from cmacexp.feedforward import IterativeLearning, RadialBasis
from cmacexp.feedforward.network import BuiltInFeedforward
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
    return Machine(
        "robot",
        ("scenario=robot", f"machine={name}"),
        _changes(
            "0.15", "1.6", "3", [f"payload.weight={payload:g}"], ["terrain.slope=0.05", "terrain.slope_start=0.2"]
        ),
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
    for key, value in (text.split("=", 1) for text in change):
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


FEEDFORWARD, CONTROLLER = "feedforward", "controller"
ALONE, CMAC = "feedback only", "CMAC"
OWN = "pipelines.benchmark.methods"
T = TypeVar("T")


@dataclass(frozen=True)
class Method:
    """A method, as the command line chooses it."""

    name: str
    overrides: Sequence[str]
    tuned: Sequence[tuple[str, Any]] = ()
    """Keys that it is tuned over, and what :func:`cmacexp.config.number` takes as ``tuned`` for each."""
    learns: bool = False
    """Whether it keeps what it has learnt, so that learning can be guarded."""


def _list_tuned(group: str, schema: type[Any] | None) -> list[tuple[str, Any]]:
    """Fields of a config class that say what they are tuned over.

    Raises:
        BadInput: an end of a range, whose logarithm is drawn, is not above 0.
    """
    given = [(f"{group}.{each.name}", each.metadata.get("tuned")) for each in (fields(schema) if schema else ())]
    for key, tuned in given:
        above = not isinstance(tuned, tuple) or min(tuned) > 0.0
        require(above, "--method", key, f"has tuned={tuned}: both ends must be above 0, its logarithm is drawn")
    return [(key, tuned) for key, tuned in given if tuned]


LEARNING = _list_tuned("learning", LearningConfig)
CMAC_SIZE = _list_tuned("cmac", CmacConfig)


def enter(target: str, name: str | None = None, has_rate: bool | None = None) -> Method:
    """The method of a custom class: a feedforward, or a controller, which gets no other feedforward.

    It is tuned over the fields of its ``Config`` that say ``tuned=``. A feedforward that ``has_rate`` (None: if the
    compiled loop knows it), and a feedforward without such fields, are tuned over ``learning.rate``, too.

    Raises:
        BadInput: there is no such class, or it is neither.
    """
    found = find_class("--method", target)
    known_form = hasattr(found, "predict") or hasattr(found, "act")
    require(known_form, "--method", target, "must be a feedforward with predict, or a controller with act")
    group = FEEDFORWARD if hasattr(found, "predict") else CONTROLLER
    own = _list_tuned(group, config_class(found))
    known = issubclass(found, BuiltInFeedforward) if has_rate is None else has_rate
    if group == FEEDFORWARD and (known or not own):
        own += LEARNING
    return Method(
        name or target.rpartition(".")[2],
        (*(["feedforward=none"] if group == CONTROLLER else []), f"{group}._target_={target}"),
        own,
        learns=group == FEEDFORWARD and hasattr(found, "learnt"),
    )


def list_methods() -> list[Method]:
    """All methods of the benchmark."""
    of_rbf, of_ilc = (_list_tuned(FEEDFORWARD, each.Config) for each in (RadialBasis, IterativeLearning))
    model = ("feedforward=inverse_dynamics",)
    # With parameters that no data can change, the nominal model along a plan whose velocity does not jump.
    smooth = replace(enter(f"{OWN}.regressor.Identified", "model, smooth plan"), learns=False)
    return [
        Method(ALONE, ("feedforward=none",)),
        Method("model", model),
        Method("model 20 % light", (*model, "feedforward.mass_factor=0.8")),
        Method("model 20 % heavy", (*model, "feedforward.mass_factor=1.2")),
        replace(smooth, overrides=(*smooth.overrides, "++feedforward.prior=1e6"), tuned=()),
        replace(smooth, name="model, identified"),
        Method(CMAC, ("feedforward=cmac",), [*LEARNING, *CMAC_SIZE], learns=True),
        Method("CMAC on model", ("feedforward=cmac_on_model",), [*LEARNING, *CMAC_SIZE], learns=True),
        Method("RBF", ("feedforward=rbf",), [*LEARNING, *of_rbf], learns=True),
        Method("ILC", ("feedforward=ilc",), [*LEARNING, *of_ilc], learns=True),
        enter("pipelines.perceptron.Perceptron", "MLP", has_rate=True),
        enter(f"{OWN}.norm_optimal.NormOptimal", "norm-optimal ILC"),
        enter(f"{OWN}.fourier.RandomFourier", "Fourier features"),
        enter(f"{OWN}.regressor.AdaptiveRegressor", "adaptive regressor", has_rate=False),
        enter(f"{OWN}.playing.Repetitive", "repetitive control"),
    ]


def slug(name: str) -> str:
    """A name as the command line takes it: ``cmac_on_model``."""
    return "_".join("".join(letter if letter.isalnum() else " " for letter in name.lower()).split())


def choose_names(option: str, names: str | None, known: Collection[str]) -> list[str]:
    """Names of an option of the command line as they are ``known``, all of them for None; raises BadInput."""
    wanted = [*known] if names is None else [slug(name) for name in names.split(",")]
    for name in wanted:
        require_name(option, name, known)
    return wanted


def choose(
    names: str | None, targets: Sequence[str], known: Mapping[str, T], enter_class: Callable[[str], T]
) -> dict[str, T]:
    """What takes part, by name: what is asked for of what is known, then the classes that enter.

    Args:
        names: of known methods, as the command line takes them, separated by commas; None: all of them.
        targets: classes that enter, each as ``module.Class``.
        known: methods by name.
        enter_class: gives the method of a target.

    Raises:
        BadInput: there is no such method, or a class has the name of another one; and as ``enter_class``.
    """
    by_slug = {slug(name): name for name in known}
    chosen = {by_slug[key]: known[by_slug[key]] for key in choose_names("--methods", names, by_slug)}
    for target in targets:
        name = target.rpartition(".")[2]
        is_new = name not in {*known, *chosen}
        require(is_new, "--method", target, "a method of that name takes part already; rename the class")
        with current_folder_importable():
            chosen[name] = enter_class(target)
    return chosen


def choose_methods(names: str | None, targets: Sequence[str]) -> dict[str, Method]:
    """The methods that are asked for by name, feedback only first; see :func:`choose`."""
    known = {method.name: method for method in list_methods()}
    return {ALONE: known[ALONE]} | choose(names, targets, known, enter)
