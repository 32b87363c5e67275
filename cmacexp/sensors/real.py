"""Imperfect sensors: noisy, biased, quantised, delayed, losing samples, faulty."""

from typing import Any

import numpy as np

from cmacexp.models.mix import mix
from cmacexp.planning.setup import Setup
from cmacexp.plants.protocol import Measurement
from cmacexp.sensors.channel import CHANNEL, FAULTS, NO_FAULT, Channels, Sensing
from cmacexp.sensors.config import IMPERFECTIONS, FaultConfig, RealSensorsConfig, SignalConfig
from cmacexp.sensors.kernels import OF_A_BODY, channels_of_a_leg, new_observation, read_sensors
from cmacexp.sensors.protocol import SIGNALS
from cmacexp.typing import Counts

OF_BODY = {"height": (0,), "tilt": (1, 2), "height_rate": (3,), "tilt_rate": (4, 5)}
"""Channels of each signal of the body."""
SENSOR_SEED = 0x53454E53
"""Separates the random numbers of sensors from those of other components under the same seed."""


def _applies(setting: SignalConfig | FaultConfig, leg: int) -> bool:
    """Whether a setting applies to ``leg``, 0 for the body."""
    legs = getattr(setting, "legs", None)
    return legs is None or leg in legs


def _channel(signal: SignalConfig, leg: int, sampling_period: float) -> tuple[Any, ...]:
    """The fields of CHANNEL of a signal of ``leg``, 0 for the body."""
    fault = signal.fault
    row: dict[str, Any] = dict.fromkeys(CHANNEL.names or (), 0)
    if _applies(signal, leg):
        row |= {each: getattr(signal, each) for each in IMPERFECTIONS}
        row["start"] = round(signal.start / sampling_period)
        row["drops_to_zero"] = signal.dropout_reads == "zero"
    if _applies(fault, leg):
        start = round(fault.start / sampling_period)
        row |= {"fault": FAULTS[fault.kind], "fault_start": start, "fault_value": fault.value}
    row["alters"] = any(row[each] for each in IMPERFECTIONS) or row["fault"] != NO_FAULT
    return tuple(row.values())


def _places(name: str, legs: int, joints: int) -> list[int]:
    """All channels of a signal of a machine with so many legs, of so many joints each."""
    of_a_leg = channels_of_a_leg(joints)
    if name in OF_BODY:
        return [of_a_leg * legs + place for place in OF_BODY[name]]
    within = {"force": (0,), "position": range(1, 1 + joints), "velocity": range(1 + joints, of_a_leg)}
    return [of_a_leg * i + place for i in range(legs) for place in within[name]]


def _channels(config: RealSensorsConfig, legs: int, joints: int, sampling_period: float) -> Channels:
    """The channels of a machine, (C,)."""
    of_a_leg = channels_of_a_leg(joints)
    channels = np.zeros(of_a_leg * legs + OF_A_BODY, CHANNEL)
    for name in SIGNALS:
        for place in _places(name, legs, joints):
            leg = 0 if name in OF_BODY else place // of_a_leg + 1
            channels[place] = _channel(getattr(config, name), leg, sampling_period)
    return channels


def _keys(channels: int, seed: int) -> Counts:
    """(C, 3): a seed for each source of randomness of each channel."""
    start = mix(SENSOR_SEED, seed)
    return np.array([[mix(mix(start, c), use) for use in range(3)] for c in range(channels)], dtype=np.int64)


class RealSensors:
    """Sensors that alter their readings, each signal in its own way; see ``conf/sensors/real.yaml``.

    Joint angles and velocities are measured; the foot and its velocity follow from them.
    """

    Config = RealSensorsConfig
    sensing: Sensing | None
    """None if no signal is altered."""

    def __init__(self, config: RealSensorsConfig):
        self.config = config
        self.alters: tuple[str, ...] = ()

    def feedback_delay(self, uses_velocity: bool) -> int:
        """Delay, in samples, of the joint signals that dominate the feedback.

        With velocity feedback the delay of positions does not count: velocities outweigh them at the frequencies that
        a wrong lead amplifies.
        """
        return (self.config.velocity if uses_velocity else self.config.position).delay

    def reset(self, setup: Setup) -> None:
        """Prepare every channel; forget earlier readings."""
        legs, joints = setup.mechanism.shape
        channels = _channels(self.config, legs, joints, setup.config.sampling_period)
        self.alters = tuple(name for name in SIGNALS if channels["alters"][_places(name, legs, joints)].any())
        self.mechanism, self.step = setup.mechanism, 0
        self.observation = new_observation(legs, setup.mechanism.axes)
        self.sensing = Sensing(
            ("position" in self.alters, "velocity" in self.alters),
            channels,
            _keys(len(channels), setup.config.seed),
            np.zeros((len(channels), int(channels["delay"].max()) + 1)),
            np.zeros((len(channels), 2)),
        ) if self.alters else None  # fmt: skip

    def measure(self, true: Measurement) -> Measurement:
        """The readings for the state ``true``."""
        if self.sensing is None:
            return true
        read_sensors(self.sensing, self.mechanism, self.step, true, self.observation)
        self.step += 1
        return Measurement(*(values.copy() for values in self.observation[:7]))
