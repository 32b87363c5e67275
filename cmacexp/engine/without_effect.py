"""Warnings of what is typed and has no effect: nothing reads it, or the same key comes again.

Each field declares beside it what it ``needs`` to have an effect: an expression of Python over the config, which is
evaluated and printed, e.g. ``own.weight > 0``. ``own`` is the group of the field, ``option`` holds the options of
plant, sensors, controller and feedforward.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from types import SimpleNamespace
from typing import Any

from omegaconf import DictConfig, OmegaConf

from cmacexp.cmac.rules import strength_needs
from cmacexp.config import Config
from cmacexp.config.component import COMPONENTS, config_folder, find_option
from cmacexp.config.compose import parse_override
from cmacexp.config.load import to_plain
from cmacexp.errors import format_value


def explain_idle(config: Config, key: str, more: Sequence[str] = ()) -> str:
    """Why the key of a field, or of a group whose option is meant, has no effect; empty if it has one.

    ``more`` needs of the key are declared elsewhere than beside the field.
    """
    plain = to_plain(config)
    options = {group: find_option(group, plain[group]["_target_"]) for group in COMPONENTS}
    group, _, rest = key.partition(".")
    if group in COMPONENTS and rest and rest.split(".")[0] not in plain[group]:
        return f"{group}={options[group]} does not take it"
    shipped = {name: o for name, o in options.items() if (config_folder() / name / f"{o}.yaml").exists()}
    names = {**vars(config), "option": SimpleNamespace(**shipped), "hydra": SimpleNamespace(mode="RUN")}
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


def read_keys(overrides: Sequence[str]) -> Iterator[tuple[str, str]]:
    """The keys that overrides set, in their order, each with its override; a dictionary sets each of its fields."""
    for override in map(parse_override, overrides):
        own = re.split(r"[./@]", override.key_or_group)[0] != "hydra"
        if own and not override.is_delete() and not override.is_sweep_override():
            for key in _leaves(override.key_or_group, override.value()):
                yield key, str(override.input_line)


def _leaves(key: str, value: Any) -> Iterator[str]:
    if isinstance(value, dict) and value:
        for name, inner in value.items():
            yield from _leaves(f"{key}.{name}", inner)
    else:
        yield key


def list_idle_overrides(config: Config, overrides: Sequence[str], composed: DictConfig) -> list[str]:
    """A line for each override of a single run that has no effect; none if the config has ``warn: false``."""
    typed = list(read_keys(overrides)) if config.warn else []
    found, unresolved = dict[str, str](), str(OmegaConf.to_container(composed, resolve=False))
    for i, (key, text) in enumerate(typed):
        later = next((other for again, other in typed[i + 1 :] if again == key), None)
        reason = f"{later} comes after it" if later else explain_idle(config, key, strength_needs(key))
        if reason and (later or f"${{{key}}}" not in unresolved):  # else it has an effect where it is interpolated
            found[text] = reason
    return [f"{format_value(text)} has no effect: {reason}" for text, reason in found.items()]
