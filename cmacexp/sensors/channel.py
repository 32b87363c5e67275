"""One number of one sensor: what becomes of it on its way to the controller, as compiled kernels."""

import math
from typing import NamedTuple

from cmacexp.jit.compiler import kernel
from cmacexp.sensors.noise import normal, uniform
from cmacexp.typing import Array, Counts

SOUND, ZERO, LAST, VALUE, BIAS, NOISE = range(6)
FAULTS = {"none": SOUND, "zero": ZERO, "last": LAST, "value": VALUE, "bias": BIAS, "noise": NOISE}


class Channel(NamedTuple):
    """How one number is altered; steps and kinds as floats, since all channels stand in one table."""

    alters: float
    """0 if the number passes as it is."""
    start: float
    """First step of the next eight."""
    noise: float
    """Standard deviation of the white noise that is added."""
    noise_relative: float
    """Standard deviation of the white noise that is added, over the value."""
    bias: float
    quantum: float
    """The reading is a multiple of this; 0 for none."""
    delay: float
    """Samples."""
    dropout: float
    """Probability that a sample is lost."""
    drops_to_zero: float
    """Whether a lost sample reads 0, not the last good value."""
    fault: float
    """One of FAULTS."""
    fault_start: float
    """First step of the fault."""
    fault_value: float
    """Where it is stuck, what is added, or standard deviation of the noise."""


class Sensing(NamedTuple):
    """All channels of the sensors of a machine, and what they remember; C is their number."""

    active: bool
    """False for sensors that alter nothing; the rest is empty then."""
    kinematics: tuple[bool, bool]
    """Whether joint angles, and whether joint velocities are altered, so that the foot must be worked out anew."""
    channels: Array
    """(C, fields of Channel)."""
    keys: Counts
    """(C, 3): what seeds noise, drop-out and fault of a channel."""
    line: Array
    """(C, longest delay + 1): true values of the last steps."""
    held: Array
    """(C, 2): last good reading, and reading at the start of the fault."""


@kernel
def channel_of(sensing: Sensing, c: int) -> Channel:
    """Row ``c`` of the table."""
    row = sensing.channels
    return Channel(
        row[c, 0], row[c, 1], row[c, 2], row[c, 3], row[c, 4], row[c, 5],
        row[c, 6], row[c, 7], row[c, 8], row[c, 9], row[c, 10], row[c, 11],
    )  # fmt: skip


@kernel
def imperfect(sensing: Sensing, channel: Channel, c: int, step: int, true: float) -> float:
    """The reading of a sound sensor: late, noisy, biased, quantised, now and then lost, in this order."""
    delayed = max(step - int(channel.delay), 0)  # before the start nothing moved
    value = sensing.line[c, delayed % sensing.line.shape[1]]
    if channel.noise != 0.0 or channel.noise_relative != 0.0:
        scale = channel.noise + channel.noise_relative * abs(value)
        value += scale * normal(int(sensing.keys[c, 0]), step)
    value += channel.bias
    if channel.quantum != 0.0:
        value = channel.quantum * math.floor(value / channel.quantum + 0.5)
    if channel.dropout != 0.0 and step > 0 and uniform(int(sensing.keys[c, 1]), step) < channel.dropout:
        return 0.0 if channel.drops_to_zero != 0.0 else sensing.held[c, 0]
    return value


@kernel
def reading(sensing: Sensing, c: int, step: int, true: float) -> float:
    """What channel ``c`` tells of ``true`` in ``step``; steps must come one after the other, from 0."""
    channel = channel_of(sensing, c)
    if channel.alters == 0.0:
        return true
    sensing.line[c, step % sensing.line.shape[1]] = true
    value = imperfect(sensing, channel, c, step, true) if step >= channel.start else true
    sensing.held[c, 0] = value
    if channel.fault == SOUND or step < channel.fault_start:
        return value
    if step == channel.fault_start:
        sensing.held[c, 1] = value
    if channel.fault == ZERO:
        return 0.0
    if channel.fault == LAST:
        return sensing.held[c, 1]
    if channel.fault == VALUE:
        return channel.fault_value
    if channel.fault == BIAS:
        return value + channel.fault_value
    return value + channel.fault_value * normal(int(sensing.keys[c, 2]), step)
