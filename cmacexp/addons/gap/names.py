"""Names of columns of a log: those that are tried for each quantity, numbers of columns, and what a file writes."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from cmacexp.addons.gap.readers import DECLARED, SAID
from cmacexp.errors import require

JOINT = "{joint}"
NUMBER = "{i}"
"""Stands for the number of a joint in the names of columns, as :data:`JOINT` for its name."""
ANGLES = (
    "q", "pos", "position", "positions", "angle", "angles", "jpos", "qpos", "theta", "joint_pos", "joint_position",
    "joint_positions", "joint_angle", "joint_angles", "joint_q", "dof_pos",
)  # fmt: skip
VELOCITIES = (
    "dq", "qd", "vel", "velocity", "velocities", "qvel", "speed", "joint_vel", "joint_velocity", "joint_velocities",
    "dof_vel",
)  # fmt: skip
TORQUES = (
    "tau", "torque", "torques", "trq", "torq", "effort", "efforts", "eff", "moment", "force", "tauEst", "tau_est",
    "tau_J", "joint_tau", "joint_torque", "joint_torques", "joint_effort", "dof_torque",
)  # fmt: skip
CURRENTS = ("current", "currents", "curr", "load")
"""Signals in place of torques, in units that say nothing of N m."""
MEASURED = ("measured", "meas", "present", "actual", "act", "state", "est", "estimated")
COMMANDED = (
    "des", "desired", "cmd", "command", "commanded", "ref", "reference", "target", "setpoint", "goal",
)  # fmt: skip
APPLIED = ("applied", "cmd", "command", "commanded")
"""Words of torques that stand for measured ones where there are none."""
PREFIXES = ("field", "data", "msg", "state", "states", "observation", "observations", "joint_state", "joint_states")
"""Words before the name of a column that say nothing: fields of a message, and topics."""
MOST_LISTED = 6
"""Number of names, of those that are tried, that a message lists."""


def _list_forms(name: str) -> list[str]:
    """Return the names of columns of a signal, of a joint by name or number, or of the only one."""
    return [f"{name}_{JOINT}", f"{JOINT}_{name}", f"{name}{NUMBER}", name]


def _combine(signals: Sequence[str], words: Sequence[str]) -> list[str]:
    """Return names of columns, of a joint or the only one, with one of the ``signals`` and one of the ``words``."""
    pairs = [pair for a in signals for b in words for pair in (f"{a}_{b}", f"{b}_{a}")]
    return [name for pair in pairs for name in _list_forms(pair)]


def _measure(signals: Sequence[str]) -> list[str]:
    """Return names of columns of a measured signal: those that say so come before the others."""
    plain = [name for signal in signals for name in _list_forms(signal)]
    return [*_combine(signals, MEASURED), *sorted(plain, key=lambda name: name in signals)]


PATTERNS: dict[str, tuple[str, ...]] = {
    "time": tuple(
        f"{name}{unit}"
        for unit in ("", "_s", "_sec", "_ms", "_us", "_ns")
        for name in ("time", "times", "t", "timestamp", "timestamps", "stamp", "duration")
    ),
    "angle": (*_measure(ANGLES), "observation_state_{joint}", "joint_{i}", "joint{i}", "j{i}"),
    "command": (
        *_combine(ANGLES, COMMANDED), *(f"{word}_{{joint}}" for word in COMMANDED),
        *(f"{{joint}}_{word}" for word in COMMANDED), "q_d_{joint}", "jpos_d{i}", "action_{joint}",
    ),
    "velocity": tuple(_measure(VELOCITIES)),
    "command_velocity": (*_combine(VELOCITIES, COMMANDED), "dq_d_{joint}", "qd_d_{joint}"),
    "torque": (*_measure(TORQUES), *_measure(CURRENTS), *_combine((*TORQUES, *CURRENTS), APPLIED)),
    "feedforward": ("tau_ff_{joint}", "{joint}_tau_ff"),
    "kp": ("kp_{joint}", "kp"),
    "kd": ("kd_{joint}", "kd"),
    "orientation": ("quat_{joint}", "q{joint}"),
}  # fmt: skip
"""Quantities of a log, and the names of their columns that are tried; the first one that occurs is used. Those
of angles, commands and torques without a joint are of the only one.

Letter case does not matter, ``_`` stands for any of ``_ . / - [ ] ( ) %`` and spaces, and PREFIXES may stand before.
"""
DEGREES = re.compile(r".*_deg(?:rees)?_*", re.IGNORECASE)
"""Names of columns that say that they are in degrees."""
COMMAND = re.compile(rf"(?:.*_)?(?:{'|'.join(COMMANDED)})(?:_.*)?", re.IGNORECASE)
"""Names of columns that are likely to be commands."""
TIMES = re.compile(r".*_(?:time|t|timestamp|stamp)_*", re.IGNORECASE)
"""Names of columns that are likely to be times."""
RATE = "--rate"
"""Name of the column of times that follow from a rate."""
NO_JOINTS = {*MEASURED, *COMMANDED, *CURRENTS, "rad", "deg", "degrees", "nm"}
"""Words that are no names of joints: in ``goal_position`` beside ``position`` there is no joint *goal*."""
SEPARATORS = str.maketrans(dict.fromkeys(" ./-[]():%", "_"))


def list_own(columns: Iterable[str]) -> list[str]:
    """Return the columns of a file, without what was said of it and columns that :func:`find_given` added."""
    inner = (*DECLARED, *SAID, *PATTERNS, RATE)
    return [name for name in columns if name.partition(" ")[0] not in inner or name in PATTERNS["time"]]


def find_given(columns: dict[str, NDArray[Any]], quantity: str, name: str, joints: Sequence[str] = ()) -> str:
    """Return the pattern of the columns ``name`` of a quantity; raise BadInput for numbers of absent columns.

    A name may lack what stands before it in the only column that ends so. Columns that are named by number, such as
    ``3`` or ``2-7``, are added under the quantity and a number from 0 on, or the names of as many ``joints`` in the
    file, of which the last ones count.
    """
    match = re.fullmatch(r"(\d+)(?:-(\d+))?", name)
    if match is None or name in columns:
        ending = [column for column in columns if column.endswith(f"_{name}")]
        return ending[0] if name not in columns and len(ending) == 1 else name.replace(NUMBER, JOINT)
    first = int(match[1])
    last = int(match[2] or first)
    listed = list_own(columns)
    require(
        1 <= first <= last <= len(listed), "--names", f"{quantity}={name}", f"must be columns from 1 to {len(listed)}"
    )
    count = last + 1 - first
    labels = joints[-count:] if 1 < count <= len(joints) else range(count)
    for label, column in zip(labels, listed[first - 1 : last], strict=True):
        columns[f"{quantity} {label}"] = columns[column]
    return f"{quantity} {0 if quantity == 'time' else JOINT}"


def _compile(pattern: str) -> "re.Pattern[str]":
    """Return the expression that names translated by SEPARATORS match if they fit one of PATTERNS."""
    units = "rad|deg|degrees|nm" if pattern.endswith(JOINT) else "rad|deg|degrees|nm|a|ma|joint"
    text = f"_*(?:(?:{'|'.join(PREFIXES)})_+)*{re.escape(pattern).replace('_', '_+')}(?:_+(?:{units}))*_*"
    for word, form in {JOINT: "(.+?)", NUMBER: r"(\d+)"}.items():
        text = text.replace(re.escape(word), form)
    return re.compile(text, re.IGNORECASE)


def _has_open_bracket(text: str) -> bool:
    """Return True if a bracket that begins in ``text`` does not end there, so that it is a part of a longer name."""
    return sum(map(text.count, "([")) > sum(map(text.count, ")]"))


def list_patterns(tried: Sequence[str], columns: Mapping[str, NDArray[Any]]) -> tuple[str, ...]:
    """Return the names that are ``tried``, as the columns write them, and the shortest ones as they are."""
    listed = dict[str, None]()
    written = {name: name.translate(SEPARATORS) for name in columns}
    together = " ".join(written.values()).lower()
    for pattern in tried:
        words = re.sub("{.*}", "_", pattern).lower().split("_")
        if not all(word in together for word in words):
            continue  # which is most of them, without compiling an expression
        form = _compile(pattern)
        for name, plain in written.items():
            if match := form.fullmatch(plain):
                begin, end = match.span(1) if form.groups else (0, 0)
                while end < len(name) and _has_open_bracket(name[begin:end]):
                    end += 1
                listed[name[:begin] + JOINT + name[end:] if form.groups else name] = None
    shortest = sorted((name for name in tried if NUMBER not in name), key=lambda name: (JOINT not in name, len(name)))
    listed |= dict.fromkeys(shortest[:MOST_LISTED])
    return tuple(listed)


def find_times(columns: Iterable[str]) -> tuple[str, ...]:
    """Return the columns whose last word says that they hold times, such as ``meas_time``."""
    return tuple(name for name in columns if TIMES.fullmatch(name.translate(SEPARATORS)))


def match_columns(pattern: str, columns: Iterable[str]) -> dict[str, str]:
    """Return the text that ``{joint}`` stands for in each of the ``columns`` that matches a pattern, by its name."""
    if JOINT not in pattern:
        return {}
    form = re.compile(re.escape(pattern).replace(re.escape(JOINT), "(.+)"))
    return {name: match[1] for name in columns if (match := form.fullmatch(name))}
