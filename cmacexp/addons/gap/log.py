"""A log of a robot: what was measured and commanded, joint by joint, from Parquet, CSV, NPZ, MCAP or a reader.

Any other format needs a reader of the user, see :mod:`cmacexp.addons.gap.readers`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.gap.names import JOINT, PATTERNS, SEPARATORS, find_numbered, list_patterns, match_columns
from cmacexp.addons.gap.readers import COMPRESSED, DECLARED, READERS, Columns, Reader, is_number, read_bag
from cmacexp.errors import BadInput, CmacexpError, require, suggest
from cmacexp.typing import Array

KEY = "LOG"
"""Name of the file in error messages: the argument of the command."""
AXES = ("w", "x", "y", "z")
"""Components of a quaternion, which take the place of ``{joint}`` in the names of an orientation."""
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "rev": 2.0 * np.pi, "m": 1.0, "mm": 1e-3}
TORQUES = {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3, "N": 1.0}
UNKNOWN = {"A": 1.0, "mA": 1e-3, "unknown": 1.0}
"""Units of torque that say nothing of N m: a factor for each joint is estimated."""
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "angle": ANGLES,
    "command": ANGLES,
    "command_velocity": {f"{unit}/s": factor for unit, factor in ANGLES.items()},
    "torque": TORQUES | UNKNOWN,
    "feedforward": TORQUES,
}
"""Units that a log may have, by quantity, with their factors to the units of this project."""


@dataclass(frozen=True)
class Log:
    """Measured and commanded signals of J joints at n instants (rows), arrays (n, J)."""

    path: Path
    time: Array
    """(n,), starting at 0, s."""
    joints: tuple[str, ...]
    """Names of the joints in the log."""
    angle: Array
    """Measured angle, rad."""
    command: Array | None
    """Commanded angle, rad; None: the log has torques only."""
    command_velocity: Array
    """Commanded velocity, rad/s; zero if the log has none."""
    torque: Array | None
    """Measured or applied torque, N m; None: the log has none."""
    feedforward: Array
    """Torque that the drives added to their feedback, N m; zero if the log has none."""
    kp: Array
    """(J,) stiffness gains of the drives, N m/rad; NaN: unknown."""
    kd: Array
    """(J,) damping gains of the drives, N m s/rad; NaN: unknown."""
    orientation: Array | None
    """(n, 4) orientation of the base in the world, a quaternion w, x, y, z; None: the base was held level."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Name of the column of each quantity, with ``{joint}`` for the name of a joint."""
    is_unit_known: bool = True
    """False if torques are in a unit that does not say how many N m they are, such as currents."""
    notes: tuple[str, ...] = ()
    """What was changed or assumed when the log was read, one sentence each."""

    def note(self, sentence: str) -> "Log":
        """Return the log with one more note."""
        return replace(self, notes=(*self.notes, sentence))

    @property
    def period(self) -> float:
        """Median spacing of the rows, s."""
        return float(np.median(np.diff(self.time)))

    @property
    def has_gains(self) -> bool:
        """True if the gains of all drives are known."""
        return bool(np.isfinite(self.kp).all() and np.isfinite(self.kd).all())

    @property
    def has_drives(self) -> bool:
        """True if commands and gains are known, so that commands can be replayed."""
        return self.command is not None and self.has_gains

    def column(self, quantity: str, joint: int) -> str:
        """Return the name of the column of a ``quantity`` of the joint with this number."""
        return self.names.get(quantity, quantity).replace(JOINT, self.joints[joint])

    def leave_out(self, joints: Sequence[str]) -> "Log":
        """Return the log without some ``joints``; raise BadInput if it lacks one of them, or if none remains."""
        for name in joints:
            require(name in self.joints, "--leave-out", name, f"is no joint of the log{suggest(name, self.joints)}")
        kept = [j for j, name in enumerate(self.joints) if name not in joints]
        require(kept, "--leave-out", ",".join(joints), "leaves no joint of the log: keep at least one")
        signals = ("angle", "command", "command_velocity", "torque", "feedforward")
        cut: dict[str, Any] = {
            key: None if (values := vars(self)[key]) is None else values[:, kept] for key in signals
        }
        return replace(self, joints=tuple(self.joints[j] for j in kept), kp=self.kp[kept], kd=self.kd[kept], **cut)


def read_log(
    path: Path,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    gains: Mapping[str, Sequence[float]] | None = None,
    reader: Reader | None = None,
    left_out: Sequence[str] = (),
    rate: float | None = None,
) -> Log:
    """Read a log from a file.

    Args:
        path: file in Parquet, CSV, NPZ or MCAP, or bag of ROS, by its suffix, or in the format of ``reader``.
        names: names of columns by quantity, see PATTERNS, with ``{joint}`` for the name of a joint; or their numbers
            from 1 on, such as ``2-7``.
        units: units by quantity, see UNITS; they replace those that the file declares. Default: s, rad, N m.
        gains: ``kp`` and ``kd``, one number or one for each joint; they replace those in the file.
        reader: function that reads another format.
        left_out: joints to ignore; a joint with a command or torque but no measured angle must be among them.
        rate: rows a second; it replaces the times in the file.

    Raises:
        BadInput: the file cannot be read, a column is missing or holds no numbers, a unit is unknown or of a quantity
            that the log does not have, or the log has neither torques nor commands with the gains of the drives.
    """
    require(path.exists(), KEY, path, "there is no such file")
    columns = _load(path, reader)
    require(rate is None or 0.0 < rate < np.inf, "--rate", rate, "must be a number of rows a second, above 0")
    for quantity, unit in (units or {}).items():
        allowed = UNITS.get(quantity, {})
        mistake = f"is no unit of {quantity}, which are" if allowed else "must name one of"
        require(unit in allowed, "--units", f"{quantity}={unit}", f"{mistake} {', '.join(allowed or UNITS)}")
    for quantity in names or {}:
        mistake = f"is no quantity of a log, which are {', '.join(PATTERNS)}"
        require(quantity in PATTERNS, "--names", quantity, mistake)
    gain_columns = {key: np.array(values) for key, values in (gains or {}).items()}
    given = {key: (find_numbered(columns, key, name),) for key, name in (names or {}).items()}
    if rate is not None:
        columns["time"] = np.arange(max(map(np.size, columns.values()), default=0)) / rate
    patterns = {
        **{key: list_patterns(tried, columns) for key, tried in PATTERNS.items()},
        **given,
        **{key: (key,) for key in gain_columns},
        **({} if rate is None else {"time": ("time",)}),
    }
    return _Table(path, columns | gain_columns, patterns, units or {}, left_out).make_log()


def _load(path: Path, reader: Reader | None) -> dict[str, NDArray[Any]]:
    """Read the columns (n,) of a file, or of a folder that is a bag of ROS; raise BadInput."""
    is_log = reader is not None or path.is_file() or (path / "metadata.yaml").is_file()
    require(
        is_log, KEY, path, "is a folder, and no bag of ROS 2, which has a metadata.yaml: give the file of the log"
    )
    suffixes = [suffix.lower() for suffix in path.suffixes if suffix.lower() not in COMPRESSED]
    reader = reader or (read_bag if path.is_dir() else READERS.get(suffixes[-1] if suffixes else ""))
    if reader is None:
        raise BadInput(KEY, path, f"is no {', '.join(READERS)}: name a reader, --reader FILE.py:FUNCTION")
    try:
        return _flatten({name: np.asarray(values) for name, values in reader(path).items()})
    except CmacexpError:
        raise
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadInput(KEY, path, f"cannot be read ({reason})") from error


def _flatten(columns: Columns) -> dict[str, NDArray[Any]]:
    """Split arrays (n, J) into columns (n,) with a suffix: the joint in ``joints`` or ``names``, or its number."""
    flat: dict[str, NDArray[Any]] = {}
    listed: list[str] = next((columns[key].tolist() for key in ("joints", "names") if key in columns), [])
    for name, values in columns.items():
        if values.ndim == 2:
            is_orientation = name in ("quat", "orientation")
            if is_orientation and values.shape[1] > len(AXES):
                raise ValueError(f"{name} has {values.shape[1]} columns, a quaternion {len(AXES)}: {', '.join(AXES)}")
            joints = listed if len(listed) == values.shape[1] else range(values.shape[1])
            prefix, suffixes = ("quat", AXES) if is_orientation else (name, joints)
            flat |= {f"{prefix}_{suffix}": column for suffix, column in zip(suffixes, values.T, strict=False)}
        elif name not in ("joints", "names"):
            flat[name] = values
    return flat


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

        def read(quantity: str, suffixes: Sequence[str] = joints, missing: Array | None = None) -> Any:
            if (pattern := self._find(quantity, suffixes)) is None:
                return missing
            names[quantity] = pattern
            return np.stack([self._read(pattern.replace(JOINT, suffix), quantity) for suffix in suffixes], axis=1)

        time = self._read_time()
        if time is None:
            raise BadInput(
                KEY,
                self.path,
                f"has no column of time: --rate HZ, or name it, --names time=NAME; it has {self._list()}",
            )
        angle = read("angle")
        command = read("command")
        torque = read("torque")
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
            names=names,
            is_unit_known=torque is None or self._is_unit_known(names["torque"]),
            notes=tuple(map(str, self.columns.get("notes", ()))),
        )
        require(
            command is not None or torque is not None,
            KEY,
            self.path,
            "has neither commanded angles nor torques: name them, --names command=..., or torque=NAME_{joint}",
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

    def _read_time(self) -> Array | None:
        """Return the times (n,) from 0 on, s, without loss of digits; None if the log has none; raise BadInput.

        Without a unit, it is that of the column's name, or follows from the size of a time since 1970.
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
        since_1970 = (size for size, limit in {"ns": 1e17, "us": 1e14, "ms": 1e11}.items() if abs(values[0]) > limit)
        return np.asarray((values - values[0]) * UNITS["time"][unit or next(since_1970, "s")], dtype=float)

    def _is_unit_known(self, pattern: str) -> bool:
        """Return False if torques, whose columns have this pattern, are currents, or in a unit of UNKNOWN."""
        unit = self.units.get("torque") or next((u for u in self._list_declared() if u in (*TORQUES, *UNKNOWN)), None)
        return unit in TORQUES if unit else "current" not in pattern.lower()

    def _list_declared(self) -> list[str]:
        """Return the units that the file declares."""
        return [unit.strip() for unit in re.split("[,;]", ",".join(np.atleast_1d(self.columns.get("units", ""))))]

    def _list_joints(self, names: Mapping[str, str]) -> set[str]:
        """Return all joints with a command or a torque, whose columns have these names by quantity."""
        patterns = {key: names[key] for key in ("command", "torque") if JOINT in names.get(key, "")}
        return {joint for key, pattern in patterns.items() for joint in self._match(pattern, key)}

    def _list(self) -> str:
        names = [name for name in self.columns if name not in (*DECLARED, "notes")]
        return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")

    def _find(self, quantity: str, joints: Sequence[str]) -> str | None:
        """Return the pattern under which all ``joints`` have a column of a quantity, or None if no joint has one.

        Raises BadInput if only some of them have one, or if none has a column of the name that the user gave.
        """
        for pattern in self.patterns[quantity]:
            if JOINT not in pattern and len(joints) > 1 and quantity not in ("kp", "kd"):  # it is of one joint
                is_given = (pattern,) == self.patterns[quantity]
                require(not is_given, "--names", f"{quantity}={pattern}", f"must contain {JOINT}")
                continue
            missing = [name for joint in joints if (name := pattern.replace(JOINT, joint)) not in self.columns]
            if not missing:
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
        tried = " or ".join(self.patterns["angle"])
        has_header = not all(name.isdigit() for name in self.columns)
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
            if name not in claimed and (joint.isdigit() or not is_number)
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
