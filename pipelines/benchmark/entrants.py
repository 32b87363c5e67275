"""What enters the benchmark: methods by their overrides, and what each of them is tuned over."""

from collections.abc import Sequence
from dataclasses import Field, dataclass, fields
from typing import Any

import numpy as np

from cmacexp.config.cmac import CmacConfig
from cmacexp.config.component import config_class
from cmacexp.config.schema import LearningConfig
from cmacexp.config.targets import current_folder_importable, find_class
from cmacexp.errors import BadInput
from cmacexp.feedforward.network import BuiltInFeedforward

FEEDFORWARD, CONTROLLER = "feedforward", "controller"
OWN = "pipelines.benchmark.methods"
ALONE = "feedback alone"


@dataclass(frozen=True)
class Method:
    """A method, as the command line chooses it."""

    name: str
    overrides: Sequence[str]
    tuned: Sequence[str] = ()
    """Keys of the fields that it is tuned over."""
    entered: bool = False
    """Whether it was named on the command line."""


def _shipped(name: str, option: str, *tuned: str, more: Sequence[str] = ()) -> Method:
    return Method(name, (f"feedforward={option}", *more), tuned)


RATE = "learning.rate"
SIZE = ("cmac.layers", "cmac.resolution_elements", "cmac.inputs")


def _own(name: str, target: str, group: str = FEEDFORWARD) -> Method:
    return enter(f"{OWN}.{target}", name)


def enter(target: str, name: str | None = None) -> Method:
    """The method of a custom class: a feedforward, or a controller, which gets no other feedforward.

    It is tuned over the fields of its ``Config`` that say ``tuned=...``. A feedforward without any, and one of the
    networks that the compiled loop knows, is tuned over ``learning.rate`` too.

    Raises:
        BadInput: there is no such class, or it is neither.
    """
    with current_folder_importable():
        found = find_class("--method", target)
    group = FEEDFORWARD if hasattr(found, "predict") else CONTROLLER if hasattr(found, "act") else None
    if group is None:
        raise BadInput("--method", target, "must be a feedforward with predict, or a controller with act")
    schema = config_class(found)
    own = [f"{group}.{each.name}" for each in fields(schema) if each.metadata.get("tuned")] if schema else []
    if group == FEEDFORWARD and (issubclass(found, BuiltInFeedforward) or not own):
        own.append(RATE)
    alone = ("feedforward=none",) if group == CONTROLLER else ()
    shown = name or target.rpartition(".")[2]
    return Method(shown, (*alone, f"{group}._target_={target}"), tuple(own), entered=name is None)


def list_methods() -> dict[str, Method]:
    """All methods of the benchmark, by name."""
    methods = [
        _shipped(ALONE, "none"),
        _shipped("model", "inverse_dynamics"),
        _shipped("model 20 % light", "inverse_dynamics", more=("feedforward.mass_factor=0.8",)),
        _shipped("model 20 % heavy", "inverse_dynamics", more=("feedforward.mass_factor=1.2",)),
        _shipped("CMAC", "cmac", RATE, *SIZE),
        _shipped("CMAC on model", "cmac_on_model", RATE, *SIZE),
        _shipped("RBF", "rbf", RATE, "feedforward.centres", "feedforward.active", "feedforward.width"),
        _shipped("ILC", "ilc", RATE, "feedforward.cutoff"),
        enter("pipelines.perceptron.Perceptron", "MLP"),
        enter(f"{OWN}.norm_optimal.NormOptimal", "norm-optimal ILC"),
        enter(f"{OWN}.fourier.RandomFourier", "Fourier features"),
        enter(f"{OWN}.adaptive.AdaptiveRegressor", "adaptive regressor"),
        enter(f"{OWN}.repetitive.Repetitive", "repetitive control"),
    ]
    return {method.name: method for method in methods}
