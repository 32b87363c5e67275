"""Warnings of what is typed and has no effect: nothing reads it, or the same key comes again."""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import DictConfig, OmegaConf

from cmacexp.cmac.rules import strength_needs
from cmacexp.config import Config, to_config
from cmacexp.config.effect import Effects, read_effects
from cmacexp.errors import CmacexpError, format_value

HYDRA_GROUP = "hydra"
"""First part of keys that are Hydra's, not the run's."""


class Typed(NamedTuple):
    """A value that was typed for a key."""

    key: str
    value: Any
    text: str
    """The whole override."""


def read_typed(overrides: Sequence[str]) -> list[Typed]:
    """The values that overrides set, in their order; a dictionary sets each of its fields."""
    parsed = OverridesParser.create().parse_overrides(list(overrides))
    found = []
    for override in parsed:
        key = override.key_or_group
        own = re.split(r"[./@]", key)[0] != HYDRA_GROUP
        if own and not override.is_delete() and not override.is_sweep_override():
            found += [
                Typed(place, value, str(override.input_line)) for place, value in _leaves(key, override.value())
            ]
    return found


def _leaves(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict) and value:
        for name, inner in value.items():
            yield from _leaves(f"{key}.{name}", inner)
    else:
        yield key, value


def _effects(config: Config, mode: str) -> Effects:
    """What a config holds and what its fields need, those of the learning rules included."""
    return read_effects(config, strength_needs(), mode)


def _reason(key: str, effects: Effects, composed: DictConfig) -> str:
    """Why a key has no effect; empty if it has one, if only where it is interpolated."""
    group = key.partition(".")[0]
    known = any(each == key or each.startswith(f"{key}.") for each in effects.values)
    reason = f"needs {missing}" if (missing := effects.missing(key)) else ""
    if not known and group in effects.values and not key.endswith("._target_"):
        reason = f"{group}={effects.values[group]} does not take it"
    used = reason and f"${{{key}}}" in str(OmegaConf.to_container(composed, resolve=False))
    return "" if used else reason


def warnings_of(config: Config, overrides: Sequence[str], composed: DictConfig) -> list[str]:
    """A line for each override of a single run that has no effect; none if the config has ``warn: false``.

    Args:
        config: of the run.
        overrides: as typed.
        composed: what Hydra composed of them.
    """
    typed = read_typed(overrides) if config.warn else []
    effects = _effects(config, "RUN") if typed else Effects({}, {})
    found: dict[str, str] = {}
    for i, (key, _, text) in enumerate(typed):
        later = next((each.text for each in typed[i + 1 :] if each.key == key), None)
        if reason := f"{later} comes after it" if later else _reason(key, effects, composed):
            found[text] = reason
    return [f"{format_value(text)} has no effect: {reason}" for text, reason in found.items()]


def warnings_of_sweep(kinds: Iterable[tuple[DictConfig, Sequence[Sequence[str]]]]) -> list[str]:
    """A line for each key that has an effect in no job of a sweep.

    Args:
        kinds: jobs that differ in values alone: what Hydra composed for the first, and the overrides of each.
    """
    found: dict[str, str] = {}
    for composed, jobs in kinds:
        plain = OmegaConf.masked_copy(composed, [str(key) for key in composed if key != HYDRA_GROUP])
        try:
            config = to_config(plain)
        except CmacexpError:  # its jobs say what is wrong
            return []
        if not config.warn:
            return []
        effects, keys = _effects(config, "MULTIRUN"), dict.fromkeys(each.key for each in read_typed(jobs[0]))
        for overrides in jobs:
            if not (keys := {key: None for key in keys if found.get(key) != ""}):
                break
            typed = read_typed(overrides)
            own = effects._replace(values={**effects.values, **{each.key: each.value for each in typed}})
            for key in keys:
                found[key] = _reason(key, own, plain)
    return [f"{key} has no effect in any job: {reason}" for key, reason in found.items() if reason]
