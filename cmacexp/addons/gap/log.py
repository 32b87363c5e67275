"""A log of a robot: what was measured and commanded, joint by joint, from Parquet, CSV, NPZ, MCAP or a reader.

A reader is a function from a path to columns by name, arrays (n,) or (n, J); any other format needs one. What a file
declares of all rows, see DECLARED, stands among its columns.
"""

import re
import runpy
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput, require, require_extra, suggest
from cmacexp.typing import Array

Columns = Mapping[str, NDArray[Any]]
Reader = Callable[[Path], Columns]

KEY = "LOG"
"""What errors call the file."""
JOINT = "{joint}"
PATTERNS: dict[str, tuple[str, ...]] = {
    "time": ("time", "t", "timestamp", "time_s", "stamp"),
    "angle": (
        "q_{joint}", "{joint}_q", "pos_{joint}", "{joint}_pos", "position_{joint}", "{joint}_position", "{joint}.pos",
    ),
    "command": (
        "q_des_{joint}", "{joint}_q_des", "cmd_{joint}", "{joint}_cmd", "command_{joint}", "{joint}_command",
        "target_{joint}", "{joint}_target",
    ),
    "command_velocity": ("dq_des_{joint}", "qd_des_{joint}", "{joint}_dq_des"),
    "torque": ("tau_{joint}", "{joint}_tau", "torque_{joint}", "{joint}_torque", "effort_{joint}"),
    "feedforward": ("tau_ff_{joint}", "{joint}_tau_ff"),
    "kp": ("kp_{joint}", "kp"),
    "kd": ("kd_{joint}", "kd"),
    "orientation": ("quat_{joint}", "q{joint}"),
}  # fmt: skip
"""What a log can hold, and the names that are tried for it, of which the first that occurs counts."""
DECLARED = ("units", "kp", "kd")
"""Units in any order, and one gain for all joints or one for each, separated by commas."""
AXES = ("w", "x", "y", "z")
"""What stands for the joint in the names of an orientation."""
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "rev": 2.0 * np.pi, "m": 1.0, "mm": 1e-3}
TORQUES = {"N m": 1.0, "Nm": 1.0, "mN m": 1e-3, "mNm": 1e-3, "N": 1.0}
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "angle": ANGLES,
    "command": ANGLES,
    "command_velocity": {f"{unit}/s": factor for unit, factor in ANGLES.items()},
    "torque": TORQUES,
    "feedforward": TORQUES,
}
"""Units that a log may have, in those of the project."""


@dataclass(frozen=True)
class Log:
    """Signals (n, J) of J joints at n rows."""

    path: Path
    time: Array
    """(n,) from 0 on, s."""
    joints: tuple[str, ...]
    """Names in the log."""
    angle: Array
    """Measured, rad."""
    command: Array | None
    """Commanded angle, rad; None: the log has torques only."""
    command_velocity: Array
    """Commanded, rad/s; zero where the log has none."""
    torque: Array | None
    """Measured or applied, N m."""
    feedforward: Array
    """Torque that the drives added to their feedback, N m; zero where the log has none."""
    kp: Array
    """(J,) gains of the drives, N m/rad; NaN: unknown."""
    kd: Array
    """(J,) likewise, N m s/rad."""
    orientation: Array | None
    """(n, 4) of the base in the world, a quaternion w, x, y, z; None: it was held level."""
    names: Mapping[str, str] = field(default_factory=dict)
    """The pattern under which each quantity was found."""

    @property
    def period(self) -> float:
        """Median spacing of the rows, s."""
        return float(np.median(np.diff(self.time)))

    @property
    def has_gains(self) -> bool:
        """Whether the gains of all drives are known."""
        return bool(np.isfinite(self.kp).all() and np.isfinite(self.kd).all())

    def column(self, quantity: str, joint: int) -> str:
        """The name of the column of a quantity of a joint."""
        return self.names.get(quantity, quantity).replace(JOINT, self.joints[joint])

    def leave_out(self, joints: Sequence[str]) -> "Log":
        """The log without some joints; raises BadInput for a name that it does not have, and if no joint is left."""
        for name in joints:
            require(name in self.joints, "--leave-out", name, f"is no joint of the log{suggest(name, self.joints)}")
        kept = [j for j, name in enumerate(self.joints) if name not in joints]
        require(kept, "--leave-out", ",".join(joints), "leaves no joint of the log: keep at least one")
        signals = ("angle", "command", "command_velocity", "torque", "feedforward")
        cut: dict[str, Any] = {key: None if (own := vars(self)[key]) is None else own[:, kept] for key in signals}
        return replace(self, joints=tuple(self.joints[j] for j in kept), kp=self.kp[kept], kd=self.kd[kept], **cut)


def read_log(
    path: Path,
    names: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    gains: Mapping[str, Sequence[float]] | None = None,
    reader: Reader | None = None,
    left_out: Sequence[str] = (),
) -> Log:
    """Read the log in a file.

    Args:
        path: Parquet, CSV, NPZ or MCAP, by its suffix, or what ``reader`` reads.
        names: names of columns by quantity, see PATTERNS, with ``{joint}`` for the name of a joint.
        units: by quantity, see UNITS, over those that the file declares; else s, rad, N m.
        gains: ``kp`` and ``kd``, one number or one for each joint, over those in the file.
        reader: of another format.
        left_out: joints that are not used; one with a command or torque but no measured angle must be among them.

    Raises:
        BadInput: the file cannot be read, a column is missing or holds no numbers, a unit is unknown or of nothing
            that the log has, or the log has neither torques nor commands with the gains of the drives.
    """
    require(path.is_file(), KEY, path, "there is no such file")
    reader = reader or READERS.get(path.suffix.lower())
    if reader is None:
        raise BadInput(KEY, path, f"is no {', '.join(READERS)}: name a reader, --reader FILE.py:FUNCTION")
    try:
        columns = _flatten({name: np.asarray(values) for name, values in reader(path).items()})
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadInput(KEY, path, f"cannot be read ({reason})") from error
    for quantity, unit in (units or {}).items():
        known = UNITS.get(quantity, {})
        allowed = f"is no unit of {quantity}, which are" if known else "must name one of"
        require(unit in known, "--units", f"{quantity}={unit}", f"{allowed} {', '.join(known or UNITS)}")
    for quantity in names or {}:
        allowed = f"is no quantity of a log, which are {', '.join(PATTERNS)}"
        require(quantity in PATTERNS, "--names", quantity, allowed)
    given = {key: np.array(own) for key, own in (gains or {}).items()}
    patterns = PATTERNS | {key: (own,) for key, own in (names or {}).items()} | {key: (key,) for key in given}
    return _Table(path, columns | given, patterns, units or {}, left_out).make_log()


def _flatten(columns: Columns) -> dict[str, NDArray[Any]]:
    """Columns (n,): those of an array (n, J) get the names in ``joints`` or ``names``, or numbers."""
    found: dict[str, NDArray[Any]] = {}
    listed: list[str] = next((columns[key].tolist() for key in ("joints", "names") if key in columns), [])
    for name, values in columns.items():
        if values.ndim == 2:
            is_orientation = name in ("quat", "orientation")
            if is_orientation and values.shape[1] > len(AXES):
                raise ValueError(f"{name} has {values.shape[1]} columns, a quaternion {len(AXES)}: {', '.join(AXES)}")
            each = AXES if is_orientation else listed if len(listed) == values.shape[1] else range(values.shape[1])
            prefix = "quat" if is_orientation else name
            found |= {f"{prefix}_{own}": column for own, column in zip(each, values.T, strict=False)}
        elif name not in ("joints", "names"):
            found[name] = values
    return found


@dataclass(frozen=True)
class _Table:
    """The columns of a file, and how they are named and measured."""

    path: Path
    columns: dict[str, NDArray[Any]]
    patterns: Mapping[str, tuple[str, ...]]
    units: Mapping[str, str]
    left_out: Sequence[str]

    def make_log(self) -> Log:
        """The log; raises BadInput."""
        joints, names, without_angle = self._find_joints(), dict[str, str](), set[str]()

        def read(quantity: str, each: Sequence[str] = joints, missing: Array | None = None) -> Any:
            if (pattern := self._find(quantity, each)) is None:
                return missing
            names[quantity] = pattern
            if quantity in ("command", "torque") and JOINT in pattern:
                without_angle.update(own for own in self._match(pattern, quantity) if own not in joints)
            return np.stack([self._read(pattern.replace(JOINT, own), quantity) for own in each], axis=1)

        time, angle = read("time", [""]), read("angle")
        require(
            time is not None,
            KEY,
            self.path,
            f"has no column of time; name it, --names time=NAME; it has {self._list()}",
        )
        command, torque, zero = read("command"), read("torque"), np.zeros_like(angle)
        for own in sorted(without_angle.difference(self.left_out)):
            lacks = f"has no column {names['angle'].replace(JOINT, own)} for angle of joint {own}"
            raise BadInput(KEY, self.path, f"{lacks}, which has a command or torque: rename it, or --leave-out {own}")
        found = Log(
            path=self.path,
            time=time[:, 0] - time[:1, 0].sum(),
            joints=tuple(joints),
            angle=angle,
            command=command,
            command_velocity=read("command_velocity", missing=zero),
            torque=torque,
            feedforward=read("feedforward", missing=zero),
            kp=self._read_gain("kp", joints),
            kd=self._read_gain("kd", joints),
            orientation=read("orientation", AXES),
            names=names,
        )
        require(
            command is not None or torque is not None,
            KEY,
            self.path,
            "has neither commanded angles nor torques; name them, --names command=NAME_{joint}",
        )
        for key, gain in {"--kp": found.kp, "--kd": found.kd}.items():
            require(
                torque is not None or np.isfinite(gain).all(),
                key,
                None,
                "is missing: the log has neither torques nor the gains of the drives",
            )
        for quantity, unit in self.units.items():
            require(
                quantity in names,
                "--units",
                f"{quantity}={unit}",
                f"the log has no {quantity}; it has {', '.join(names)}",
            )
        return found.leave_out([own for own in self.left_out if own not in without_angle])

    def _list(self) -> str:
        names = list(self.columns)
        return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")

    def _find(self, quantity: str, joints: Sequence[str]) -> str | None:
        """The pattern under which a quantity occurs for all joints; None: it does not; raises BadInput."""
        for pattern in self.patterns[quantity]:
            missing = [name for own in joints if (name := pattern.replace(JOINT, own)) not in self.columns]
            if not missing:
                return pattern
            is_given = (pattern,) == self.patterns[quantity]
            is_angle = quantity == "orientation" and pattern in self.patterns["angle"]  # of joints x, y, z
            require(
                not is_given and (len(missing) == len(joints) or is_angle),
                KEY,
                self.path,
                f"has no column {missing[0]} for {quantity}{suggest(missing[0], self.columns)}",
            )
        return None

    def _find_joints(self) -> list[str]:
        """Names of the joints that have a measured angle; raises BadInput if there is none."""
        for pattern in self.patterns["angle"]:
            require(JOINT in pattern, "--names", f"angle={pattern}", f"must contain {JOINT}")
            if joints := self._match(pattern, "angle"):
                return joints
        tried = " or ".join(self.patterns["angle"])
        raise BadInput(
            KEY,
            self.path,
            f"has no measured angles under {tried}; name them, --names angle=NAME_{JOINT}; it has {self._list()}",
        )

    def _match(self, pattern: str, quantity: str) -> list[str]:
        """What stands for ``{joint}`` in the columns of a quantity, and of no other with a longer pattern."""

        def match(pattern: str) -> dict[str, str]:
            form = re.compile(re.escape(pattern).replace(re.escape(JOINT), "(.+)"))
            return {name: found[1] for name in self.columns if (found := form.fullmatch(name))}

        others = [each for key, own in self.patterns.items() if key != quantity for each in own if JOINT in each]
        claimed = {name for other in others if len(other) > len(pattern) for name in match(other)}
        return [own for name, own in match(pattern).items() if name not in claimed]

    def _get_numbers(self, name: str) -> Array:
        """A column (n,) as it is in the file; raises BadInput."""
        try:
            return np.atleast_1d(np.asarray(self.columns[name], dtype=float))
        except (TypeError, ValueError) as error:
            raise BadInput(KEY, self.path, f"holds no numbers in column {name} ({error})") from error

    def _read(self, name: str, quantity: str) -> Array:
        """A column (n,) in the units of the project; raises BadInput."""
        values = self._get_numbers(name)
        rows = self.columns[self._find("time", [""]) or name].size
        require(values.shape == (rows,), KEY, self.path, f"column {name} has {values.size} values, time has {rows}")
        known = UNITS.get(quantity, {})
        texts = np.atleast_1d(self.columns.get("units", ""))
        declared = [part.strip() for text in texts for part in re.split("[,;]", text)]
        unit = self.units.get(quantity) or next((each for each in declared if each in known), None)
        unknown = [each for each in declared if each and not any(each in own for own in UNITS.values())]
        allowed = f"must be one of {', '.join(known)} for {quantity}, or say --units {quantity}=UNIT"
        is_known = unit or not known or not unknown
        require(is_known, KEY, self.path, f"declares the unit {', '.join(unknown)}: {allowed}")
        return values * known[unit] if unit else values

    def _read_gain(self, key: str, joints: Sequence[str]) -> Array:
        """(J,) a gain; NaN if unknown; raises BadInput."""
        if (pattern := self._find(key, joints)) is None:
            return np.full(len(joints), np.nan)
        columns = np.array([self._get_numbers(pattern.replace(JOINT, own)) for own in joints])
        is_constant = (columns == columns[:, :1]).all()
        values: Array = columns[:, 0] if is_constant else columns[0]  # one number of each joint
        require(
            len(values) == len(joints) and ((values >= 0.0) & (values < np.inf)).all(),
            f"--{key}",
            ",".join(f"{value:g}" for value in values[:20]),
            f"must be one finite number from 0 on, or one for each of {len(joints)} joints, in all rows: cut the log "
            "where they are constant",
        )
        return values


def split_declarations(texts: Mapping[str, str]) -> Columns:
    """What a file declares of DECLARED, the parts of its text as an array (n,)."""
    return {name: np.array(texts[name].split(",")) for name in DECLARED if name in texts}


def read_parquet(path: Path) -> Columns:
    """Columns of a Parquet file, those of lists as arrays (n, J), with what its schema declares."""
    import pyarrow.parquet as parquet

    table = parquet.read_table(path)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    lists = {
        name: np.stack(own) for name, own in columns.items() if own.dtype == object and not isinstance(own[0], str)
    }
    texts = {key.decode(): text.decode() for key, text in (table.schema.metadata or {}).items()}
    return {**columns, **lists, **split_declarations(texts)}


def read_csv(path: Path) -> Columns:
    """Columns of a CSV file with a line of names; lines ``# NAME: VALUE`` declare units or gains."""
    import pandas

    with path.open(encoding="utf-8", errors="replace") as file:
        lines = file.readlines()
    head = next((line for line in lines if not line.startswith("#")), "")
    frame = pandas.read_csv(path, comment="#", sep=max(",;\t", key=head.count), skipinitialspace=True)
    comments = [line[1:].partition(":") for line in lines if line.startswith("#")]
    declared = split_declarations({key.strip(): value for key, _, value in comments})
    return {**{str(name).strip(): frame[name].to_numpy() for name in frame}, **declared}


def read_npz(path: Path) -> Columns:
    """Arrays of an NPZ file, without pickles."""
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def read_mcap(path: Path) -> Columns:
    """Numbers in JSON messages of an MCAP file, as ``TOPIC_FIELD``, at the times of the most frequent topic."""
    import json

    require_extra("mcap")
    from mcap.reader import make_reader

    topics = defaultdict[str, list[tuple[float, dict[str, Any]]]](list)
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding == "json":
                topics[channel.topic.strip("/")].append((message.log_time * 1e-9, json.loads(message.data)))
    if not topics:
        raise ValueError("it holds no JSON messages; write a reader for its encoding")
    columns: dict[str, NDArray[Any]] = {"time": np.array([at for at, _ in max(topics.values(), key=len)])}
    for topic, messages in topics.items():
        last = np.searchsorted([at for at, _ in messages], columns["time"], side="right") - 1
        numbers = [name for name, value in messages[0][1].items() if isinstance(value, int | float | list)]
        columns |= {f"{topic}_{name}": np.array([messages[max(k, 0)][1][name] for k in last]) for name in numbers}
    return columns


READERS: dict[str, Reader] = {".parquet": read_parquet, ".csv": read_csv, ".npz": read_npz, ".mcap": read_mcap}
"""Readers by the suffix of a file."""


def load_reader(spec: str) -> Reader:
    """The reader ``FILE.py:FUNCTION`` of a user; raises BadInput."""
    file, _, name = spec.partition(":")
    require(Path(file).is_file(), "--reader", spec, "there is no such file; it must be FILE.py:FUNCTION")
    try:
        reader: Any = runpy.run_path(file).get(name)
    except Exception as error:
        raise BadInput("--reader", spec, f"{file} cannot be run ({type(error).__name__}: {error})") from error
    require(callable(reader), "--reader", spec, f"{file} has no function {name}; it must be FILE.py:FUNCTION")
    return reader  # type: ignore[no-any-return]
