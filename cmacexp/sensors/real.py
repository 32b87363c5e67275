"""Sensors as they are: noisy, biased, quantised, late, now and then silent, and some of them broken."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cmacexp.models.mix import mix
from cmacexp.planning.setup import Setup
from cmacexp.plants.protocol import Measurement
from cmacexp.sensors.channel import FAULTS, Channel, Sensing
from cmacexp.sensors.config import RealSensorsConfig
from cmacexp.sensors.kernels import OF_A_BODY, OF_A_LEG, new_seen, no_sensing, sense
from cmacexp.sensors.protocol import SIGNALS
from cmacexp.typing import Array, Counts

OF_LEGS = {"force": (0,), "position": (1, 2), "velocity": (3, 4)}
"""Channels of each signal within a leg."""
OF_BODY = {"height": (0,), "tilt": (1, 2), "height_rate": (3,), "tilt_rate": (4, 5)}
"""Channels of each signal of the body."""
CHANCE = 0x53454E53
"""Sets the chance of the sensors apart from that of other parts under the same seed."""

Signal = Mapping[str, Any]
"""Fields of :class:`cmacexp.sensors.config.SignalConfig`."""


def _imperfections(signal: Signal, sampling_period: float) -> list[float]:
    """Fields 1 to 8 of a channel."""
    numbers = [float(signal[name]) for name in ("noise", "noise_relative", "bias", "quantum", "delay", "dropout")]
    return [round(signal["start"] / sampling_period), *numbers, float(signal["dropout_reads"] == "zero")]


def _fault(fault: Mapping[str, Any], sampling_period: float) -> list[float]:
    """Fields 9 to 11 of a channel."""
    return [FAULTS[fault["kind"]], round(fault["start"] / sampling_period), fault["value"]]


def _has(legs: list[int] | None, leg: int) -> bool:
    return legs is None or leg in legs


def _row(signal: Signal, leg: int, sampling_period: float) -> list[float]:
    """A channel of ``leg``, 0 for the body."""
    imperfect = _imperfections(signal, sampling_period)
    fault = _fault(signal["fault"], sampling_period)
    if leg and not _has(signal["legs"], leg):
        imperfect = [0.0] * len(imperfect)
    if leg and not _has(signal["fault"]["legs"], leg):
        fault = [0.0] * len(fault)
    alters = any(imperfect[1:7]) or fault[0] != FAULTS["none"]
    return [float(alters), *imperfect, *fault]


def _table(signals: Mapping[str, Signal], legs: int, sampling_period: float) -> Array:
    """The channels of a machine, (C, fields of :class:`Channel`)."""
    table = np.zeros((OF_A_LEG * legs + OF_A_BODY, len(Channel._fields)))
    for name, places in OF_LEGS.items():
        for i in range(legs):
            table[[OF_A_LEG * i + place for place in places]] = _row(signals[name], i + 1, sampling_period)
    for name, places in OF_BODY.items():
        table[[OF_A_LEG * legs + place for place in places]] = _row(signals[name], 0, sampling_period)
    return table


def _keys(channels: int, seed: int) -> Counts:
    """(C, 3): an integer for each source of chance of each channel."""
    return np.array(
        [[mix(mix(mix(CHANCE, seed), c), use) for use in range(3)] for c in range(channels)], dtype=np.int64
    ).reshape(channels, 3)


class RealSensors:
    """Sensors that alter what they tell, each signal in its own way; see ``conf/sensors/real.yaml``.

    Joint angles and velocities are measured; the foot and its velocity follow from them.

    Args:
        signals: the fields of each of :data:`cmacexp.sensors.protocol.SIGNALS`.
    """

    Config = RealSensorsConfig
    sensing: Sensing

    def __init__(self, **signals: Signal):
        self.signals = signals
        self.alters: tuple[str, ...] = ()

    def feedback_delay(self, uses_velocity: bool) -> int:
        """Samples by which the joint signals that feedback rests on come late.

        Late positions do not count where there is velocity feedback, which outweighs them at the frequencies that a
        wrong lead makes grow.
        """
        return int(self.signals["velocity" if uses_velocity else "position"]["delay"])

    def reset(self, setup: Setup) -> None:
        """Work out every channel; forget what was seen."""
        legs = setup.mechanism.legs.shape[0]
        table = _table(self.signals, legs, setup.config.sampling_period)
        self.alters = tuple(name for name in SIGNALS if table[self._places(name, legs), 0].any())
        self.mechanism, self.step, self.seen = setup.mechanism, 0, new_seen(legs)
        longest = int(table[:, Channel._fields.index("delay")].max())
        self.sensing = Sensing(
            True,
            ("position" in self.alters, "velocity" in self.alters),
            table,
            _keys(len(table), setup.config.seed),
            np.zeros((len(table), longest + 1)),
            np.zeros((len(table), 2)),
        ) if self.alters else no_sensing()  # fmt: skip

    @staticmethod
    def _places(name: str, legs: int) -> list[int]:
        """All channels of a signal."""
        if name in OF_BODY:
            return [OF_A_LEG * legs + place for place in OF_BODY[name]]
        return [OF_A_LEG * i + place for i in range(legs) for place in OF_LEGS[name]]

    def measure(self, true: Measurement) -> Measurement:
        """What the sensors tell of ``true``."""
        if not self.sensing.active:
            return true
        sense(self.sensing, self.mechanism, self.step, true, self.seen)
        self.step += 1
        return Measurement(*(part.copy() for part in self.seen[:7]))
