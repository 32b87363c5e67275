"""Reads a log: the columns of its files, under the names and in the units of each quantity, become a :class:`Log`."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.addons.gap.arrays import AXES, split_arrays
from cmacexp.addons.gap.bags import read_bag
from cmacexp.addons.gap.files import join_files
from cmacexp.addons.gap.log import KEY, Log
from cmacexp.addons.gap.names import (
    COMMAND,
    JOINT,
    PATTERNS,
    RATE,
    SEPARATORS,
    find_given,
    find_times,
    list_patterns,
    match_columns,
)
from cmacexp.addons.gap.readers import COMPRESSED, READERS, Reader
from cmacexp.addons.gap.table import COUNTS, UNITS, Table
from cmacexp.addons.gap.times import read_time
from cmacexp.errors import BadInput, CmacexpError, require
from cmacexp.typing import Array

MOST_TURNED = 30.0
"""Largest turn of the orientation of a base that is held, degrees."""


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
        counts = ", or counts of an encoder, such as 4096/rev" * ("rev" in allowed)
        is_known = unit in allowed or ("rev" in allowed and COUNTS.fullmatch(unit))
        require(is_known, "--units", f"{quantity}={unit}", f"{mistake} {', '.join(allowed or UNITS)}{counts}")
    for quantity in names or {}:
        mistake = f"is no quantity of a log, which are {', '.join(PATTERNS)}"
        require(quantity in PATTERNS, "--names", quantity, mistake)
    gain_columns = {key: np.array(values) for key, values in (gains or {}).items()}
    given = {key: (find_given(columns, key, name, joints),) for key, name in (names or {}).items()}
    taken = {name for (pattern,) in given.values() for name in match_columns(pattern, columns)} | {
        pattern for (pattern,) in given.values()
    }
    free = {name: values for name, values in columns.items() if name not in taken}
    if rate is not None:
        columns[RATE] = np.arange(max(map(np.size, columns.values()), default=0)) / rate
    patterns = {
        **{key: list_patterns(tried, free) for key, tried in PATTERNS.items()},
        "time": (*list_patterns(PATTERNS["time"], free), *find_times(free)),
        **given,
        **{key: (key,) for key in gain_columns},
        **({} if rate is None else {"time": (RATE,)}),
    }
    known = {**(units or {}), **({} if rate is None else {"time": "s"})}
    return _make_log(Table(path, columns | gain_columns, patterns, known, left_out))


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
        cause = "it holds Python objects" if "allow_pickle" in reason else reason
        raise BadInput(KEY, path, f"cannot be read ({cause}): write a reader, --reader FILE.py:FUNCTION") from error


def _make_log(table: Table) -> Log:
    """Return the log; raise BadInput."""
    joints = table.find_joints()
    names = dict[str, str]()
    notes = [*map(str, table.columns.get("notes", ()))]
    time = read_time(table, notes)
    if time is None:
        raise BadInput(
            KEY,
            table.path,
            f"has no column of time: --rate HZ, or name it, --names time=NAME; it has {table.list_columns()}",
        )

    def read(quantity: str, suffixes: Sequence[str] = joints, missing: Array | None = None) -> Any:
        if (pattern := table.find(quantity, suffixes)) is None:
            return missing
        names[quantity] = pattern
        return table.read_all(quantity, pattern, suffixes, time.size, notes)

    said = len(notes)
    angle = read("angle")
    command, torque = read("command"), read("torque")
    if torque is not None and not np.nan_to_num(torque).any():
        torque = None
        notes.append("Torques are 0 in all rows, and not used.")
    if command is not None and (command == command[:1]).all():
        command = None
        notes.append("Commands are the same in all rows, and not used.")
    without_angle = _list_joints(table, names).difference(joints)
    if absent := sorted(without_angle.difference(table.left_out), key=lambda joint: (len(joint), joint)):
        columns = ", ".join(names["angle"].replace(JOINT, joint) for joint in absent)
        listed = ",".join(absent)
        lacks = f"has no column {columns} for angle of joint {listed}, which has a command or torque"
        raise BadInput(KEY, table.path, f"{lacks}: rename it, or --leave-out {listed}")
    log = Log(
        path=table.path,
        time=time,
        joints=tuple(joint or "0" for joint in joints),
        angle=angle,
        command=command,
        command_velocity=read("command_velocity", missing=np.zeros_like(angle)),
        torque=torque,
        feedforward=read("feedforward", missing=np.zeros_like(angle)),
        kp=table.read_gain("kp", joints),
        kd=table.read_gain("kd", joints),
        orientation=_check_turning(read("orientation", AXES), notes),
        velocity=_check_finite(read("velocity")),
        rows=np.arange(len(time)),
        names=names,
        is_unit_known=torque is None or table.is_unit_known(names["torque"]),
        notes=(*notes, *_note_passive(table, names), *_note_unused(table, names)),
    )
    require(
        command is not None or torque is not None,
        KEY,
        table.path,
        f"has neither commanded angles nor torques{''.join(f'; {note[:-1].lower()}' for note in notes[said:])}: name "
        "them, --names command=..., or torque=NAME_{joint}, or give the files that have them too; it has "
        f"{table.list_columns()}",
    )
    require(
        torque is not None or log.has_gains,
        KEY,
        table.path,
        "has neither both gains of the drives, --kp and --kd, nor torques found by name: give the gains, or name "
        f"torques, --names torque=NAME_{JOINT} or, of one joint, torque=NAME; it has {table.list_columns()}",
    )
    for quantity, unit in table.units.items():
        require(
            quantity in (*names, "time"),
            "--units",
            f"{quantity}={unit}",
            f"the log has no {quantity}; it has {', '.join(('time', *names))}",
        )
    return log.leave_out([joint for joint in table.left_out if joint not in without_angle])


def _list_joints(table: Table, names: Mapping[str, str]) -> set[str]:
    """Return all joints with a command or a torque, whose columns have these names by quantity."""
    patterns = {key: names[key] for key in ("command", "torque") if JOINT in names.get(key, "")}
    return {joint for key, pattern in patterns.items() for joint in table.match(pattern, key)}


def _note_passive(table: Table, names: Mapping[str, str]) -> Iterable[str]:
    """Yield a note on joints without a torque beside joints with one, whose columns have these names."""
    moved = table.match(names["torque"], "torque") if JOINT in names.get("torque", "") else []
    passive = [joint for joint in table.find_joints() if moved and joint not in (*moved, *table.left_out)]
    if passive:
        yield f"No torque of {', '.join(passive)} is logged: taken as passive, 0 N m."


def _note_unused(table: Table, names: Mapping[str, str]) -> Iterable[str]:
    """Yield a note on columns named like commands in a log without; ``names`` are those of its columns."""
    patterns = [pattern for pattern in names.values() if JOINT in pattern]
    used = {name for pattern in patterns for name in match_columns(pattern, table.columns)}
    unused = [name for name in table.columns if name not in used and COMMAND.search(name.translate(SEPARATORS))]
    if "command" not in names and unused:
        listed = ", ".join(unused[:3]) + f" and {len(unused) - 3} more" * (len(unused) > 3)
        yield f"Columns {listed} are named like commands, and not used; name them, --names command=NAME_{JOINT}."


def _check_turning(orientation: Array | None, notes: list[str]) -> Array | None:
    """Return the orientation (n, 4) of a base that was held; None, which is added to ``notes``, if it turns far."""
    if orientation is None or not np.isfinite(orientation).any():
        return None
    first = orientation[np.isfinite(orientation).all(axis=1).argmax()]
    turn = 2.0 * np.degrees(np.arccos(np.clip(np.nanmin(np.abs(orientation @ first)), 0.0, 1.0)))
    if turn < MOST_TURNED:
        return orientation
    notes.append(
        f"The orientation turns by {turn:.0f} degrees, and is not used: it is not that of a base that was held."
    )
    return None


def _check_finite(velocity: Array | None) -> Array | None:
    """Return velocities by which a log can be checked; None if some are missing, or all are 0."""
    return velocity if velocity is not None and velocity.any() and np.isfinite(velocity).all() else None
