"""LowCmd and LowState of Unitree's quadrupeds: where each field lies in the bytes, and the checksum of a command.

Names, types and order are those of Unitree's public interface files (``unitree_go/msg``). On the wire messages are in
CDR, in which a number lies at a multiple of its size; the checksum is that of the same fields as a C compiler lays
them out, where each structure begins at a multiple of its largest number. One table gives both.
"""

import zlib
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Field = tuple[str, Any, int]
"""Name, type (of NumPy, or the fields of a structure) and how many."""
Bytes = NDArray[np.uint8]

MOTOR_CMD: Sequence[Field] = (
    ("mode", "u1", 1), ("q", "f4", 1), ("dq", "f4", 1), ("tau", "f4", 1), ("kp", "f4", 1), ("kd", "f4", 1),
    ("reserve", "u4", 3),
)  # fmt: skip
"""q in rad, dq in rad/s, tau in N m, kp in N m/rad, kd in N m s/rad."""
BMS_CMD: Sequence[Field] = (("off", "u1", 1), ("reserve", "u1", 3))
IMU_STATE: Sequence[Field] = (
    ("quaternion", "f4", 4), ("gyroscope", "f4", 3), ("accelerometer", "f4", 3), ("rpy", "f4", 3),
    ("temperature", "u1", 1),
)  # fmt: skip
"""Quaternion w, x, y, z; rad/s and m/s^2 in the frame of the body, x forward, y left, z up."""
MOTOR_STATE: Sequence[Field] = (
    ("mode", "u1", 1), ("q", "f4", 1), ("dq", "f4", 1), ("ddq", "f4", 1), ("tau_est", "f4", 1), ("q_raw", "f4", 1),
    ("dq_raw", "f4", 1), ("ddq_raw", "f4", 1), ("temperature", "u1", 1), ("lost", "u4", 1), ("reserve", "u4", 2),
)  # fmt: skip
"""Temperature in degrees Celsius; lost: packets of the motor's bus, counted."""
BMS_STATE: Sequence[Field] = (
    ("version_high", "u1", 1), ("version_low", "u1", 1), ("status", "u1", 1), ("soc", "u1", 1), ("current", "i4", 1),
    ("cycle", "u2", 1), ("bq_ntc", "u1", 2), ("mcu_ntc", "u1", 2), ("cell_vol", "u2", 15),
)  # fmt: skip
HEAD: Sequence[Field] = (
    ("head", "u1", 2), ("level_flag", "u1", 1), ("frame_reserve", "u1", 1), ("sn", "u4", 2), ("version", "u4", 2),
    ("bandwidth", "u2", 1),
)  # fmt: skip
LOW_CMD: Sequence[Field] = (
    *HEAD, ("motor_cmd", MOTOR_CMD, 20), ("bms_cmd", BMS_CMD, 1), ("wireless_remote", "u1", 40), ("led", "u1", 12),
    ("fan", "u1", 2), ("gpio", "u1", 1), ("reserve", "u4", 1), ("crc", "u4", 1),
)  # fmt: skip
LOW_STATE: Sequence[Field] = (
    *HEAD, ("imu_state", IMU_STATE, 1), ("motor_state", MOTOR_STATE, 20), ("bms_state", BMS_STATE, 1),
    ("foot_force", "i2", 4), ("foot_force_est", "i2", 4), ("tick", "u4", 1), ("wireless_remote", "u1", 40),
    ("bit_flag", "u1", 1), ("adc_reel", "f4", 1), ("temperature_ntc1", "u1", 1), ("temperature_ntc2", "u1", 1),
    ("power_v", "f4", 1), ("power_a", "f4", 1), ("fan_frequency", "u2", 4), ("reserve", "u4", 1), ("crc", "u4", 1),
)  # fmt: skip
"""power_v in V; feet in the order of the motors."""
STRUCTURES = {
    "MotorCmd_": MOTOR_CMD, "BmsCmd_": BMS_CMD, "LowCmd_": LOW_CMD, "IMUState_": IMU_STATE,
    "MotorState_": MOTOR_STATE, "BmsState_": BMS_STATE, "LowState_": LOW_STATE,
}  # fmt: skip
"""Structures by their names on the wire; those inside others come before them."""

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""What precedes a message: plain CDR, least byte first."""
JOINTS = np.array([[3, 4, 5], [0, 1, 2], [9, 10, 11], [6, 7, 8]])
"""(4, 3): motors of the legs of this project, left front, right front, left rear, right rear: hip, thigh, calf."""
MOTORS_ON, LEVEL_LOW = 0x01, 0xFF
HEADER = (0xFE, 0xEF)


class Layout(NamedTuple):
    """Where the numbers of a message lie."""

    places: dict[str, tuple[str, NDArray[np.intp]]]
    """By the name, as ``motor_cmd.q``: type, and offsets in bytes."""
    size: int
    """In bytes."""


def _align(at: int, size: int) -> int:
    return -(-at // size) * size


def _largest(kind: Any) -> int:
    """The size of the largest number of a field, in bytes."""
    return np.dtype(kind).itemsize if isinstance(kind, str) else max(_largest(inner) for _, inner, _ in kind)


@cache
def lay_out(structure: str, in_c: bool = False) -> Layout:
    """The layout of one of STRUCTURES in CDR, or as a C compiler makes it."""
    found: dict[str, tuple[str, list[int]]] = {}
    fields = STRUCTURES[structure]

    def place(fields: Sequence[Field], at: int, before: str) -> int:
        for name, kind, count in fields:
            for _ in range(count):
                if isinstance(kind, str):
                    size = np.dtype(kind).itemsize
                    at = _align(at, size)
                    found.setdefault(before + name, (kind, []))[1].append(at)
                    at += size
                else:
                    whole = _largest(kind) if in_c else 1
                    at = _align(place(kind, _align(at, whole), f"{before}{name}."), whole)
        return at

    size = _align(place(fields, 0, ""), _largest(fields) if in_c else 1)
    return Layout({name: (kind, np.array(at)) for name, (kind, at) in found.items()}, size)


@cache
def _checked_bytes() -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """Bytes of a command in CDR that its checksum covers, where it takes each, and of how many; the others are 0.

    It takes words of four bytes with the most significant byte first, and not the last word, which is itself.
    """
    wire, compiled = lay_out("LowCmd_"), lay_out("LowCmd_", in_c=True)
    pairs = [
        (source + n, (target + n) ^ 3)
        for name, (kind, places) in wire.places.items()
        if name != "crc"
        for source, target in zip(places.tolist(), compiled.places[name][1].tolist(), strict=True)
        for n in range(np.dtype(kind).itemsize)
    ]
    sources, targets = np.array(pairs).T
    return sources, targets, compiled.size - 4


REVERSED = np.array([int(f"{value:08b}"[::-1], 2) for value in range(256)], dtype=np.uint8)
"""Bytes whose bits are in the opposite order."""


def compute_checksum(body: Bytes) -> int:
    """CRC-32/MPEG-2 (polynomial 0x04c11db7, start 0xffffffff) of a LowCmd without its header.

    zlib has the same polynomial, but takes the least bit first, and inverts the result.
    """
    sources, targets, size = _checked_bytes()
    words = np.zeros(size, dtype=np.uint8)
    words[targets] = body[sources]
    value = zlib.crc32(REVERSED[words].tobytes()) ^ 0xFFFFFFFF
    return int(f"{value:032b}"[::-1], 2)


class Message:
    """The bytes of a message, with its numbers by name."""

    def __init__(self, structure: str, data: bytes | None = None):
        """A message of a ``structure`` of STRUCTURES: of the ``data`` on the wire, or all 0.

        Raises ValueError if the data is of another kind, or of another length.
        """
        self.layout = lay_out(structure)
        size = len(LITTLE_ENDIAN) + self.layout.size
        if data is not None and (data[:2] != LITTLE_ENDIAN[:2] or not size <= len(data) <= size + 3):
            raise ValueError(
                f"{structure}: {len(data)} bytes that begin with {data[:4].hex()}, not {size} of plain CDR"
            )
        self.buffer = np.zeros(_align(size, 4), dtype=np.uint8)
        given = np.frombuffer(data or LITTLE_ENDIAN, dtype=np.uint8)[:size]
        self.buffer[: len(given)] = given
        self.body = self.buffer[len(LITTLE_ENDIAN) :]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The numbers of a field, (count,), of all structures of that name one after the other."""
        numbers, places = self._find(name)
        return numbers[places]

    def __setitem__(self, name: str, values: Any) -> None:
        numbers, places = self._find(name)
        numbers[places] = values

    def _find(self, name: str) -> tuple[NDArray[Any], NDArray[np.intp]]:
        """The whole body as numbers of the type of a field, and which of them are the field's."""
        kind, places = self.layout.places[name]
        size = np.dtype(kind).itemsize
        return self.body[: len(self.body) // size * size].view(kind), places // size

    def tobytes(self) -> bytes:
        """What goes on the wire."""
        return self.buffer.tobytes()


def new_command() -> Message:
    """A LowCmd that asks nothing of the motors but to listen."""
    command = Message("LowCmd_")
    command["head"], command["level_flag"] = HEADER, LEVEL_LOW
    set_each_motor(command, "motor_cmd.mode", MOTORS_ON)
    return command


def set_motors(command: Message, **values: Any) -> None:
    """Set fields of the motors, each (L, 3) in the order of this project or one number, and the checksum."""
    for name, given in values.items():
        set_each_motor(command, f"motor_cmd.{name}", given)
    command["crc"] = compute_checksum(command.body)


def set_each_motor(message: Message, name: str, values: Any) -> None:
    """Set a field of the motors, as ``motor_state.q``, from (L, 3) in the order of this project, or one number."""
    motors = message[name]
    motors[JOINTS] = values
    message[name] = motors


def get_motors(message: Message, name: str) -> NDArray[np.float64]:
    """A field of the motors, as ``motor_state.q``, (L, 3) in the order of this project."""
    return message[name][JOINTS].astype(np.float64)
