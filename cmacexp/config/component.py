"""Plant, sensors, controller and feedforward in a config: the fields that the class of each takes."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from omegaconf import DictConfig, OmegaConf

from cmacexp.config.cmac import ACTS
from cmacexp.config.folder import config_folder
from cmacexp.config.schema import Config
from cmacexp.config.targets import NEW_NAMES
from cmacexp.errors import BadInput, suggest

COMPONENTS = ("plant", "sensors", "controller", "feedforward")
"""Groups that name a class by ``_target_``."""
HYDRAS = ("_target_", "_args_", "_partial_", "_recursive_", "_convert_")
"""Keys that say to Hydra what to call, and how."""


class MemoryNeed(NamedTuple):
    """Memory that a component needs beyond that of plan and loop."""

    bytes: float = 0.0
    """The most at a time."""
    key: str = ""
    """Of the field that decides it, and its value."""
    value: object = None


@dataclass
class ComponentConfig:
    """Fields of a component. Its class carries a subclass of this as ``Config``, and takes the fields by their names.

    Values are then converted to the types of the fields and checked against their ranges.
    """

    _target_: str
    draws: ClassVar[bool] = False
    """Whether the component draws random numbers, for all that its own fields say."""

    def check(self, config: Config) -> None:
        """Check what no field shows alone, against each other and against the rest of the run.

        Raises:
            BadInput: names the key, the value and what is allowed.
        """

    def memory_need(self, config: Config) -> MemoryNeed:
        """Memory that the component will need, where it can be a large part of all."""
        return MemoryNeed()


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
    """The config class that a component carries itself; one that it inherits need not fit its constructor."""
    own = vars(component).get("Config") if inspect.isclass(component) else None
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


def _require_plain(key: str, value: object) -> None:
    """Require that no field names a class or a function, which Hydra would call.

    Raises:
        BadInput: names the field.
    """
    if isinstance(value, Mapping):
        for name, inner in value.items():
            if name in HYDRAS:
                allowed = f"cannot stand in a field of a component; only {', '.join(COMPONENTS)} name a class"
                raise BadInput(f"{key}.{name}", inner, allowed)
            _require_plain(f"{key}.{name}", inner)
    elif isinstance(value, list | tuple):
        for i, inner in enumerate(value):
            _require_plain(f"{key}[{i}]", inner)


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
    _require_plain(group, {name: value for name, value in node.items() if name != "_target_"})
    taken = _fields_taken(component)
    if taken is None:
        return dict(node)
    given = [name for name in node if not (name.startswith("_") and name.endswith("_"))]
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
