"""Names of columns of a log: those that are tried for each quantity, numbers of columns, and what a file writes."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from cmacexp.addons.gap.readers import DECLARED
from cmacexp.errors import require

JOINT = "{joint}"
NUMBER = "{i}"
"""Stands for the number of a joint in the names of columns, as :data:`JOINT` for its name."""
ANGLES = ("q", "pos", "position", "angle", "jpos", "qpos", "theta")
TORQUES = ("tau", "torque", "effort", "force", "current")
MEASURED = ("measured", "meas", "actual", "act", "state", "est", "estimated")
COMMANDED = (
    "des", "desired", "cmd", "command", "commanded", "ref", "reference", "target", "setpoint", "goal",
)  # fmt: skip
MOST_LISTED = 6
"""Number of names, of those that are tried, that a message lists."""


def _combine(signals: Sequence[str], words: Sequence[str]) -> list[str]:
    """Return names of columns, of a joint or the only one, with one of the ``signals`` and one of the ``words``."""
    pairs = [pair for a in signals for b in words for pair in (f"{a}_{b}", f"{b}_{a}")]
    return [name for pair in pairs for name in (f"{pair}_{JOINT}", f"{JOINT}_{pair}", f"{pair}{NUMBER}", pair)]


PATTERNS: dict[str, tuple[str, ...]] = {
    "time": (
        "time", "t", "timestamp", "stamp", *(
            f"{name}_{unit}"
            for name in ("time", "t", "timestamp", "stamp")
            for unit in ("s", "sec", "ms", "us", "ns")
        ),
    ),
    "angle": (
        *_combine(ANGLES, MEASURED),
        "q_{joint}", "{joint}_q", "pos_{joint}", "{joint}_pos", "position_{joint}", "{joint}_position", "q{i}",
        "jpos{i}", "jpos_{joint}", "pos{i}", "joint_states_{joint}_position",
        "joint_states_position_{joint}", "joint_position_{joint}", "joint_pos_{joint}", "angle_{joint}",
        "{joint}_angle", "joint_angle_{joint}", "theta_{joint}", "qpos_{joint}", "observation_state_{joint}",
        *ANGLES,
    ),
    "command": (
        *_combine(ANGLES, COMMANDED), *(f"{word}_{{joint}}" for word in COMMANDED),
        *(f"{{joint}}_{word}" for word in COMMANDED), "q_d_{joint}", "jpos_des{i}", "jpos_cmd{i}", "jpos_d{i}",
        "action_{joint}",
    ),
    "command_velocity": (
        "dq_des_{joint}", "qd_des_{joint}", "{joint}_dq_des", "dq_d_{joint}", "target_qd_{joint}",
    ),
    "torque": (
        *_combine(TORQUES, MEASURED),
        "tau_{joint}", "{joint}_tau", "torque_{joint}", "{joint}_torque", "effort_{joint}", "{joint}_effort",
        "tau{i}", "tau_J_{joint}", "joint_states_{joint}_effort", "joint_states_effort_{joint}",
        "joint_torque_{joint}", "force_{joint}", "{joint}_force", "current_{joint}", "{joint}_current",
        "tauEst_{joint}", "{joint}_tauEst", *TORQUES,
    ),
    "feedforward": ("tau_ff_{joint}", "{joint}_tau_ff"),
    "kp": ("kp_{joint}", "kp"),
    "kd": ("kd_{joint}", "kd"),
    "orientation": ("quat_{joint}", "q{joint}"),
}  # fmt: skip
"""Quantities of a log, and the names of their columns that are tried; the first one that occurs is used. Those
of angles, commands and torques without a joint are of the only one.

Letter case does not matter, and ``_`` stands for any of ``_ . / - [ ] ( )`` and spaces.
"""
SEPARATORS = str.maketrans(dict.fromkeys(" ./-[]():", "_"))


def find_numbered(columns: dict[str, NDArray[Any]], quantity: str, name: str) -> str:
    """Return the pattern of the columns ``name`` of a quantity; raise BadInput for numbers of absent columns.

    Columns that are named by number, such as ``3`` or ``2-7``, are added under the quantity and a number from 0 on.
    """
    match = re.fullmatch(r"(\d+)(?:-(\d+))?", name)
    if match is None or name in columns:
        return name.replace(NUMBER, JOINT)
    first = int(match[1])
    last = int(match[2] or first)
    listed = [key for key in columns if key not in (*DECLARED, "notes")]
    require(
        1 <= first <= last <= len(listed), "--names", f"{quantity}={name}", f"must be columns from 1 to {len(listed)}"
    )
    for number, column in enumerate(listed[first - 1 : last]):
        columns[f"{quantity} {number}"] = columns[column]
    return f"{quantity} {0 if quantity == 'time' else JOINT}"


def _compile(pattern: str) -> "re.Pattern[str]":
    """Return the expression that names translated by SEPARATORS match if they fit one of PATTERNS."""
    text = "_*" + re.escape(pattern).replace("_", "_+") + "_*"
    for word, form in {JOINT: "(.+?)", NUMBER: r"(\d+)"}.items():
        text = text.replace(re.escape(word), form)
    return re.compile(text, re.IGNORECASE)


def _has_open_bracket(text: str) -> bool:
    """Return True if a bracket that begins in ``text`` does not end there, so that it is a part of a longer name."""
    return sum(map(text.count, "([")) > sum(map(text.count, ")]"))


def list_patterns(tried: Sequence[str], columns: Mapping[str, NDArray[Any]]) -> tuple[str, ...]:
    """Return the names that are ``tried``, as the columns write them, and the shortest ones as they are."""
    listed = dict[str, None]()
    for pattern in tried:
        form = _compile(pattern)
        for name in columns:
            if match := form.fullmatch(name.translate(SEPARATORS)):
                begin, end = match.span(1) if form.groups else (0, 0)
                while end < len(name) and _has_open_bracket(name[begin:end]):
                    end += 1
                listed[name[:begin] + JOINT + name[end:] if form.groups else name] = None
    plain = sorted((name for name in tried if NUMBER not in name), key=lambda name: (JOINT not in name, len(name)))
    listed |= dict.fromkeys(plain[:MOST_LISTED])
    return tuple(listed)


def match_columns(pattern: str, columns: Iterable[str]) -> dict[str, str]:
    """Return the text that ``{joint}`` stands for in each of the ``columns`` that matches a pattern, by its name."""
    form = re.compile(re.escape(pattern).replace(re.escape(JOINT), "(.+)"))
    return {name: match[1] for name in columns if (match := form.fullmatch(name))}
