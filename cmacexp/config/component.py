"""Plant, sensors, controller and feedforward in a config: the fields that the class of each takes."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from omegaconf import DictConfig, OmegaConf

from cmacexp.config.cmac import ACTS
from cmacexp.config.folder import config_folder
from cmacexp.config.schema import Config
from cmacexp.config.targets import NEW_NAMES
from cmacexp.errors import BadInput, suggest

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
        """Check what no field shows alone, against each other and against the rest of the run.

        Raises:
            BadInput: names the key, the value and what is allowed.
        """


@dataclass
class FeedforwardConfig(ComponentConfig):
    """Fields of a feedforward that acts from ``learning.start_cycle`` on."""

    needs: ClassVar[tuple[str, ...]] = ACTS


@cache
def find_option(group: str, target: str) -> str:
    """The option of a group that makes the class ``target``, else the name of the class."""
    target = NEW_NAMES.get(target, target)
    for path in sorted((config_folder() / group).glob("*.yaml")):
        option = OmegaConf.load(path)
        if isinstance(option, DictConfig) and target in (
            option.get("_target_"),
            OmegaConf.select(option, f"{group}._target_"),
        ):
            return path.stem
    return target.rpartition(".")[2]


def is_shipped(group: str, option: str) -> bool:
    """Whether this package has an option of that name."""
    return (config_folder() / group / f"{option}.yaml").exists()


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
    if inspect.isbuiltin(component) or any(each.kind == each.VAR_KEYWORD for each in parameters):
        return None
    named = [each for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
    return {each.name: each.default is each.empty for each in named}


def _fields_set(path: Path, group: str) -> set[str]:
    """Fields of ``group`` that a shipped option, and those that it builds on, set."""
    option: Any = OmegaConf.load(path)
    own = option if path.parent.name == group and group not in option else option.get(group, {})
    bases = [each for each in option.get("defaults", []) if isinstance(each, str) and each != "_self_"]
    inherited = [_fields_set(path.with_name(f"{base}.yaml"), group) for base in bases]
    return {str(name) for name in own if name not in ("_target_", "defaults")}.union(*inherited)


def _fields_of_options(group: str, choices: Mapping[str, str] | None) -> set[str]:
    """Fields of ``group`` that the option chosen for it has, or that a scenario or plant sets in it.

    Args:
        group: of a component.
        choices: the option of each group; None: not known.
    """
    conf = config_folder()
    options = (conf / group).glob("*.yaml" if choices is None else f"{choices.get(group)}.yaml")
    others = [*(conf / "scenario").glob("*.yaml"), *(conf / "for_plant").glob("*.yaml")]
    return set().union(*(_fields_set(path, group) for path in [*options, *others]))


def fit_fields(
    group: str, node: Mapping[str, Any], component: Callable[..., object], choices: Mapping[str, str] | None
) -> dict[str, Any]:
    """A config node without the fields that its class does not take, where they stem from the option it replaces.

    Args:
        group: of the component.
        node: its ``_target_`` and fields.
        component: the class that it names.
        choices: the option of each group; None: not known, so that fields of any option of the group may remain.

    Raises:
        BadInput: the class does not take a field, or needs one that is missing.
    """
    taken = _fields_taken(component)
    if taken is None:
        return dict(node)
    given = [name for name in node if name != "_target_"]
    unknown = [name for name in given if name not in taken]
    unused = _fields_of_options(group, choices) if unknown else set()
    takes = f"{node['_target_']} takes {', '.join(taken) or 'no fields'}"
    for name in unknown:
        if name not in unused:
            raise BadInput(f"{group}.{name}", node[name], takes + suggest(name, taken))
    for name, required in taken.items():
        if required and name not in given:
            raise BadInput(f"{group}.{name}", "(not set)", f"{takes}: give it one with +{group}.{name}=VALUE")
    return {name: value for name, value in node.items() if name not in unknown}
