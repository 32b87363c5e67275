"""The columns of a log's files, with the names and units under which quantities are searched in them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.gap.log import KEY
from cmacexp.addons.gap.names import CURRENTS, DEGREES, JOINT, NO_JOINTS, SEPARATORS, list_own, match_columns
from cmacexp.addons.gap.readers import DECLARED, SAID
from cmacexp.errors import BadInput, require, suggest
from cmacexp.typing import Array

ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "rev": 2.0 * np.pi, "m": 1.0, "mm": 1e-3}
TORQUES = {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3, "N": 1.0, "-Nm": -1.0}
UNKNOWN = {"A": 1.0, "mA": 1e-3, "unknown": 1.0}
"""Units of torque that say nothing of N m: a factor for each joint is estimated."""
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "angle": ANGLES,
    "command": ANGLES,
    "velocity": {f"{unit}/s": factor for unit, factor in ANGLES.items()},
    "command_velocity": {f"{unit}/s": factor for unit, factor in ANGLES.items()},
    "torque": TORQUES | UNKNOWN,
    "feedforward": TORQUES,
}
"""Units that a log may have, by quantity, with their factors to the units of this project."""
COUNTS = re.compile(r"(\d+)/rev")
"""A unit of angles: counts of an encoder for each turn."""
LISTED = 24
"""Number of columns of a file that a message lists."""


@dataclass(frozen=True)
class Table:
    """The columns of a file, with the names and units under which quantities are searched in them."""

    path: Path
    columns: dict[str, NDArray[Any]]
    patterns: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    left_out: Sequence[str]

    def is_unit_known(self, pattern: str) -> bool:
        """Return False if torques, whose columns have this pattern, are currents, or in a unit of UNKNOWN."""
        unit = self.units.get("torque") or next((u for u in self.list_declared() if u in (*TORQUES, *UNKNOWN)), None)
        return unit in TORQUES if unit else not any(word in pattern.lower() for word in CURRENTS)

    def list_declared(self) -> list[str]:
        """Return the units that the file declares."""
        return [unit.strip() for unit in re.split("[,;]", ",".join(np.atleast_1d(self.columns.get("units", ""))))]

    def list_columns(self) -> str:
        """Return the names of the columns of the file, the first LISTED of them, for messages."""
        names = list_own(self.columns)
        return ", ".join(names[:LISTED]) + f" and {len(names) - LISTED} more" * (len(names) > LISTED)

    def read_all(self, quantity: str, pattern: str, joints: Sequence[str], rows: int, notes: list[str]) -> Array:
        """Return the columns (n, J) of a quantity by a pattern; absent or empty ones are 0; raise BadInput.

        Empty ones add to ``notes``, if they are torques or velocities, and are refused otherwise.
        """
        signal = np.zeros((rows, len(joints)))
        for k, joint in enumerate(joints):
            if (name := pattern.replace(JOINT, joint)) in self.columns:
                values = self.read(name, quantity)
                is_empty = not np.isfinite(values).any() and joint not in self.left_out
                is_needed = quantity not in ("torque", "velocity")
                require(
                    not (is_empty and is_needed), KEY, self.path, f"column {name} has no values: --leave-out {joint}"
                )
                signal[:, k] = 0.0 if is_empty else values
                notes += [f"Column {name} has no values: taken as 0."] * is_empty
        return signal

    def find(self, quantity: str, joints: Sequence[str]) -> str | None:
        """Return the pattern under which all ``joints`` have a column of a quantity, or None if no joint has one.

        Raises BadInput if only some of them have one, or if none has a column of the name that the user gave.
        """
        for pattern in self.patterns[quantity]:
            if JOINT not in pattern and len(joints) > 1 and quantity not in ("kp", "kd"):  # it is of one joint
                is_given = (pattern,) == self.patterns[quantity]
                reason = f"must contain {JOINT}, or name the angle of the only joint too, --names angle=NAME"
                require(not is_given, "--names", f"{quantity}={pattern}", reason)
                continue
            wanted = [pattern.replace(JOINT, joint) for joint in joints if joint not in self.left_out]
            missing = [name for name in wanted if name not in self.columns]
            if not missing or (quantity == "torque" and len(missing) < len(wanted)):  # others are passive
                return pattern
            is_only_pattern = (pattern,) == self.patterns[quantity]
            is_angle = quantity == "orientation" and pattern in self.patterns["angle"]  # of joints called x, y, z
            require(
                not is_only_pattern and (len(missing) == len(wanted) or is_angle),
                KEY,
                self.path,
                f"has no column {missing[0]} for {quantity}{suggest(missing[0], self.columns)}",
            )
        return None

    def find_joints(self) -> list[str]:
        """Return the names of the joints with a measured angle, empty for the only one; raise BadInput without."""
        for pattern in self.patterns["angle"]:
            if JOINT not in pattern and pattern in self.columns:
                return [""]  # so that no column of a numbered joint is taken for one of this joint
            if joints := self.match(pattern, "angle"):
                return joints
        tried = " or ".join(self.patterns["angle"][:4])
        has_header = not all(map(str.isdigit, list_own(self.columns)))
        cure = f"name them, --names angle=NAME_{JOINT}" if has_header else "number them, --names time=1,angle=2-3"
        raise BadInput(KEY, self.path, f"has no measured angles under {tried}; {cure}; it has {self.list_columns()}")

    def match(self, pattern: str, quantity: str) -> list[str]:
        """Return the joints of the columns that match the ``pattern`` of a quantity.

        A column that matches a longer pattern is no column of this one. Beside ``q_0``, ``q_clean_0`` is no joint.
        """
        claimed = set[str]()
        is_number = len(self.patterns[quantity]) > 1 and re.search(
            rf"\w{re.escape(JOINT)}", pattern.replace("_", " ")
        )
        matched = match_columns(pattern, self.columns)
        longer = [
            (key, match_columns(other, self.columns))
            for key, patterns in self.patterns.items()
            for other in patterns
            if JOINT in other and len(other) > len(pattern)
        ]
        for key, columns in longer:
            if key != quantity or 2 * len(columns) >= len(matched):  # else they are joints with longer names
                claimed.update(columns)
        claimed.update((*DECLARED, *SAID, *self.patterns["time"]))
        joints = [
            joint
            for name, joint in matched.items()
            if name not in claimed and (joint.isdigit() or not is_number) and joint.lower() not in NO_JOINTS
        ]
        numbers = {joint for joint in joints if joint.isdigit()}
        return [joint for joint in joints if joint in numbers or joint.rpartition("_")[2] not in numbers]

    def get_numbers(self, name: str) -> Array:
        """Return a column (n,) in the units of the file; raise BadInput unless it holds numbers."""
        try:
            return np.atleast_1d(np.asarray(self.columns[name], dtype=float))
        except (TypeError, ValueError) as error:
            raise BadInput(KEY, self.path, f"holds no numbers in column {name} ({error})") from error

    def read(self, name: str, quantity: str) -> Array:
        """Return a column (n,) of a quantity in the units of this project; raise BadInput."""
        values = self.get_numbers(name)
        rows = self.columns[self.find("time", [""]) or name].size
        require(values.shape == (rows,), KEY, self.path, f"column {name} has {values.size} values, time has {rows}")
        if quantity == "torque":
            values = _sign_counts(values)
        factors = UNITS.get(quantity, {})
        declared = self.list_declared()
        unit = self.units.get(quantity) or next((unit for unit in declared if unit in factors), None)
        unit = unit or ("deg" if "deg" in factors and DEGREES.fullmatch(name.translate(SEPARATORS)) else None)
        unknown = set(declared).difference([""], *UNITS.values())
        listed = ", ".join(unit for unit in declared if unit in unknown)
        allowed = f"must be one of {', '.join(factors)} for {quantity}, or say --units {quantity}=UNIT"
        require(unit or not factors or not unknown, KEY, self.path, f"declares the unit {listed}: {allowed}")
        if unit and (counts := COUNTS.fullmatch(unit)):
            return values * 2.0 * np.pi / float(counts[1])
        return values * factors[unit] if unit else values

    def read_gain(self, key: str, joints: Sequence[str]) -> Array:
        """Return a gain of each joint (J,), NaN if unknown; raise BadInput."""
        if (pattern := self.find(key, joints)) is None:
            return np.full(len(joints), np.nan)
        columns = np.array([self.get_numbers(pattern.replace(JOINT, joint)) for joint in joints])
        is_constant = (columns == columns[:, :1]).all()
        values: Array = columns[:, 0] if is_constant else columns[0]  # else one column has one number for each joint
        require(
            len(values) == len(joints) and ((values >= 0.0) & (values < np.inf)).all(),
            f"--{key}",
            ",".join(f"{value:g}" for value in values[:20]),
            f"must be one finite number from 0 on, or one for each of {len(joints)} joints, in all rows: cut the log "
            "where they are constant",
        )
        return values


def _sign_counts(values: Array) -> Array:
    """Return counts (n,) of a register of 16 bits with their sign: those from 2^15 on are below 0."""
    is_wrapped = np.abs(np.diff(values)).max(initial=0.0) > 2**15 and values.min() >= 0.0 and values.max() < 2**16
    return np.where(values < 2**15, values, values - 2**16) if is_wrapped else values
