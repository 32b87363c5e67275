"""What a manifest holds: the shape of every entry, and of the parts of a config that are read without simulating.

A shape is a type, a range of whole numbers, a :class:`Number`, a pattern of a text, a list of which each item has the
one shape, a tuple of the shapes of its items, or entries by name: ``name?`` may be missing, ``*`` stands for every
other name.
"""

import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import cycle
from pathlib import PurePosixPath
from typing import Any

from cmacexp.config import config_hash
from cmacexp.config.component import COMPONENTS
from cmacexp.config.machine import LEG_KEYS
from cmacexp.models.chain import CHAIN_FIELDS
from cmacexp.typing import ENDS, RESULTS

REPORT, SWEEP = "report", "sweep"
"""Kinds of manifests that name a report and its runs, or a sweep and how it ended; a run has no kind."""
MAX_STEPS_PER_CYCLE = 1 << 32


@dataclass(frozen=True)
class Number:
    """The shape of a number that is not infinite: NaN too, unless it must be at least ``low``."""

    low: float | None = None


NUMBER = Number()
POSITIVE = Number(sys.float_info.min)
WHOLE = range(2**63)
COUNT = range(1, 2**63)
HASH = re.compile("[0-9a-f]{64}")
RUN_FIELDS = {
    "status": re.compile("|".join(ENDS)),
    "config": dict,
    "files": {"*": HASH},
    "versions": {"*": str},
    "cause": str | None,
    "seed": object,
    "config_hash": HASH,
    "git_commit": str | None,
    "steps": WHOLE,
    "rollout_seconds": NUMBER,
    "processor_seconds?": NUMBER,
    "wall_seconds": NUMBER,
    "dropped": [{"leg": WHOLE, "step": WHOLE}],
    "memory": [
        {
            "rows": COUNT,
            "rows_used": WHOLE,
            "cells_visited": int | None,
            "cells_colliding": int | None,
            "clipped": WHOLE,
        }
    ],
    "drift": dict | None,
    "overrides?": [str],
    "code_hash?": str,
    "custom_code?": str | None,
    "start_weights?": str | None,
    "learning_lead?": NUMBER,
    "guard?": [{"cycle": COUNT, "step": WHOLE, "cause": str, "restored": WHOLE}],
    "learning_rate?": NUMBER,
    "lead_estimates?": [{"cycle": COUNT, "lead": WHOLE}],
    "carried?": [
        {
            "cycle": COUNT,
            "measured_weight?": NUMBER,
            **dict.fromkeys(("weight", "x", "y", "slope_x", "slope_y"), NUMBER),
        }
    ],
    "robot?": {
        "chains": len(LEG_KEYS) * (CHAIN_FIELDS * (NUMBER,),),
        "hips": len(LEG_KEYS) * (2 * (NUMBER,),),
        "foot_radius": NUMBER,
    },
    "model_hash?": str | None,
    "traceback?": str,
    "bad_input?": bool,
}
"""Of a run. ``robot``: geometry of the legs, chains as in :mod:`cmacexp.models.chain`, hips in the body
frame (forward and left, m), radius of the feet (m)."""
SWEEP_FIELDS = {
    "status": str,
    "config": {"record?": {"trace?": bool}},
    "files": {"*": HASH},
}
"""Of a sweep."""
DRIFT = {"cycle": WHOLE, "leg": WHOLE, "named": WHOLE, "growth": float}
LEG = {"length_1?": NUMBER, "length_2?": NUMBER, "hip_x?": NUMBER, "hip_y?": NUMBER}
CONFIG = {
    "scenario": str,
    "sampling_period": POSITIVE,
    "cycles": COUNT,
    "gait": {"cycle_time": POSITIVE},
    "machine": {"kind": str, "hip_height": NUMBER, "leg?": LEG, "legs?": dict.fromkeys(LEG_KEYS, LEG)},
    "terrain": {"stiffness": POSITIVE, "slope?": NUMBER, "slope_start": NUMBER},
    "learning": {"start_cycle": COUNT},
    "cmac": dict,
    "record": {"trace?": bool, "every_nth_step": COUNT, "cycles": list | None},
    **{group: {"_target_": str} for group in COMPONENTS},
}
"""Of the config of a run that took steps or has files: what readers use of it."""


def _fits(value: Any, shape: Any) -> bool:
    """Whether a value that has neither entries nor items has its shape."""
    match shape:
        case range():
            return type(value) is int and value in shape
        case Number():
            is_number = type(value) in (int, float) and not abs(value) > sys.float_info.max
            return is_number and (shape.low is None or value >= shape.low)
        case re.Pattern():
            return isinstance(value, str) and shape.fullmatch(value) is not None
    return isinstance(value, shape)


def validate_value(value: Any, shape: Any, name: str) -> str | None:
    """Which value, as read from JSON, does not have its shape, by its name; None: all have."""
    inner: Iterable[tuple[Any, Any, str]]
    if isinstance(shape, dict):
        if not isinstance(value, dict):
            return f"{name} must be an object"
        if missing := {key for key in shape if key[-1] not in "?*"} - value.keys():
            return f"{name} has no {', '.join(sorted(missing))}"
        shapes = {key: shape.get(key, shape.get(f"{key}?", shape.get("*", object))) for key in value}
        inner = ((each, shapes[key], f"{name}.{key[:40]}") for key, each in value.items())
    elif isinstance(shape, list | tuple):
        if not isinstance(value, list) or (isinstance(shape, tuple) and len(value) != len(shape)):
            return f"{name} must be a list" + (f" of {len(shape)}" if isinstance(shape, tuple) else "")
        items = enumerate(zip(value, cycle(shape), strict=False))
        inner = ((each, own, f"{name}[{index}]") for index, (each, own) in items)
    else:
        return None if _fits(value, shape) else f"{name} cannot be {ascii(value)[:40]}"
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
    if not 0.5 < config["gait"]["cycle_time"] / config["sampling_period"] < MAX_STEPS_PER_CYCLE:
        return f"config.gait.cycle_time must have from 1 to {MAX_STEPS_PER_CYCLE} steps of config.sampling_period"
    return None if manifest["drift"] is None else validate_value(manifest["drift"], DRIFT, "manifest.drift")
