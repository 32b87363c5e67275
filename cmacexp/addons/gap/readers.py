"""Readers of logs: Parquet, CSV, NPZ, MCAP, bags of ROS, and functions of users for other formats.

A reader is a function from a path to columns by name, arrays (n,) or (n, J). Declarations that hold for all rows of a
file, see DECLARED, are columns too.
"""

import re
import runpy
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import BadInput, require, require_extra

Columns = Mapping[str, NDArray[Any]]
"""Columns of a log by name."""
Reader = Callable[[Path], Columns]

COMPRESSED = (".gz", ".bz2", ".xz", ".zst")
"""Last suffixes of compressed CSV files."""
DECLARED = ("units", "kp", "kd")
"""Declarations of a file: units in any order, and gains, one for all joints or one for each, separated by commas."""


def split_declarations(texts: Mapping[str, str]) -> Columns:
    """Return the declarations of DECLARED among the ``texts`` of a file by name, split at commas into arrays (n,)."""
    return {name: np.array(texts[name].split(",")) for name in DECLARED if name in texts}


def read_parquet(path: Path) -> Columns:
    """Read the columns of a Parquet file, lists as arrays (n, J), and the declarations in its metadata."""
    import pyarrow.parquet as parquet

    table = parquet.read_table(path)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    lists = {
        name: np.stack(values)
        for name, values in columns.items()
        if values.dtype == object and isinstance(values[0], np.ndarray | list)
    }
    texts = {key.decode(): text.decode() for key, text in (table.schema.metadata or {}).items()}
    return {**columns, **lists, **split_declarations(texts)}


def read_csv(path: Path) -> Columns:
    """Read the columns of a text file, perhaps compressed; lines ``# NAME: VALUE`` declare units or gains.

    Columns are separated by semicolons, tabs, commas or spaces; beside separators other than commas, numbers may have
    decimal commas. A column without a name has its number, from 1 on, as name; a line of names may begin with ``#``.
    Raises ValueError if two columns have one name.
    """
    import io

    import pandas

    # pandas opens compressed files; each line is one value
    table = pandas.read_csv(
        path, sep="\0", header=None, engine="python", dtype=str, quoting=3, encoding_errors="replace"
    )
    lines = [line for line in table[0].str.strip() if line]
    comments = [line[1:].partition(":") for line in lines if line.startswith("#")]
    declared = split_declarations({key.strip(): value for key, _, value in comments})
    rows = [line for line in lines if not line.startswith("#")]
    separator = next((mark for mark in ";\t," if mark in rows[-1]), r"\s+")  # a name may contain any of them
    decimal = "," if separator != "," and "," in rows[-1] else "."
    names = _split(rows[0], separator)
    if has_numbers := all(is_number(name.replace(decimal, ".")) for name in names):
        heads = [_split(line[1:].strip(), separator) for line in lines if line.startswith("#")]
        names = next((head for head in heads if len(head) == len(names)), [str(k + 1) for k in range(len(names))])
    names = [name or str(k + 1) for k, name in enumerate(names)]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"its column {twice[0]} comes twice")
    text = io.StringIO("\n".join(rows if has_numbers else rows[1:]))
    frame = pandas.read_csv(text, sep=separator, names=names, decimal=decimal, skipinitialspace=True, index_col=False)
    return {**{name: frame[name].to_numpy() for name in names}, **declared}


def _split(line: str, separator: str) -> list[str]:
    """Split a line at a separator, and remove spaces and quotes around its words."""
    return [word.strip().strip("\"'") for word in re.split(separator, line)]


def is_number(value: Any) -> bool:
    """Return True if a value, such as a text, is a number."""
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def read_npz(path: Path) -> Columns:
    """Read the arrays of an NPZ file; pickled objects are refused."""
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


Topics = Mapping[str, list[tuple[int, dict[str, Any]]]]
"""Messages by topic: time, ns, and values by name."""
COMMAND_WORDS = ("command", "cmd", "desired", "target", "reference", "setpoint")
"""Words in the name of a topic of joint states that are commands."""


def read_mcap(path: Path) -> Columns:
    """Read an MCAP file: joint states and trajectories of ROS 2, see :func:`read_bag`, or numbers in JSON messages.

    Numbers become columns ``TOPIC_FIELD``. Rows are the messages of the most frequent topic; other topics are held
    from one message to the next.
    """
    import json

    require_extra("mcap")
    from mcap.reader import make_reader

    topics = defaultdict[str, list[tuple[int, dict[str, Any]]]](list)
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding == "cdr":
                return read_bag(path)
            if channel.message_encoding == "json":
                topics[channel.topic.strip("/")].append((message.log_time, json.loads(message.data)))
    if not topics:
        raise ValueError("it holds neither JSON nor ROS 2 messages; write a reader for its encoding")
    return _join(
        {
            topic: [
                (
                    at,
                    {
                        f"{topic}_{name}": value
                        for name, value in values.items()
                        if isinstance(value, int | float | list)
                    },
                )
                for at, values in messages
            ]
            for topic, messages in topics.items()
        }
    )


def read_bag(path: Path) -> Columns:
    """Read joints in a bag of ROS: a folder of rosbag2, a file ``.db3`` or ``.mcap``, or a ``.bag`` of ROS 1.

    ``sensor_msgs/JointState`` gives angles and torques, or commands if its topic is named so;
    ``trajectory_msgs/JointTrajectory`` gives the commands of its first point, and states of controllers both. Joints
    are matched by name in each message. Times are those of the headers, or of the recorder without them.
    """
    require_extra("rosbags")
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    topics = defaultdict[str, list[tuple[int, dict[str, Any]]]](list)
    kinds = set[str]()
    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag:
        for connection, at, raw in bag.messages():
            kind = connection.msgtype.rpartition("/")[2]
            kinds.add(kind)
            if kind not in JOINT_MESSAGES:
                continue
            message: Any = bag.deserialize(raw, connection.msgtype)
            values = JOINT_MESSAGES[kind](message, any(word in connection.topic.lower() for word in COMMAND_WORDS))
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            topics[connection.topic].append((stamp or at, values))
    if not topics:
        listed = ", ".join(sorted(kinds)) or "none"
        raise ValueError(f"its messages are {listed}, and none of {', '.join(JOINT_MESSAGES)}; write a reader")
    return _join(topics)


def _name_joints(joints: Sequence[str], signals: Mapping[str, Any]) -> dict[str, float]:
    """Return the values of signals by ``SIGNAL_JOINT``; signals that lack joints are left out."""
    return {
        f"{signal}_{joint}": float(value)
        for signal, values in signals.items()
        if values is not None and len(values) == len(joints)
        for joint, value in zip(joints, values, strict=True)
    }


def _read_joint_state(message: Any, is_command: bool) -> dict[str, float]:
    names = ("q_des", "dq_des", "tau_ff") if is_command else ("q", "dq", "tau")
    signals = dict(zip(names, (message.position, message.velocity, message.effort), strict=True))
    return _name_joints(message.name, signals)


def _read_trajectory(message: Any, is_command: bool) -> dict[str, float]:
    point = next(iter(message.points), None)
    signals = {} if point is None else {"q_des": point.positions, "dq_des": point.velocities, "tau_ff": point.effort}
    return _name_joints(message.joint_names, signals)


def _read_controller(message: Any, is_command: bool) -> dict[str, float]:
    actual, desired = (
        getattr(message, new if hasattr(message, new) else old)
        for new, old in (("feedback", "actual"), ("reference", "desired"))
    )
    signals = {
        "q": actual.positions,
        "tau": actual.effort,
        "q_des": desired.positions,
        "dq_des": desired.velocities,
    }
    return _name_joints(message.joint_names, signals)


JOINT_MESSAGES: dict[str, Callable[[Any, bool], dict[str, float]]] = {
    "JointState": _read_joint_state,
    "JointTrajectory": _read_trajectory,
    "JointTrajectoryControllerState": _read_controller,
}
"""Readers of messages of ROS by their type; the second argument is true for a topic of commands."""


def _join(topics: Topics) -> Columns:
    """Join messages of topics into columns at the times of the most frequent one, from 0 on, s.

    Each value is held until its next message; before its first one it has its first value. A value of
    several topics is taken from the topic with the most messages, which a note says.
    """
    ordered = sorted(topics, key=lambda topic: len(topics[topic]), reverse=True)
    times = np.array([at for at, _ in topics[ordered[0]]])
    columns: dict[str, NDArray[Any]] = {"time": (times - times[0]) * 1e-9}
    notes = list[str]()
    for topic in ordered:
        series = defaultdict[str, list[tuple[int, Any]]](list)
        for at, values in sorted(topics[topic], key=lambda message: message[0]):
            for name, value in values.items():
                series[name].append((at, value))
        if known := [name for name in series if name in columns]:
            notes.append(f"Topic {topic} was ignored for {', '.join(known)}, which a more frequent topic has.")
        for name in (name for name in series if name not in known):
            last = np.searchsorted([at for at, _ in series[name]], times, side="right") - 1
            columns[name] = np.array([series[name][max(k, 0)][1] for k in last], dtype=float)
    return {**dict(sorted(columns.items(), key=lambda item: item[0] != "time")), "notes": np.array(notes, dtype=str)}


READERS: dict[str, Reader] = {
    ".parquet": read_parquet,
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat"), read_csv),
    ".npz": read_npz,
    ".mcap": read_mcap,
    **dict.fromkeys((".db3", ".bag"), read_bag),
}
"""Readers by suffix of the file."""


def load_reader(spec: str) -> Reader:
    """Load a reader that a user wrote, ``FILE.py:FUNCTION``; raise BadInput if it cannot be loaded."""
    file, _, name = spec.partition(":")
    require(Path(file).is_file(), "--reader", spec, "there is no such file; it must be FILE.py:FUNCTION")
    try:
        reader: Any = runpy.run_path(file).get(name)
    except Exception as error:
        raise BadInput("--reader", spec, f"{file} cannot be run ({type(error).__name__}: {error})") from error
    require(callable(reader), "--reader", spec, f"{file} has no function {name}; it must be FILE.py:FUNCTION")
    return reader  # type: ignore[no-any-return]
