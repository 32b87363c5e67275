"""LowCmd and LowState of Unitree's quadrupeds: their structures, their bytes on the wire, the checksum of a command.

Names, types and order are those of Unitree's public interface files (``unitree_go/msg``). In memory a message is a
structured array of NumPy with the layout of a C compiler, over which the checksum is computed; on the wire it is in
CDR, little-endian, which aligns each number to a multiple of its size, but does not align structures.
"""

import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Message = NDArray[np.void]
"""A structured array of shape (), of type LOW_CMD or LOW_STATE, such as ``message["motor_cmd"]["q"]`` (20,)."""


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
PADDING = -1
"""Index of a byte of padding, which has no counterpart in memory."""
JOINTS = np.array([[3, 4, 5], [0, 1, 2], [9, 10, 11], [6, 7, 8]])
"""(4, 3) numbers of the motors of hip, thigh and calf, in the order of legs of this project (left front first)."""
MOTORS_ON = 0x01
LEVEL_LOW = 0xFF
HEADER = (0xFE, 0xEF)
REVERSED = np.array([int(f"{value:08b}"[::-1], 2) for value in range(256)], dtype=np.uint8)
"""All bytes with their bits in reverse order."""


def list_numbers(kind: np.dtype[Any], begin: int = 0) -> Iterator[tuple[int, int]]:
    """Yield offset and size in memory, in bytes, of each number of a type that begins at ``begin``."""
    if kind.subdtype is not None:
        inner, (count,) = kind.subdtype
        for n in range(count):
            yield from list_numbers(inner, begin + n * inner.itemsize)
    elif kind.fields is not None:
        for inner, offset, *_ in kind.fields.values():
            yield from list_numbers(inner, begin + offset)
    else:
        yield begin, kind.itemsize


def lay_out(kind: np.dtype[Any]) -> NDArray[np.intp]:
    """Return the offset in memory of each byte of a message in CDR, PADDING for a byte of padding."""
    offsets = list[int]()
    for begin, size in list_numbers(kind):
        offsets += [PADDING] * (-len(offsets) % size)
        offsets += range(begin, begin + size)
    return np.array(offsets)


LAYOUTS = {kind: lay_out(kind) for kind in (LOW_CMD, LOW_STATE)}
"""Offsets of :func:`lay_out` by kind of message."""


def encode(message: Message) -> bytes:
    """Return the bytes of a message on the wire."""
    memory = np.frombuffer(message.tobytes() + b"\0", dtype=np.uint8)  # PADDING, -1, takes the last byte
    return memory[LAYOUTS[message.dtype]].tobytes()


def decode(kind: np.dtype[Any], data: bytes) -> Message:
    """Return the message of a ``kind``, LOW_CMD or LOW_STATE, from its bytes; raise ValueError if some lack."""
    offsets = LAYOUTS[kind]
    if len(data) != len(offsets):
        raise ValueError(f"{len(data)} bytes, not {len(offsets)}")
    memory = np.zeros(kind.itemsize + 1, dtype=np.uint8)
    memory[offsets] = np.frombuffer(data, dtype=np.uint8)
    return memory[:-1].view(kind).reshape(())


def compute_checksum(command: Message) -> int:
    """Compute the CRC-32/MPEG-2 of the words of a LowCmd, except for the last word, which is the checksum itself.

    The polynomial is 0x04c11db7, the initial value 0xffffffff, and the most significant byte of a word comes first.
    zlib has the same polynomial, but takes the least significant bit first, and inverts the result.
    """
    words = np.frombuffer(command.tobytes(), dtype="<u4")[:-1].astype(">u4")
    value = zlib.crc32(REVERSED[words.view(np.uint8)].tobytes()) ^ 0xFFFFFFFF
    return int(f"{value:032b}"[::-1], 2)


def new_command() -> Message:
    """Return a LowCmd that enables the motors, without torque or gains."""
    command: Message = np.zeros((), LOW_CMD)
    command["head"] = HEADER
    command["level_flag"] = LEVEL_LOW
    command["motor_cmd"]["mode"][JOINTS] = MOTORS_ON
    return command


def is_damping(command: Message) -> bool:
    """Return True if a LowCmd damps all motors, or does nothing, so that it cannot move a robot."""
    motors = command["motor_cmd"]
    return not motors["kp"].any() and not motors["tau"].any() and not motors["dq"].any()


def set_motors(command: Message, **values: Any) -> None:
    """Set fields of the motors, (L, 3) in the order of this project or one number each, and the checksum."""
    for name, value in values.items():
        command["motor_cmd"][name][JOINTS] = value
    command["crc"] = compute_checksum(command)


def get_motors(numbers: NDArray[Any]) -> NDArray[np.float64]:
    """Return the values of the joints (L, 3), in the order of this project, from those of all 20 motors."""
    return numbers[JOINTS].astype(np.float64)
