"""What a manifest holds: the shape of every entry, and of the parts of a config that are read without simulating."""

import math
import re
from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from typing import Any, NamedTuple

from cmacexp.config import config_hash
from cmacexp.config.component import COMPONENTS
from cmacexp.config.machine import LEG_NAMES
from cmacexp.models.chain import CHAIN_FIELDS
from cmacexp.typing import ENDS, RESULTS

REPORT, SWEEP = "report", "sweep"
"""Kinds of manifests that name a report and its runs, or a sweep and how it ended; a run has no kind."""
MAX_STEPS_PER_CYCLE = 1 << 32


class ValueCheck(NamedTuple):
    """What a value must be."""

    words: str
    holds: Callable[[Any], bool]


Shape = ValueCheck | Mapping[str, Any] | list[Any]
"""A kind; entries by name (``name?``: may be missing; ``*``: every other one); or a list, each of the one shape."""


def _or_null(kind: ValueCheck) -> ValueCheck:
    return ValueCheck(f"{kind.words} or null", lambda value: value is None or kind.holds(value))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) != math.inf


def _of_legs(size: int) -> ValueCheck:
    def holds(value: Any) -> bool:
        rows = value if isinstance(value, list) else []
        return len(rows) == len(LEG_NAMES) and all(
            isinstance(row, list) and len(row) == size and all(map(_is_number, row)) for row in rows
        )

    return ValueCheck(f"{len(LEG_NAMES)} lists of {size} finite numbers", holds)


ANY = ValueCheck("anything", lambda value: True)
TEXT = ValueCheck("text", lambda value: isinstance(value, str))
FLAG = ValueCheck("true or false", lambda value: isinstance(value, bool))
FLOAT = ValueCheck("a number", lambda value: isinstance(value, float))
NUMBER = ValueCheck("a finite number", _is_number)
POSITIVE = ValueCheck("a number above 0", lambda value: _is_number(value) and value > 0)
WHOLE = ValueCheck("a whole number, at least 0", lambda value: type(value) is int and 0 <= value < 2**63)
COUNT = ValueCheck("a whole number, at least 1", lambda value: WHOLE.holds(value) and value > 0)
COUNTS = ValueCheck("a list of whole numbers", lambda value: isinstance(value, list) and all(map(COUNT.holds, value)))
HASH = ValueCheck("a SHA-256", lambda value: isinstance(value, str) and bool(re.fullmatch("[0-9a-f]{64}", value)))
OBJECT = {"*": ANY}

RUN_FIELDS = {
    "status": ValueCheck(f"one of {', '.join(ENDS)}", lambda value: isinstance(value, str) and value in ENDS),
    "config": OBJECT,
    "files": {"*": HASH},
    "versions": {"*": TEXT},
    "cause": _or_null(TEXT),
    "seed": ANY,
    "config_hash": HASH,
    "git_commit": _or_null(TEXT),
    "steps": WHOLE,
    "rollout_seconds": NUMBER,
    "processor_seconds?": NUMBER,
    "wall_seconds": NUMBER,
    "dropped": [{"leg": WHOLE, "step": WHOLE}],
    "memory": [
        {
            "rows": COUNT,
            "rows_used": WHOLE,
            "cells_visited": _or_null(WHOLE),
            "cells_colliding": _or_null(WHOLE),
            "clipped": WHOLE,
        }
    ],
    "drift": _or_null(ValueCheck("an object", lambda value: isinstance(value, dict))),
    "overrides?": [TEXT],
    "code_hash?": TEXT,
    "custom_code?": _or_null(HASH),
    "start_weights?": _or_null(HASH),
    "learning_lead?": NUMBER,
    "guard?": [{"cycle": COUNT, "step": WHOLE, "cause": TEXT, "restored": WHOLE}],
    "learning_rate?": NUMBER,
    "lead_estimates?": [{"cycle": COUNT, "lead": WHOLE}],
    "carried?": [
        {
            "cycle": COUNT,
            "measured_weight?": NUMBER,
            **dict.fromkeys(("weight", "x", "y", "slope_x", "slope_y"), NUMBER),
        }
    ],
    "robot?": {"chains": _of_legs(CHAIN_FIELDS), "hips": _of_legs(2), "foot_radius": NUMBER},
    "model_hash?": _or_null(HASH),
    "traceback?": TEXT,
    "bad_input?": FLAG,
}
"""Of a run. ``robot``: geometry of the legs, chains as in :mod:`cmacexp.models.chain`, hips in the body
frame (forward and left, m), radius of the feet (m)."""
SWEEP_FIELDS = {
    "status": TEXT,
    "config": {"record?": {"trace?": FLAG}},
    "files": {"*": HASH},
}
"""Of a sweep."""
DRIFT = {"cycle": WHOLE, "leg": WHOLE, "named": WHOLE, "growth": FLOAT}
LEG = {"length_1?": NUMBER, "length_2?": NUMBER, "hip_x?": NUMBER, "hip_y?": NUMBER}
CONFIG = {
    "scenario": TEXT,
    "sampling_period": POSITIVE,
    "cycles": COUNT,
    "gait": {"cycle_time": POSITIVE},
    "machine": {"kind": TEXT, "hip_height": NUMBER, "leg?": LEG, "legs?": {"*": LEG}},
    "terrain": {"stiffness": POSITIVE, "slope?": NUMBER, "slope_start": NUMBER},
    "learning": {"start_cycle": COUNT},
    "cmac": OBJECT,
    "record": {"trace?": FLAG, "every_nth_step": COUNT, "cycles": _or_null(COUNTS)},
    **{group: {"_target_": TEXT} for group in COMPONENTS},
}
"""Of the config of a run that took steps or has files: what readers use of it."""


def validate_value(value: Any, shape: Shape, name: str) -> str | None:
    """Which value, as read from JSON, does not have its shape, and what it must be; None: all have."""
    if isinstance(shape, ValueCheck):
        return None if shape.holds(value) else f"{name} must be {shape.words}"
    if isinstance(shape, list):
        if not isinstance(value, list):
            return f"{name} must be a list"
        inner = ((each, shape[0], f"{name}[{index}]") for index, each in enumerate(value))
    else:
        if not isinstance(value, dict):
            return f"{name} must be an object"
        required = {key: of for key, of in shape.items() if key[-1] not in "?*"}
        if missing := required.keys() - value.keys():
            return f"{name} has no {', '.join(sorted(missing))}"
        entries = (
            (key, each, shape.get(key, shape.get(f"{key}?", shape.get("*", ANY)))) for key, each in value.items()
        )
        inner = ((each, of, f"{name}.{key[:40]}") for key, each, of in entries)
    return next(filter(None, (validate_value(*each) for each in inner)), None)


def find_wrong(manifest: Any) -> str | None:
    """What is wrong with the content of a manifest, as read from its file; None: nothing."""
    kind = manifest.get("kind") if isinstance(manifest, dict) else None
    if kind == REPORT:
        return None  # for people: nothing else of it is read
    if wrong := validate_value(manifest, SWEEP_FIELDS if kind == SWEEP else RUN_FIELDS, "manifest"):
        return wrong
    for name in manifest["files"]:
        if not name or PurePosixPath(name).name != name or "\0" in name:
            return f"files must be names of files in its folder, not {name[:40]!r}"
    config = manifest["config"]
    if kind == SWEEP:
        return None
    if manifest["config_hash"] != config_hash(config):
        return "its config is not the one of its config_hash"
    if not (manifest["files"] or manifest["steps"]) and manifest["status"] not in RESULTS:
        return None  # of a job that failed the config can be anything
    if wrong := validate_value(config, CONFIG, "config"):
        return wrong
    if len(config["machine"].get("legs", ())) > len(LEG_NAMES):
        return f"config.machine.legs must be at most {len(LEG_NAMES)}"
    if not 0.5 < config["gait"]["cycle_time"] / config["sampling_period"] < MAX_STEPS_PER_CYCLE:
        return f"config.gait.cycle_time must have from 1 to {MAX_STEPS_PER_CYCLE} steps of config.sampling_period"
    return None if manifest["drift"] is None else validate_value(manifest["drift"], DRIFT, "manifest.drift")
