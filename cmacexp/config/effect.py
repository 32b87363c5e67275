"""Why a field of a config has no effect: each field declares beside it what it ``needs`` for that.

A need is an expression of Python over the config, which is evaluated and printed, e.g. ``own.weight > 0``: ``own`` is
the group of the field, ``option`` holds the options of plant, sensors, controller and feedforward.
"""

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from types import SimpleNamespace
from typing import Any

from cmacexp.config.component import COMPONENTS, find_option
from cmacexp.config.folder import config_folder
from cmacexp.config.load import to_plain
from cmacexp.config.schema import Config


def explain_idle(config: Config, key: str, more: Sequence[str] = (), mode: str = "RUN") -> str:
    """Why a key has no effect; empty if it has one.

    Args:
        config: of the run.
        key: of a field, or of a group whose option is meant.
        more: needs of the key that are declared elsewhere than beside the field.
        mode: of the command, RUN or MULTIRUN.
    """
    plain = to_plain(config)
    options = {group: find_option(group, plain[group]["_target_"]) for group in COMPONENTS}
    group, _, rest = key.partition(".")
    if group in COMPONENTS and rest and rest.split(".")[0] not in plain[group]:
        return f"{group}={options[group]} does not take it"
    shipped = {name: o for name, o in options.items() if (config_folder() / name / f"{o}.yaml").exists()}
    names = {**vars(config), "option": SimpleNamespace(**shipped), "hydra": SimpleNamespace(mode=mode)}
    unmet = [need for need in dict.fromkeys((*_needs(config, key), *more)) if not _holds(need, names)]
    return "needs " + " and ".join(unmet).replace("option.", "") if unmet else ""


def _needs(node: Any, key: str) -> Iterator[str]:
    """What is declared of a field and of the groups that it is in, the outermost first."""
    own = ""
    for name in key.split("."):
        declared = [each.metadata for each in fields(node) if each.name == name] if is_dataclass(node) else []
        for metadata in declared:
            yield from (need.replace("own.", f"{own}.") for need in metadata.get("needs", ()))
        node, own = getattr(node, name, None), f"{own}.{name}".lstrip(".")
        yield from (need.replace("own.", f"{own}.") for need in getattr(type(node), "needs", ()))


def _holds(need: str, names: dict[str, Any]) -> bool:
    """Whether a need is met; a custom component, which has no option and perhaps no such field, may use anything."""
    try:
        return bool(eval(need, {}, names))
    except (AttributeError, TypeError):
        return True
