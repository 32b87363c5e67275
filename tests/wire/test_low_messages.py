"""LowCmd and LowState, their layouts and checksum, against the published sizes and a checksum bit by bit."""

import numpy as np
import pytest

from cmacexp.wire.messages import (
    Message,
    compute_checksum,
    get_motors,
    lay_out,
    new_command,
    set_motors,
)


def crc_bit_by_bit(words):
    """CRC-32 with the polynomial 0x04c11db7, started with ones, most significant bit first."""
    crc = 0xFFFFFFFF
    for word in words.tolist():
        for bit in range(31, -1, -1):
            top = (crc >> 31) ^ (word >> bit & 1)
            crc = (crc << 1 & 0xFFFFFFFF) ^ (0x04C11DB7 if top else 0)
    return crc


def pack_as_c(message):
    """The words of a command but for the last, as a C compiler lays them out."""
    packed = np.zeros(lay_out("LowCmd_", in_c=True).size, dtype=np.uint8)
    for name, (kind, places) in lay_out("LowCmd_", in_c=True).places.items():
        for place, value in zip(places, message[name], strict=True):
            packed[place : place + np.dtype(kind).itemsize] = np.frombuffer(value.tobytes(), dtype=np.uint8)
    return packed.view("<u4")[:-1]


def test_messages_have_the_sizes_of_the_published_structures():
    sizes = [lay_out(fields, in_c).size for fields in ("LowCmd_", "LowState_") for in_c in (True, False)]
    assert sizes == [812, 808, 1180, 1176]


def test_a_command_keeps_what_is_set_and_its_checksum_is_that_of_the_structure():
    command, angles = new_command(), np.arange(12.0).reshape(4, 3) / 8
    set_motors(command, q=angles, kp=20.0, kd=0.5)
    again = Message("LowCmd_", command.tobytes())
    assert np.array_equal(get_motors(again, "motor_cmd.q"), angles)
    assert again["motor_cmd.q"][3:6].tolist() == angles[0].tolist()  # the left front leg comes second
    assert compute_checksum(again.body) == again["crc"][0] == crc_bit_by_bit(pack_as_c(again))


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0" + bytes(100), b"\0\0\0\0" + bytes(808)])
def test_bytes_that_are_no_command_are_refused(data):
    with pytest.raises(ValueError, match="bytes that begin with"):
        Message("LowCmd_", data)
