"""A config that was composed once, from which those with other values are made: Hydra takes 0.14 s to compose one."""

import pickle
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import cached_property, lru_cache
from typing import Any

from omegaconf import DictConfig, OmegaConf

from cmacexp.config.robot_rule import READ

VALUE = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*=[^{?]*")
"""An override that sets a value, which refers to no other, is not missing, and is not merged with what there is."""
_NUMBER = re.compile(r"([a-z]\w*(?:\.\w+)*)=(-?(?:0|[1-9]\d*)(\.\d+)?(e-?\d+)?)")
"""One that sets a number: its key, the number, its fraction and its exponent, with which it is a float."""


class NeedsHydra(Exception):
    """An override does more than to set a value, or is a mistake: Hydra itself must compose it."""


@lru_cache(4096)
def parse_override(override: str) -> Any:
    """What Hydra reads in an override."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    return OverridesParser.create().parse_overrides([override])[0]


class ConfigTemplate:
    """What was composed once, in which the values of other configs are set, in a copy: pickled, it is copied fastest.

    Args:
        composed: a config, without Hydra's own part.
    """

    def __init__(self, composed: DictConfig):
        plain: Any = OmegaConf.to_container(composed, enum_to_str=True)
        self.referred = _find_referred(plain)
        """Groups, and keys without one, from which other values follow; None if that is not known."""
        self._composed, self._plain = composed, pickle.dumps(plain)

    @cached_property
    def _resolved(self) -> bytes:
        """The config without interpolations; empty if it cannot be resolved, or is not to be changed without that."""
        if self.referred is not None:
            with suppress(Exception):  # of a rule, for example: with other values it may be resolved
                plain = OmegaConf.to_container(self._composed, resolve=True, throw_on_missing=True)
                return pickle.dumps(plain)
        return b""

    def set(self, overrides: Iterable[str]) -> dict[str, Any]:
        """The config with values set, plain and as typed, with interpolations; raises NeedsHydra."""
        return _set_values(self._plain, overrides)

    def resolve(self, overrides: Sequence[str]) -> dict[str, Any] | DictConfig:
        """The same as :func:`cmacexp.config.to_config` takes it; OmegaConf resolves it only if values follow."""
        groups = {re.split(r"[.=]", text.lstrip("+"), maxsplit=1)[0] for text in overrides}
        if groups.isdisjoint(self.referred or ()) and self._resolved:
            return _set_values(self._resolved, overrides)
        return OmegaConf.create(self.set(overrides))


def _find_referred(config: dict[str, Any]) -> frozenset[str] | None:
    """From what in a plain config other values follow."""
    references = re.findall(r"\$\{([^}]*)", str(config))
    if not all(re.fullmatch(r"rule:\w+|[a-z]\w*\.[\w.]+", name) for name in references):
        return None
    return frozenset().union(*(READ if name[:5] == "rule:" else {name.partition(".")[0]} for name in references))


def _set_values(packed: bytes, overrides: Iterable[str]) -> dict[str, Any]:
    """A pickled plain config with values set as Hydra sets them; raises NeedsHydra."""
    config: dict[str, Any] = pickle.loads(packed)
    for text in overrides:
        (*path, name), value, exists = _read_value(text)
        owner: Any = config
        for key in path:
            owner = owner.get(key) if isinstance(owner, dict) else None
        if not isinstance(owner, dict) or exists not in (None, name in owner):
            raise NeedsHydra(text)
        owner[name] = value
    return config


def _read_value(override: str) -> tuple[list[str], Any, bool | None]:
    """The key of an override, its value, and whether the key must exist; None: it may. Raises NeedsHydra.

    Of numbers, in which most runs differ, that takes a twentieth of the time of Hydra's grammar.
    """
    if number := _NUMBER.fullmatch(override):
        is_float = number[3] or number[4]
        return number[1].split("."), float(number[2]) if is_float else int(number[2]), True
    read = parse_override(override)
    if read.is_sweep_override() or not VALUE.fullmatch(override.lstrip("+")):
        raise NeedsHydra(override)
    return read.key_or_group.split("."), read.value(), None if read.is_force_add() else not read.is_add()
