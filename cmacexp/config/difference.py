"""How runs differ: the keys in which their configs differ, as they are typed on the command line."""

from collections.abc import Mapping, Sequence
from typing import Any

from cmacexp.config.component import COMPONENTS, find_option
from cmacexp.config.load import select_effective

MOST_KEYS = 3
"""Runs that differ in more keys are labelled by the names of their folders."""


def flatten_config(config: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """A config as dotted keys, which begin with ``before``; a ``_target_`` as its group with its option."""
    found: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping):
            found |= flatten_config(value, f"{before}{key}.")
        elif key == "_target_" and before[:-1] in COMPONENTS:
            found[before[:-1]] = find_option(before[:-1], value)
        else:
            found[before + key] = value
    return found


def differences(configs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """For each config, the keys in which not all of them agree, with its values; without keys that it lacks."""
    flats = [flatten_config(select_effective(config)) for config in configs]
    keys = list(dict.fromkeys(key for each in flats for key in each))
    differing = [key for key in keys if any(key not in each or each[key] != flats[0].get(key) for each in flats)]
    return [{key: each[key] for key in differing if key in each} for each in flats]


def _text(value: Any) -> str:
    if isinstance(value, list):
        return f"[{','.join(map(_text, value))}]"
    return "null" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def labels(configs: Sequence[Mapping[str, Any]], names: Sequence[str]) -> list[str]:
    """A name for each of several runs: the values in which they differ, else the name of its folder."""
    differing = differences(configs)
    scenarios = [str(config["scenario"]) for config in configs]
    if len(set(scenarios)) == len(configs):
        return scenarios
    found = [" ".join(f"{key}={_text(value)}" for key, value in each.items()) for each in differing]
    if max(map(len, differing)) > MOST_KEYS or len(set(found)) < len(found):
        return list(names)
    return found
