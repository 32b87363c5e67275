"""Plant, sensors, controller and feedforward in a config: the fields that the class of each takes."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from omegaconf import DictConfig, OmegaConf

from cmacexp.config.cmac import NEEDS_ACTING
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput, suggest


@cache
def config_folder() -> Path:
    """The folder of the shipped configs: inside an installed package, else at the top of the checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "conf"
    return inside if inside.is_dir() else package.parent / "conf"


COMPONENTS = ("plant", "sensors", "controller", "feedforward")
"""Groups that name a class by ``_target_``."""


@dataclass
class ComponentConfig:
    """Fields of a component, converted to their types and checked against their ranges.

    Its class carries a subclass of this as ``Config`` and is made with an object of it: ``Class(config=...)``.
    """

    _target_: str = field(default="", kw_only=True)
    draws: ClassVar[bool] = False
    """Whether the component draws random numbers, for all that its own fields say."""

    def check(self, config: Config) -> None:
        """Check what no field shows alone, against each other and the rest of the run; raises BadInput."""


@dataclass
class FeedforwardConfig(ComponentConfig):
    """Fields of a feedforward that acts from ``learning.start_cycle`` on."""

    needs: ClassVar[tuple[str, ...]] = NEEDS_ACTING


@cache
def find_option(group: str, target: str) -> str:
    """The option of a group that makes the class ``target``, else the name of the class."""
    for path in sorted((config_folder() / group).glob("*.yaml")):
        option = OmegaConf.load(path)
        if isinstance(option, DictConfig) and target in (
            option.get("_target_"),
            OmegaConf.select(option, f"{group}._target_"),
        ):
            return path.stem
    return target.rpartition(".")[2]


def config_class(component: Callable[..., object]) -> type[ComponentConfig] | None:
    """The config class that a component carries, if only because it inherits it; ``Config = None``: none."""
    own = getattr(component, "Config", None)
    return own if inspect.isclass(own) and issubclass(own, ComponentConfig) else None


def _fields_taken(component: Callable[..., object]) -> dict[str, bool] | None:
    """Names of the fields that a component takes, and whether each is required; None: it may take any."""
    if (schema := config_class(component)) is not None:
        return {each.name: each.default is MISSING for each in fields(schema) if each.name != "_target_"}
    try:
        parameters = inspect.signature(component).parameters.values()
    except (TypeError, ValueError):  # a class that is not written in Python
        return None
    if any(each.kind == each.VAR_KEYWORD for each in parameters):
        return None
    named = [each for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
    return {each.name: each.default is each.empty for each in named}


@cache
def _fields_of_options(group: str) -> set[str]:
    """Fields of ``group`` that some option of it has, or that a scenario or plant sets in it."""
    names: set[str] = set()
    for folder in (group, "scenario", "for_plant"):
        for path in (config_folder() / folder).glob("*.yaml"):
            option: Any = OmegaConf.load(path)
            names.update(option if folder == group else option.get(group, {}))
    return names - {"_target_", "defaults"}


def select_accepted_fields(group: str, node: Mapping[str, Any], component: Callable[..., object]) -> dict[str, Any]:
    """A config node without the fields of options that its class does not take: it may have replaced an option.

    Raises BadInput if a field is of no option and the class does not take it, or if one that it needs is missing.
    """
    taken = _fields_taken(component)
    if taken is None:
        return dict(node)
    unknown = [name for name in node if name not in taken and name != "_target_"]
    takes = f"{node['_target_']} takes {', '.join(taken) or 'no fields'}"
    for name in unknown:
        if name not in _fields_of_options(group):
            raise BadInput(f"{group}.{name}", node[name], takes + suggest(name, taken))
    for name, required in taken.items():
        if required and name not in node:
            raise BadInput(f"{group}.{name}", "(not set)", f"{takes}: give it one with +{group}.{name}=VALUE")
    return {name: value for name, value in node.items() if name not in unknown}
