"""What enters the benchmark: methods by their overrides, and what each of them is tuned over."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from cmacexp.config.cmac import CmacConfig
from cmacexp.config.component import config_class, current_folder_importable, find_class
from cmacexp.config.schema import LearningConfig
from cmacexp.errors import BadInput
from cmacexp.feedforward import IterativeLearning, RadialBasis
from cmacexp.feedforward.network import BuiltInFeedforward

FEEDFORWARD, CONTROLLER = "feedforward", "controller"
ALONE, CMAC = "feedback only", "CMAC"
OWN = "pipelines.benchmark.methods"
RENAMED = {"feedback_alone": "feedback_only"}
"""Names as the command line took them before."""


@dataclass(frozen=True)
class Method:
    """A method, as the command line chooses it."""

    name: str
    overrides: Sequence[str]
    tuned: Sequence[tuple[str, Any]] = ()
    """Keys that it is tuned over, and what :func:`cmacexp.config.number` takes as ``tuned`` for each."""
    learns: bool = False
    """Whether it keeps what it has learnt, so that learning can be guarded."""


def _list_tuned(group: str, schema: type[Any] | None, only: Sequence[str] = ()) -> list[tuple[str, Any]]:
    """Fields of a config class that say what they are tuned over, or those of them that are named."""
    found = {each.name: each.metadata.get("tuned") for each in (fields(schema) if schema else ())}
    return [(f"{group}.{name}", tuned) for name, tuned in found.items() if tuned and (not only or name in only)]


LEARNING = _list_tuned("learning", LearningConfig, ["rate"])
CMAC_SIZE = _list_tuned("cmac", CmacConfig)


def enter(target: str, name: str | None = None, has_rate: bool = False) -> Method:
    """The method of a custom class: a feedforward, or a controller, which gets no other feedforward.

    It is tuned over the fields of its ``Config`` that say ``tuned=``. A feedforward that ``has_rate``, a network that
    the compiled loop knows, and a feedforward without such fields are tuned over ``learning.rate``, too.

    Raises:
        BadInput: there is no such class, or it is neither.
    """
    with current_folder_importable():
        found = find_class("--method", target)
    group = FEEDFORWARD if hasattr(found, "predict") else CONTROLLER if hasattr(found, "act") else None
    if group is None:
        raise BadInput("--method", target, "must be a feedforward with predict, or a controller with act")
    own = _list_tuned(group, config_class(found))
    if group == FEEDFORWARD and (has_rate or issubclass(found, BuiltInFeedforward) or not own):
        own += LEARNING
    overrides = (*(["feedforward=none"] if group == CONTROLLER else []), f"{group}._target_={target}")
    learns = group == FEEDFORWARD and hasattr(found, "learnt")
    return Method(name or target.rpartition(".")[2], overrides, own, learns=learns)


def list_methods() -> list[Method]:
    """All methods of the benchmark."""
    of_rbf, of_ilc = (_list_tuned(FEEDFORWARD, each.Config) for each in (RadialBasis, IterativeLearning))
    model = ("feedforward=inverse_dynamics",)
    # With parameters that no data can change, the nominal model along a plan whose velocity does not jump.
    smooth = replace(enter(f"{OWN}.identified.Identified", "model, smooth plan"), learns=False)
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
        enter(f"{OWN}.adaptive.AdaptiveRegressor", "adaptive regressor"),
        enter(f"{OWN}.repetitive.Repetitive", "repetitive control"),
    ]


def slug(name: str) -> str:
    """A name as the command line takes it: ``cmac_on_model``."""
    return "_".join("".join(letter if letter.isalnum() else " " for letter in name.lower()).split())


def choose_names(option: str, names: str | None, known: Collection[str]) -> list[str]:
    """Names of an option of the command line as they are ``known``, all of them for None; raises BadInput."""
    wanted = [*known] if names is None else [RENAMED.get(slug(name), slug(name)) for name in names.split(",")]
    for name in wanted:
        if name not in known:
            raise BadInput(option, name, f"choose from {', '.join(known)}")
    return wanted


def choose_methods(names: str | None, targets: Sequence[str]) -> list[Method]:
    """The methods that are asked for, feedback only first.

    Args:
        names: of methods of the benchmark, separated by commas; None: all of them.
        targets: classes that enter.

    Raises:
        BadInput: there is no such method, or two have the same name.
    """
    known = {slug(method.name): method for method in list_methods()}
    chosen = {known[name].name: known[name] for name in (slug(ALONE), *choose_names("--methods", names, known))}
    for method in map(enter, targets):
        if method.name in chosen:
            raise BadInput("--method", method.name, "a method of that name takes part already; rename the class")
        chosen[method.name] = method
    return list(chosen.values())
