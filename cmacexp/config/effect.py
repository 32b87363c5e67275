"""Which values of a config have an effect: each field declares what it needs for that.

A need is evaluated and printed as it stands: ``payload.weight above 0``, ``learning.rule=leakage|zero_phase``. Terms
are joined by "and", alternatives by "or". A key that begins with a dot is one of the same group, and ``*`` in a key
stands for any part of it; a value can be another key.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import yaml

from cmacexp.config.component import COMPONENTS
from cmacexp.config.difference import flat
from cmacexp.config.folder import config_folder
from cmacexp.config.load import to_plain
from cmacexp.config.schema import Config

TERM = re.compile(r"(?P<key>[\w.*]+)(?P<relation>=|!=| above | below | at most )(?P<value>\S+)")
MODE = "hydra.mode"
"""Key of the mode of a command, RUN or MULTIRUN, in needs."""


class Effects(NamedTuple):
    """What a config holds, and what its fields need to have an effect."""

    values: Mapping[str, Any]
    """By dotted keys; of a component its option, by the key of its group, or the name of a custom class."""
    needs: Mapping[str, str]
    """Of fields and groups, by their keys; fields and groups without a need are missing."""

    def missing(self, key: str) -> str:
        """What ``key`` needs to have an effect and does not have; empty if it has an effect.

        Args:
            key: of a field, or of a group whose option is meant.
        """
        parts = key.split(".")
        needs = [self.needs.get(".".join(parts[:length]), "") for length in range(1, len(parts) + 1)]
        return " and ".join(dict.fromkeys(filter(None, map(self._unmet, needs))))

    def _unmet(self, need: str) -> str:
        """What a need lacks; of alternatives that of which most holds, or all of them if nothing does."""
        most, lacks = 0, need
        for alternative in need.split(" or ") if need else ():
            terms = alternative.split(" and ")
            unmet = [term for term in terms if not self._holds(term)]
            if not unmet:
                return ""
            if len(terms) - len(unmet) > most:
                most, lacks = len(terms) - len(unmet), " and ".join(unmet)
        return lacks

    def _holds(self, text: str) -> bool:
        """Whether the relation of a term holds for a value under its key."""
        term = TERM.fullmatch(text)
        assert term is not None, text
        keys = [key for key in self.values if fnmatchcase(key, term["key"])]
        return any(self._compare(key, term["relation"].strip(), term["value"]) for key in keys)

    def _compare(self, key: str, relation: str, text: str) -> bool:
        value = self.values[key]
        if key in COMPONENTS and not (config_folder() / key / f"{value}.yaml").exists():
            return True  # a custom component may use whatever it likes
        if relation in ("=", "!="):
            return (value in [yaml.safe_load(each) for each in text.split("|")]) == (relation == "=")
        bound = self.values[text] if text in self.values else float(text)
        try:
            return bool({"above": value > bound, "below": value < bound, "at most": value <= bound}[relation])
        except TypeError:
            return True


def read_effects(config: Config, more: Mapping[str, str], mode: str = "RUN") -> Effects:
    """What a config holds and what its fields need.

    Args:
        config: of the run.
        more: needs, by key, that are declared elsewhere than beside the fields.
        mode: of the command, see :data:`MODE`.
    """
    return Effects({**flat(to_plain(config)), MODE: mode}, {**dict(_needs(config, "")), **more})


def _needs(node: Any, key: str) -> Iterator[tuple[str, str]]:
    """Needs of a group and of all inside it, with full keys."""
    if own := getattr(type(node), "needs", ""):
        yield key, own
    for each in fields(node):
        place = f"{key}.{each.name}".lstrip(".")
        if need := each.metadata.get("needs", ""):
            yield place, re.sub(r"(?<![\w*])\.", f"{key}.", need)
        if is_dataclass(value := getattr(node, each.name)):
            yield from _needs(value, place)
