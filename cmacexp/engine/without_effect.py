"""Warnings of what is typed and has no effect: nothing reads it, or the same key comes again.

Each field declares beside it what it ``needs`` to have an effect: an expression of Python over the config, which is
evaluated and printed, e.g. ``own.weight > 0``. ``own`` is the group of the field, ``option`` holds the options of
plant, sensors, controller and feedforward.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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
    """Explain why the key of a field or a group has no effect; empty if it has one.

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
    """Yield the needs declared for a field and for the groups that hold it, outermost first."""
    group = ""
    for name in key.split("."):
        is_group = is_dataclass(node)
        for declared in fields(node) if is_group else ():
            if declared.name == name:
                yield from (need.replace("own.", f"{group}.") for need in declared.metadata.get("needs", ()))
        node = vars(node).get(name) if is_group else None
        group = f"{group}.{name}".lstrip(".")
        yield from (need.replace("own.", f"{group}.") for need in getattr(type(node), "needs", ()))


def _holds(need: str, names: dict[str, Any]) -> bool:
    """Return whether a need is met; a custom component, which declares none, may use any key."""
    try:
        return bool(eval(need, {}, names))
    except (AttributeError, TypeError):
        return True


def read_keys(overrides: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the keys that overrides set, each with its override; a dictionary sets each of its fields."""
    for override in map(parse_override, overrides):
        is_of_run = re.split(r"[./@]", override.key_or_group)[0] != "hydra"
        if is_of_run and not override.is_delete() and not override.is_sweep_override():
            for key in _leaves(override.key_or_group, override.value()):
                yield key, str(override.input_line)


def _leaves(key: str, value: Any) -> Iterator[str]:
    if isinstance(value, dict) and value:
        for name, inner in value.items():
            yield from _leaves(f"{key}.{name}", inner)
    else:
        yield key


def list_idle_overrides(config: Config, overrides: Sequence[str], composed: DictConfig) -> list[str]:
    """List a line for each override of a single run without effect; none if the config has ``warn: false``."""
    idle = _find_idle(config, overrides, lambda: composed) if config.warn else {}
    return [f"{format_value(text)} has no effect: {reason}" for text, reason in idle.items()]


def _find_idle(config: Config, overrides: Sequence[str], compose: Callable[[], DictConfig]) -> dict[str, str]:
    """Find the overrides without effect, each with the reason; ``compose`` gives the config with interpolations."""
    idle = dict[str, str]()
    keys = list(read_keys(overrides))
    for i, (key, text) in enumerate(keys):
        later = next((other for again, other in keys[i + 1 :] if again == key), None)
        if later:
            idle[text] = f"{later} comes after it"
        elif reason := explain_idle(config, key, strength_needs(key)):
            unresolved = str(OmegaConf.to_container(compose(), resolve=False))
            if f"${{{key}}}" not in unresolved:  # else it has an effect where it is interpolated
                idle[text] = reason
    return idle


class IdleKeys:
    """Keys without effect in some of many runs, which one process makes one after the other.

    A key that had an effect in one run is not looked at again: only one without effect in all runs is reported.
    """

    def __init__(self) -> None:
        self._effective = set[str]()

    def find(self, config: Config, overrides: Sequence[str], compose: Callable[[], DictConfig]) -> dict[str, str]:
        """Find the keys that have no effect in a run, each with the reason; ``compose`` as Hydra does it."""
        unknown = [text for text in overrides if read_key(text) not in self._effective]
        if not unknown or not config.warn:
            return {}
        idle = {read_key(text): reason for text, reason in _find_idle(config, unknown, compose).items()}
        self._effective.update({*map(read_key, unknown)} - idle.keys())
        return idle


def read_key(override: str) -> str:
    """Read the key of an override."""
    return override.lstrip("+").partition("=")[0]


class IdleReport:
    """Keys without effect in all of many runs that set them."""

    def __init__(self) -> None:
        self._effective = set[str]()
        self._reasons = dict[str, tuple[int, str]]()

    def add(self, number: int, keys: Iterable[str], idle: Mapping[str, str]) -> None:
        """Add the run with this number: the keys that it sets, and those without effect, each with the reason."""
        self._effective.update({*keys} - idle.keys())
        for key, reason in idle.items():
            self._reasons[key] = min((number, reason), self._reasons.get(key, (number, reason)))

    def list_lines(self) -> Iterator[str]:
        """List a line for each key without effect, in the order of the first runs that set them."""
        for key, (_, reason) in sorted(self._reasons.items(), key=lambda item: item[1][0]):
            if key not in self._effective:
                yield f"{key} has no effect: {reason}"
