"""Reads a log: the columns of its files, under the names and in the units of each quantity, become a :class:`Log`."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.gap.arrays import AXES, join_files, split_arrays
from cmacexp.addons.gap.bags import read_bag
from cmacexp.addons.gap.log import KEY, Log
from cmacexp.addons.gap.names import (
    CURRENTS,
    JOINT,
    NO_JOINTS,
    PATTERNS,
    SEPARATORS,
    find_numbered,
    find_times,
    list_patterns,
    match_columns,
)
from cmacexp.addons.gap.readers import COMPRESSED, DECLARED, READERS, SAID, Reader, is_number
from cmacexp.errors import BadInput, CmacexpError, require, suggest
from cmacexp.typing import Array

ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "rev": 2.0 * np.pi, "m": 1.0, "mm": 1e-3}
TORQUES = {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3, "N": 1.0}
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
RATES = (20.0, 20_000.0)
"""Least and largest sampling rate of a log, Hz."""
LISTED = 24
"""Number of columns of a file that a message lists."""


def read_log(
    path: Path,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    gains: Mapping[str, Sequence[float]] | None = None,
    reader: Reader | None = None,
    left_out: Sequence[str] = (),
    rate: float | None = None,
    others: Sequence[Path] = (),
) -> Log:
    """Read a log from a file.

    Args:
        path: file of one of READERS by its suffix, or bag of ROS, or in the format of ``reader``.
        names: names of columns by quantity, see PATTERNS, with ``{joint}`` for the name of a joint; or their numbers
            from 1 on, such as ``2-7``.
        units: units by quantity, see UNITS; they replace those that the file declares. Default: s, rad, N m.
        gains: ``kp`` and ``kd``, one number or one for each joint; they replace those in the file.
        reader: function that reads another format.
        left_out: joints to ignore; a joint with a command or torque but no measured angle must be among them.
        rate: rows a second; it replaces the times in the file.
        others: files with other columns of the same rows, see :func:`join_files`.

    Raises:
        BadInput: the file cannot be read, a column is missing or holds no numbers, a unit is unknown or of a quantity
            that the log does not have, or the log has neither torques nor commands with the gains of the drives.
    """
    tables = {file: _load(file, reader) for file in (path, *others)}
    columns = tables[path] if not others else join_files(tables)
    joints: list[str] = columns.pop("joints", np.zeros(0, dtype=str)).tolist()
    require(rate is None or 0.0 < rate < np.inf, "--rate", rate, "must be a number of rows a second, above 0")
    for quantity, unit in (units or {}).items():
        allowed = UNITS.get(quantity, {})
        mistake = f"is no unit of {quantity}, which are" if allowed else "must name one of"
        require(unit in allowed, "--units", f"{quantity}={unit}", f"{mistake} {', '.join(allowed or UNITS)}")
    for quantity in names or {}:
        mistake = f"is no quantity of a log, which are {', '.join(PATTERNS)}"
        require(quantity in PATTERNS, "--names", quantity, mistake)
    gain_columns = {key: np.array(values) for key, values in (gains or {}).items()}
    given = {key: (find_numbered(columns, key, name, joints),) for key, name in (names or {}).items()}
    if rate is not None:
        columns["time"] = np.arange(max(map(np.size, columns.values()), default=0)) / rate
    patterns = {
        **{key: list_patterns(tried, columns) for key, tried in PATTERNS.items()},
        "time": (*list_patterns(PATTERNS["time"], columns), *find_times(columns)),
        **given,
        **{key: (key,) for key in gain_columns},
        **({} if rate is None else {"time": ("time",)}),
    }
    return _Table(path, columns | gain_columns, patterns, units or {}, left_out).make_log()


def _load(path: Path, reader: Reader | None) -> dict[str, NDArray[Any]]:
    """Read the columns (n,) of a file, or of a folder that is a bag of ROS; raise BadInput."""
    require(path.exists(), KEY, path, "there is no such file")
    is_log = reader is not None or path.is_file() or (path / "metadata.yaml").is_file()
    require(
        is_log, KEY, path, "is a folder, and no bag of ROS 2, which has a metadata.yaml: give the file of the log"
    )
    suffixes = [suffix.lower() for suffix in path.suffixes if suffix.lower() not in COMPRESSED]
    reader = reader or (read_bag if path.is_dir() else READERS.get(suffixes[-1] if suffixes else ""))
    if reader is None:
        raise BadInput(KEY, path, f"is no {', '.join(READERS)}: name a reader, --reader FILE.py:FUNCTION")
    try:
        return split_arrays(reader(path))
    except CmacexpError:
        raise
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadInput(KEY, path, f"cannot be read ({reason})") from error


@dataclass(frozen=True)
class _Table:
    """The columns of a file, with the names and units under which quantities are searched in them."""

    path: Path
    columns: dict[str, NDArray[Any]]
    patterns: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    left_out: Sequence[str]

    def make_log(self) -> Log:
        """Return the log; raise BadInput."""
        joints = self._find_joints()
        names = dict[str, str]()
        notes = [*map(str, self.columns.get("notes", ()))]
        time = self._read_time(notes)
        if time is None:
            raise BadInput(
                KEY,
                self.path,
                f"has no column of time: --rate HZ, or name it, --names time=NAME; it has {self._list()}",
            )
        empty = np.zeros(time.size)

        def read(quantity: str, suffixes: Sequence[str] = joints, missing: Array | None = None) -> Any:
            if (pattern := self._find(quantity, suffixes)) is None:
                return missing
            names[quantity] = pattern
            columns = [pattern.replace(JOINT, suffix) for suffix in suffixes]
            values = [self._read(name, quantity) if name in self.columns else empty for name in columns]
            return np.stack(values, axis=1)

        angle = read("angle")
        command = read("command")
        torque = read("torque")
        velocity = read("velocity")
        without_angle = self._list_joints(names).difference(joints)
        for joint in sorted(without_angle.difference(self.left_out)):
            lacks = f"has no column {names['angle'].replace(JOINT, joint)} for angle of joint {joint}, which has"
            raise BadInput(KEY, self.path, f"{lacks} a command or torque: rename it, or --leave-out {joint}")
        log = Log(
            path=self.path,
            time=time,
            joints=tuple(joint or "0" for joint in joints),
            angle=angle,
            command=command,
            command_velocity=read("command_velocity", missing=np.zeros_like(angle)),
            torque=torque,
            feedforward=read("feedforward", missing=np.zeros_like(angle)),
            kp=self._read_gain("kp", joints),
            kd=self._read_gain("kd", joints),
            orientation=read("orientation", AXES),
            velocity=velocity if velocity is not None and np.isfinite(velocity).all() else None,
            rows=np.arange(len(time)),
            names=names,
            is_unit_known=torque is None or self._is_unit_known(names["torque"]),
            notes=(*notes, *self._note_passive(names)),
        )
        require(
            command is not None or torque is not None,
            KEY,
            self.path,
            "has neither commanded angles nor torques: name them, --names command=..., or torque=NAME_{joint}, or "
            f"give the files that have them too; it has {self._list()}",
        )
        for key, gain in {"--kp": log.kp, "--kd": log.kd}.items():
            require(
                torque is not None or np.isfinite(gain).all(),
                key,
                None,
                "is missing: the log has neither torques nor the gains of the drives",
            )
        for quantity, unit in self.units.items():
            require(
                quantity in (*names, "time"),
                "--units",
                f"{quantity}={unit}",
                f"the log has no {quantity}; it has {', '.join(('time', *names))}",
            )
        return log.leave_out([joint for joint in self.left_out if joint not in without_angle])

    def _read_time(self, notes: list[str]) -> Array | None:
        """Return the times (n,) from 0 on, s, without loss of digits; None if the log has none; raise BadInput.

        Without a unit, it is that of the column's name, or follows from the times, see :func:`_guess_unit`, which is
        added to ``notes``.
        """
        if (name := self._find("time", [""])) is None:
            return None
        values = np.atleast_1d(self.columns[name])
        if values.dtype.kind == "M" or not is_number(values[0]):
            from pandas import to_datetime

            try:
                dates = to_datetime(values, format="mixed").to_numpy("datetime64[ns]")
            except (TypeError, ValueError) as error:
                raise BadInput(KEY, self.path, f"holds no times in column {name} ({error})") from error
            return np.asarray((dates - dates[0]) / np.timedelta64(1, "ns") * 1e-9)
        if values.dtype.kind not in "iu":
            values = self._get_numbers(name)
        ending = re.search(r"_(s|sec|ms|us|ns)_*$", name.translate(SEPARATORS), re.IGNORECASE)
        declared = next((unit for unit in self._list_declared() if unit in UNITS["time"]), None)
        unit = self.units.get("time") or declared or (ending and ending[1].lower().replace("sec", "s"))
        spans = np.asarray(values - values[0], dtype=float)
        if unit is None and (unit := _guess_unit(abs(float(values[0])), spans)) != "s":
            notes.append(f"Times in column {name} are in {unit}, as their size shows.")
        return spans * UNITS["time"][unit or "s"]

    def _is_unit_known(self, pattern: str) -> bool:
        """Return False if torques, whose columns have this pattern, are currents, or in a unit of UNKNOWN."""
        unit = self.units.get("torque") or next((u for u in self._list_declared() if u in (*TORQUES, *UNKNOWN)), None)
        return unit in TORQUES if unit else not any(word in pattern.lower() for word in CURRENTS)

    def _list_declared(self) -> list[str]:
        """Return the units that the file declares."""
        return [unit.strip() for unit in re.split("[,;]", ",".join(np.atleast_1d(self.columns.get("units", ""))))]

    def _list_joints(self, names: Mapping[str, str]) -> set[str]:
        """Return all joints with a command or a torque, whose columns have these names by quantity."""
        patterns = {key: names[key] for key in ("command", "torque") if JOINT in names.get(key, "")}
        return {joint for key, pattern in patterns.items() for joint in self._match(pattern, key)}

    def _note_passive(self, names: Mapping[str, str]) -> Iterable[str]:
        """Yield a note on joints without a torque beside joints with one, whose columns have these names."""
        moved = self._match(names["torque"], "torque") if JOINT in names.get("torque", "") else []
        passive = [joint for joint in self._find_joints() if moved and joint not in (*moved, *self.left_out)]
        if passive:
            yield f"No torque of {', '.join(passive)} is logged: taken as passive, 0 N m."

    def _list(self) -> str:
        names = [name for name in self.columns if name not in (*DECLARED, *SAID)]
        return ", ".join(names[:LISTED]) + f" and {len(names) - LISTED} more" * (len(names) > LISTED)

    def _find(self, quantity: str, joints: Sequence[str]) -> str | None:
        """Return the pattern under which all ``joints`` have a column of a quantity, or None if no joint has one.

        Raises BadInput if only some of them have one, or if none has a column of the name that the user gave.
        """
        for pattern in self.patterns[quantity]:
            if JOINT not in pattern and len(joints) > 1 and quantity not in ("kp", "kd"):  # it is of one joint
                is_given = (pattern,) == self.patterns[quantity]
                require(not is_given, "--names", f"{quantity}={pattern}", f"must contain {JOINT}")
                continue
            wanted = [pattern.replace(JOINT, joint) for joint in joints if joint not in self.left_out]
            missing = [name for name in wanted if name not in self.columns]
            if not missing or (quantity == "torque" and len(missing) < len(wanted)):  # others are passive
                return pattern
            is_only_pattern = (pattern,) == self.patterns[quantity]
            is_angle = quantity == "orientation" and pattern in self.patterns["angle"]  # of joints called x, y, z
            require(
                not is_only_pattern and (len(missing) == len(joints) or is_angle),
                KEY,
                self.path,
                f"has no column {missing[0]} for {quantity}{suggest(missing[0], self.columns)}",
            )
        return None

    def _find_joints(self) -> list[str]:
        """Return the names of the joints with a measured angle, empty for the only one; raise BadInput without."""
        for pattern in self.patterns["angle"]:
            if JOINT not in pattern and pattern in self.columns:
                return [""]  # so that no column of a numbered joint is taken for one of this joint
            if joints := self._match(pattern, "angle"):
                return joints
        tried = " or ".join(self.patterns["angle"][:4])
        has_header = not all(name.isdigit() for name in self.columns if name not in (*DECLARED, *SAID))
        cure = f"name them, --names angle=NAME_{JOINT}" if has_header else "number them, --names time=1,angle=2-3"
        raise BadInput(KEY, self.path, f"has no measured angles under {tried}; {cure}; it has {self._list()}")

    def _match(self, pattern: str, quantity: str) -> list[str]:
        """Return the joints of the columns that match the ``pattern`` of a quantity.

        A column that matches a longer pattern is no column of this one. Beside ``q_0``, ``q_clean_0`` is no joint.
        """
        claimed = set[str]()
        is_number = len(self.patterns[quantity]) > 1 and re.search(
            rf"\w{re.escape(JOINT)}", pattern.replace("_", " ")
        )
        for other in (other for patterns in self.patterns.values() for other in patterns):
            if JOINT in other and len(other) > len(pattern):
                claimed.update(match_columns(other, self.columns))
        joints = [
            joint
            for name, joint in match_columns(pattern, self.columns).items()
            if name not in claimed and (joint.isdigit() or not is_number) and joint.lower() not in NO_JOINTS
        ]
        numbers = {joint for joint in joints if joint.isdigit()}
        return [joint for joint in joints if joint in numbers or joint.rpartition("_")[2] not in numbers]

    def _get_numbers(self, name: str) -> Array:
        """Return a column (n,) in the units of the file; raise BadInput unless it holds numbers."""
        try:
            return np.atleast_1d(np.asarray(self.columns[name], dtype=float))
        except (TypeError, ValueError) as error:
            raise BadInput(KEY, self.path, f"holds no numbers in column {name} ({error})") from error

    def _read(self, name: str, quantity: str) -> Array:
        """Return a column (n,) of a quantity in the units of this project; raise BadInput."""
        values = self._get_numbers(name)
        rows = self.columns[self._find("time", [""]) or name].size
        require(values.shape == (rows,), KEY, self.path, f"column {name} has {values.size} values, time has {rows}")
        if quantity == "torque":
            values = _sign_counts(values)
        factors = UNITS.get(quantity, {})
        declared = self._list_declared()
        unit = self.units.get(quantity) or next((unit for unit in declared if unit in factors), None)
        unknown = set(declared).difference([""], *UNITS.values())
        listed = ", ".join(unit for unit in declared if unit in unknown)
        allowed = f"must be one of {', '.join(factors)} for {quantity}, or say --units {quantity}=UNIT"
        require(unit or not factors or not unknown, KEY, self.path, f"declares the unit {listed}: {allowed}")
        return values * factors[unit] if unit else values

    def _read_gain(self, key: str, joints: Sequence[str]) -> Array:
        """Return a gain of each joint (J,), NaN if unknown; raise BadInput."""
        if (pattern := self._find(key, joints)) is None:
            return np.full(len(joints), np.nan)
        columns = np.array([self._get_numbers(pattern.replace(JOINT, joint)) for joint in joints])
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
    return np.where(values < 2**15, values, values - 2**16) if is_wrapped and (values % 1.0 == 0.0).all() else values


def _guess_unit(first: float, spans: Array) -> str:
    """Return the unit of times: that of a ``first`` time since 1970, or the first in which rows have a likely rate.

    ``spans`` (n,) are times from the first one on. Seconds come first, and stand if no unit is likely.
    """
    sizes = {"ns": 1e17, "us": 1e14, "ms": 1e11}
    if since_1970 := [unit for unit, size in sizes.items() if first > size]:
        return since_1970[0]
    steps = np.diff(spans)
    period = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    rates = {unit: 1.0 / (factor * period) for unit, factor in UNITS["time"].items() if period > 0.0}
    return next((unit for unit, rate in rates.items() if RATES[0] <= rate <= RATES[1]), "s")
