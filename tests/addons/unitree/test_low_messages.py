"""LowCmd and LowState, their layouts and checksum, against the published sizes and a checksum bit by bit."""

import numpy as np
import pytest

from cmacexp.addons.unitree.messages import (
    LAYOUTS,
    LOW_CMD,
    LOW_STATE,
    compute_checksum,
    decode,
    encode,
    get_motors,
    is_damping,
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


def test_messages_have_the_sizes_of_the_published_structures():
    assert [kind.itemsize for kind in (LOW_CMD, LOW_STATE)] == [812, 1180]
    assert [len(LAYOUTS[kind]) for kind in (LOW_CMD, LOW_STATE)] == [808, 1176]


def test_a_command_keeps_what_is_set_and_its_checksum_is_that_of_the_structure():
    command, angles = new_command(), np.arange(12.0).reshape(4, 3) / 8
    set_motors(command, q=angles, kp=20.0, kd=0.5)
    again = decode(LOW_CMD, encode(command))
    assert again.tobytes() == command.tobytes()
    assert np.array_equal(get_motors(again["motor_cmd"]["q"]), angles)
    assert again["motor_cmd"]["q"][3:6].tolist() == angles[0].tolist()  # the left front leg comes second
    words = np.frombuffer(again.tobytes(), "<u4")[:-1]
    assert compute_checksum(again) == again["crc"] == crc_bit_by_bit(words)


@pytest.mark.parametrize("data", [b"", bytes(807), bytes(809)])
def test_bytes_that_are_no_command_are_refused(data):
    with pytest.raises(ValueError, match="bytes, not 808"):
        decode(LOW_CMD, data)


@pytest.mark.parametrize(("moving", "damps"), [({}, True), ({"kp": 1.0}, False), ({"tau": 1.0}, False)])
def test_a_command_damps_if_it_has_neither_stiffness_nor_torque(moving, damps):
    command = new_command()
    set_motors(command, kd=3.0, **moving)
    assert is_damping(command) == damps
