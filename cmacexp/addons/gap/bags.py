"""Readers of MCAP files and bags of ROS: joints by name, at the times of the most frequent topic."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import require_extra

Topics = Mapping[str, list[tuple[int, dict[str, Any]]]]
"""Messages by topic: time, ns, and values by name."""
COMMAND_WORDS = ("command", "cmd", "desired", "target", "reference", "setpoint")
"""Words in the name of a topic of joint states that are commands."""


def read_mcap(path: Path) -> Mapping[str, NDArray[Any]]:
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
    return _join({topic: [(at, _name_fields(topic, it)) for at, it in sent] for topic, sent in topics.items()})


def _name_fields(topic: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a JSON message by ``TOPIC_FIELD``, of joint states as those of ROS."""
    if {"name", "position"} <= fields.keys():
        message = SimpleNamespace(**({"velocity": None, "effort": None} | dict(fields)))
        return _read_joint_state(message, _is_command(topic))
    return {f"{topic}_{name}": value for name, value in fields.items() if isinstance(value, int | float | list)}


def _is_command(topic: str) -> bool:
    """Return True if the name of a topic says that its joint states are commands."""
    return any(word in topic.lower() for word in COMMAND_WORDS)


def read_bag(path: Path) -> Mapping[str, NDArray[Any]]:
    """Read joints in a bag of ROS: a folder of rosbag2, a file ``.db3`` or ``.mcap``, or a ``.bag`` of ROS 1.

    ``sensor_msgs/JointState`` gives angles and torques, or commands if its topic is named so;
    ``trajectory_msgs/JointTrajectory`` gives the commands of its first point, and states of controllers both;
    ``sensor_msgs/Imu`` gives the orientation of the base. Joints are matched by name in each message. Times are those
    of the headers, or of the recorder without them.
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
            values = JOINT_MESSAGES[kind](message, _is_command(connection.topic))
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            topics[connection.topic].append((stamp or at, values))
    if not topics:
        listed = ", ".join(sorted(kinds)) or "none"
        raise ValueError(f"its messages are {listed}, and none of {', '.join(JOINT_MESSAGES)}; write a reader")
    return _join(topics)


def _name_joints(joints: Sequence[str], signals: Mapping[str, Any]) -> dict[str, float]:
    """Return the values of signals by ``SIGNAL_JOINT``; signals that lack joints are left out.

    Joints without names are counted.
    """
    first = next((values for values in signals.values() if values is not None and len(values)), ())
    joints = joints or [str(k) for k in range(len(first))]
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


def _read_imu(message: Any, is_command: bool) -> dict[str, float]:
    turn = message.orientation
    values = {"qw": turn.w, "qx": turn.x, "qy": turn.y, "qz": turn.z}
    return values if any(values.values()) else {}  # zero: the IMU does not know it


JOINT_MESSAGES: dict[str, Callable[[Any, bool], dict[str, float]]] = {
    "JointState": _read_joint_state,
    "JointTrajectory": _read_trajectory,
    "JointTrajectoryControllerState": _read_controller,
    "Imu": _read_imu,
}
"""Readers of messages of ROS by their type; the second argument is true for a topic of commands."""


def _join(topics: Topics) -> Mapping[str, NDArray[Any]]:
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
