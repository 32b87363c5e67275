"""LowCmd and LowState of Unitree's quadrupeds: their structures, their bytes on the wire, the checksum of a command.

Names, types and order are those of Unitree's public interface files (``unitree_go/msg``). In memory a message is a
structured array of NumPy, laid out as a C compiler does it, of which the checksum is; on the wire it is in CDR, in
which a number lies at a multiple of its size, but a structure begins anywhere.
"""

import zlib
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Message = NDArray[np.void]
"""Of the shape (), with a type of STRUCTURES; ``message["motor_cmd"]["q"]`` are the numbers of all motors."""


MOTOR_CMD = np.dtype(
    [
        ("mode", "u1"), ("q", "f4"), ("dq", "f4"), ("tau", "f4"), ("kp", "f4"), ("kd", "f4"), ("reserve", "u4", 3),
    ],
    align=True,
)  # fmt: skip
"""q in rad, dq in rad/s, tau in N m, kp in N m/rad, kd in N m s/rad."""
BMS_CMD = np.dtype([("off", "u1"), ("reserve", "u1", 3)], align=True)
IMU_STATE = np.dtype(
    [
        ("quaternion", "f4", 4), ("gyroscope", "f4", 3), ("accelerometer", "f4", 3), ("rpy", "f4", 3),
        ("temperature", "u1"),
    ],
    align=True,
)  # fmt: skip
"""Quaternion w, x, y, z; rad/s and m/s^2 in the frame of the body, x forward, y left, z up."""
MOTOR_STATE = np.dtype(
    [
        ("mode", "u1"), ("q", "f4"), ("dq", "f4"), ("ddq", "f4"), ("tau_est", "f4"), ("q_raw", "f4"),
        ("dq_raw", "f4"), ("ddq_raw", "f4"), ("temperature", "u1"), ("lost", "u4"), ("reserve", "u4", 2),
    ],
    align=True,
)  # fmt: skip
"""Temperature in degrees Celsius; lost: packets of the motor's bus, counted."""
BMS_STATE = np.dtype(
    [
        ("version_high", "u1"), ("version_low", "u1"), ("status", "u1"), ("soc", "u1"), ("current", "i4"),
        ("cycle", "u2"), ("bq_ntc", "u1", 2), ("mcu_ntc", "u1", 2), ("cell_vol", "u2", 15),
    ],
    align=True,
)  # fmt: skip
HEAD = [
    ("head", "u1", 2), ("level_flag", "u1"), ("frame_reserve", "u1"), ("sn", "u4", 2), ("version", "u4", 2),
    ("bandwidth", "u2"),
]  # fmt: skip
LOW_CMD = np.dtype(
    [
        *HEAD, ("motor_cmd", MOTOR_CMD, 20), ("bms_cmd", BMS_CMD), ("wireless_remote", "u1", 40), ("led", "u1", 12),
        ("fan", "u1", 2), ("gpio", "u1"), ("reserve", "u4"), ("crc", "u4"),
    ],
    align=True,
)  # fmt: skip
LOW_STATE = np.dtype(
    [
        *HEAD, ("imu_state", IMU_STATE), ("motor_state", MOTOR_STATE, 20), ("bms_state", BMS_STATE),
        ("foot_force", "i2", 4), ("foot_force_est", "i2", 4), ("tick", "u4"), ("wireless_remote", "u1", 40),
        ("bit_flag", "u1"), ("adc_reel", "f4"), ("temperature_ntc1", "u1"), ("temperature_ntc2", "u1"),
        ("power_v", "f4"), ("power_a", "f4"), ("fan_frequency", "u2", 4), ("reserve", "u4"), ("crc", "u4"),
    ],
    align=True,
)  # fmt: skip
"""power_v in V; feet in the order of the motors."""
STRUCTURES = {
    MOTOR_CMD: "MotorCmd_", BMS_CMD: "BmsCmd_", LOW_CMD: "LowCmd_", IMU_STATE: "IMUState_",
    MOTOR_STATE: "MotorState_", BMS_STATE: "BmsState_", LOW_STATE: "LowState_",
}  # fmt: skip
"""Names of structures on the wire."""

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""What precedes a message: plain CDR, least byte first."""
PADDING = -1
JOINTS = np.array([[3, 4, 5], [0, 1, 2], [9, 10, 11], [6, 7, 8]])
"""(4, 3): motors of the legs of this project, left front, right front, left rear, right rear: hip, thigh, calf."""
MOTORS_ON, LEVEL_LOW = 0x01, 0xFF
HEADER = (0xFE, 0xEF)
REVERSED = np.array([int(f"{value:08b}"[::-1], 2) for value in range(256)], dtype=np.uint8)
"""Bytes whose bits are in the opposite order."""


def list_numbers(kind: np.dtype[Any], place: int = 0) -> Iterator[tuple[int, int]]:
    """Where in memory each number of a type lies, and its size, in bytes; the type itself lies at ``place``."""
    if kind.subdtype is not None:
        inner, (count,) = kind.subdtype
        for n in range(count):
            yield from list_numbers(inner, place + n * inner.itemsize)
    elif kind.fields is not None:
        for inner, offset, *_ in kind.fields.values():
            yield from list_numbers(inner, place + offset)
    else:
        yield place, kind.itemsize


@cache
def lay_out(kind: np.dtype[Any]) -> NDArray[np.intp]:
    """Where in memory each byte of a message in CDR lies; PADDING: nowhere."""
    found = list[int]()
    for place, size in list_numbers(kind):
        found += [PADDING] * (-len(found) % size)
        found += range(place, place + size)
    return np.array(found)


def encode(message: Message) -> bytes:
    """What goes on the wire."""
    memory = np.frombuffer(message.tobytes() + b"\0", dtype=np.uint8)  # whose last byte is the padding's
    return LITTLE_ENDIAN + memory[lay_out(message.dtype)].tobytes()


def decode(kind: np.dtype[Any], data: bytes) -> Message:
    """The message of a ``kind`` of STRUCTURES in the ``data`` on the wire.

    Raises ValueError if the data is of another kind, or of another length.
    """
    places, begin = lay_out(kind), len(LITTLE_ENDIAN)
    size = begin + len(places)
    if data[:2] != LITTLE_ENDIAN[:2] or not size <= len(data) <= size + 3:
        raise ValueError(f"{len(data)} bytes that begin with {data[:4].hex()}, not {size} of plain CDR")
    memory = np.zeros(kind.itemsize + 1, dtype=np.uint8)
    memory[places] = np.frombuffer(data, dtype=np.uint8)[begin:size]
    return memory[:-1].view(kind).reshape(())


def compute_checksum(command: Message) -> int:
    """CRC-32/MPEG-2 (polynomial 0x04c11db7, start 0xffffffff) of the words of a LowCmd but for itself, the last one.

    It takes the most significant byte of a word first. zlib has the same polynomial, but takes the least bit first,
    and inverts the result.
    """
    words = np.frombuffer(command.tobytes(), dtype="<u4")[:-1].astype(">u4")
    value = zlib.crc32(REVERSED[words.view(np.uint8)].tobytes()) ^ 0xFFFFFFFF
    return int(f"{value:032b}"[::-1], 2)


def new_command() -> Message:
    """A LowCmd that asks nothing of the motors but to listen."""
    command: Message = np.zeros((), LOW_CMD)
    command["head"] = HEADER
    command["level_flag"] = LEVEL_LOW
    command["motor_cmd"]["mode"][JOINTS] = MOTORS_ON
    return command


def set_motors(command: Message, **values: Any) -> None:
    """Set fields of the motors, each (L, 3) in the order of this project or one number, and the checksum."""
    for name, given in values.items():
        command["motor_cmd"][name][JOINTS] = given
    command["crc"] = compute_checksum(command)


def get_motors(numbers: NDArray[Any]) -> NDArray[np.float64]:
    """Those of the 20 ``numbers`` of motors that are of joints, (L, 3) in the order of this project."""
    return numbers[JOINTS].astype(np.float64)
