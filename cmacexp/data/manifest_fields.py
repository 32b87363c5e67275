"""What a manifest holds: the kind of value of every entry, and the entries that must not be missing."""

import re
from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from typing import Any, NamedTuple

from cmacexp.config import config_hash

REPORT, SWEEP = "report", "sweep"
"""Kinds of manifests that list a report and the runs of its numbers, or the tables of a sweep; a run has no kind."""


class Kind(NamedTuple):
    """What an entry must be."""

    words: str
    holds: Callable[[Any], bool]

    def or_null(self) -> "Kind":
        """Likewise, or null."""
        return Kind(f"{self.words} or null", lambda value: value is None or self.holds(value))

    def listed(self) -> "Kind":
        """A list of such values."""
        words = f"a list, each {self.words}"
        return Kind(words, lambda value: isinstance(value, list) and all(map(self.holds, value)))

    def named(self) -> "Kind":
        """Such values by name."""
        words = f"an object, each {self.words}"
        return Kind(words, lambda value: isinstance(value, dict) and all(map(self.holds, value.values())))


def make_record(fields: Mapping[str, Kind]) -> Kind:
    """An object with these entries and no other."""
    words = ", ".join(f"{name} ({kind.words})" for name, kind in fields.items())

    def holds(value: Any) -> bool:
        return isinstance(value, dict) and {*value} == {*fields} and all(fields[n].holds(value[n]) for n in fields)

    return Kind(f"an object of {words}", holds)


ANY = Kind("anything", lambda value: True)
TEXT = Kind("text", lambda value: isinstance(value, str))
FLAG = Kind("true or false", lambda value: isinstance(value, bool))
NUMBER = Kind("a number", lambda value: isinstance(value, int | float) and not isinstance(value, bool))
WHOLE = Kind("a whole number from 0", lambda value: type(value) is int and value >= 0)
HASH = Kind("a SHA-256", lambda value: isinstance(value, str) and bool(re.fullmatch("[0-9a-f]{64}", value)))
CHOICE = Kind(f"{REPORT} or {SWEEP}", lambda value: value in (REPORT, SWEEP))
ROBOT = make_record({"chains": NUMBER.listed().listed(), "hips": NUMBER.listed().listed(), "foot_radius": NUMBER})
"""Geometry of a robot's legs, from its model: chains as in :mod:`cmacexp.models.chain`, hips in the body frame
(forward and left, m), radius of the feet (m)."""

FIELDS = {
    "kind": CHOICE,
    "status": TEXT,
    "cause": TEXT.or_null(),
    "seed": ANY,
    "config": ANY.named(),
    "config_hash": HASH,
    "versions": TEXT.named(),
    "git_commit": TEXT.or_null(),
    "steps": WHOLE,
    "rollout_seconds": NUMBER,
    "wall_seconds": NUMBER,
    "files": HASH.named(),
    "dropped": NUMBER.named().listed(),
    "memory": NUMBER.or_null().named().listed(),
    "code_hash": TEXT,
    "start_weights": HASH.or_null(),
    "learning_lead": ANY,
    "drift": NUMBER.named().or_null(),
    "robot": ROBOT,
    "model_hash": HASH.or_null(),
    "traceback": TEXT,
    "bad_input": FLAG,
    "key": TEXT,
    "runs": TEXT.named(),
}
REQUIRED = ("status", "config", "files")
REQUIRED_OF_A_RUN = ("config_hash", "versions", "git_commit", "steps", "rollout_seconds", "wall_seconds", "seed")
LATER: Mapping[str, Any] = {"dropped": [], "memory": [], "drift": None}
"""Entries of a run that the first versions did not write."""


def _is_place(name: str, outside: bool) -> bool:
    """Whether ``name`` can be that of a file: relative, and below the folder unless it may lie ``outside``."""
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and "\0" not in name and (outside or ".." not in path.parts)


def find_wrong(manifest: object, complete: bool) -> str | None:
    """What is wrong with the content of a manifest; None: nothing.

    Args:
        manifest: as read from its file, without its checksum.
        complete: whether it may have entries that this version does not know; not the manifest of an earlier one.
    """
    if not isinstance(manifest, dict):
        return "must be an object"
    required = REQUIRED if "kind" in manifest else (*REQUIRED, *REQUIRED_OF_A_RUN)
    if missing := [key for key in required if key not in manifest]:
        return f"it has no {', '.join(missing)}"
    for key, value in manifest.items():
        if key not in FIELDS and not complete:
            return f"it has an unknown entry {key[:40]!r}"
        if key in FIELDS and not FIELDS[key].holds(value):
            return f"{key} must be {FIELDS[key].words}"
    return _find_contradiction(manifest)


def _find_contradiction(manifest: Mapping[str, Any]) -> str | None:
    """Entries that are of the right kind but cannot belong together."""
    is_run = "kind" not in manifest
    for name in manifest["files"]:
        if not _is_place(name, outside=not is_run):
            return f"files must be names of files in its folder, not {name[:40]!r}"
    if not is_run:
        return None
    if manifest["config_hash"] != config_hash(manifest["config"]):
        return "its config is not the one of its config_hash"
    if manifest["files"] and not isinstance(manifest["config"].get("record"), dict):
        return "config.record must be an object"
    return None
