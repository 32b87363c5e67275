"""Imperfect sensors: noisy, biased, quantised, delayed, filtered, losing samples, faulty."""

from typing import Any

import numpy as np

from cmacexp.models.loop_delay import first_order_share
from cmacexp.models.mix import mix
from cmacexp.planning.plan import Setup
from cmacexp.protocols import SIGNALS, Measurement, copy_state
from cmacexp.sensors.config import (
    IMPERFECTIONS,
    ChannelsConfig,
    FaultConfig,
    LegFaultConfig,
    LegSignalConfig,
    RealSensorsConfig,
    SignalConfig,
)
from cmacexp.sensors.kernels import CHANNEL, FAULTS, NO_FAULT, Sensing, new_observation, read_sensors
from cmacexp.typing import Counts, KernelParts

SENSOR_SEED = 0x53454E53
"""Separates the random numbers of sensors from those of other components under the same seed."""


def _applies(setting: SignalConfig | FaultConfig, leg: int) -> bool:
    """Whether a setting applies to ``leg``, 0 for the body."""
    legs = setting.legs if isinstance(setting, LegSignalConfig | LegFaultConfig) else None
    return legs is None or leg in legs


def _channel(signal: SignalConfig, leg: int, sampling_period: float) -> tuple[Any, ...]:
    """The fields of CHANNEL of a signal of ``leg``, 0 for the body."""
    fault = signal.fault
    row: dict[str, Any] = dict.fromkeys(CHANNEL.names or (), 0)
    if _applies(signal, leg):
        row |= {
            **{each: vars(signal)[each] for each in IMPERFECTIONS},
            "lag": first_order_share(signal.lag, sampling_period) if signal.lag else 0.0,
            "start": round(signal.start / sampling_period),
            "drops_to_zero": signal.dropout_reads == "zero",
        }
    if _applies(fault, leg):
        start = round(fault.start / sampling_period)
        row |= {"fault": FAULTS[fault.kind], "fault_start": start, "fault_value": fault.value}
    row["alters"] = any(row[each] for each in IMPERFECTIONS) or row["fault"] != NO_FAULT
    return tuple(row.values())


def _layout(legs: int, joints: int) -> list[tuple[str, int]]:
    """Signal and leg, 0 for the body, of every channel, in the order in which ``read_sensors`` reads them."""
    of_a_leg = ["force", *["position"] * joints, *["velocity"] * joints]
    of_the_body = ["height", "tilt", "tilt", "height_rate", "tilt_rate", "tilt_rate"]
    return [(name, leg + 1) for leg in range(legs) for name in of_a_leg] + [(name, 0) for name in of_the_body]


def make_keys(channels: int, seed: int) -> Counts:
    """(C, 3): a seed, a whole number, for each source of randomness of each of C ``channels``."""
    start = mix(SENSOR_SEED, seed)
    return np.array([[mix(mix(start, c), use) for use in range(3)] for c in range(channels)], dtype=np.int64)


def make_sensing(config: ChannelsConfig, layout: list[tuple[str, int]], setup: Setup) -> Sensing:
    """Channels, one for each signal and leg, 0 for the body, of the ``layout``, before their first reading."""
    period = setup.config.sampling_period
    channels = np.array([_channel(vars(config)[name], leg, period) for name, leg in layout], CHANNEL)
    altered = {name for (name, _), alters in zip(layout, channels["alters"], strict=True) if alters}
    return Sensing(
        ("position" in altered, "velocity" in altered),
        channels,
        make_keys(len(channels), setup.config.seed),
        np.zeros((len(channels), int(channels["delay"].max()) + 1)),
        np.zeros((len(channels), 3)),
    )


class JointSensors:
    """Sensors of joint angles and velocities, which delay the feedback.

    With velocity feedback the delay of positions does not count: velocities outweigh them at the frequencies that
    a wrong lead amplifies.
    """

    def __init__(self, config: Any):
        self.config = config

    def feedback_delay(self, uses_velocity: bool) -> int:
        """Samples by which the feedback is delayed."""
        return int((self.config.velocity if uses_velocity else self.config.position).delay)

    def feedback_lag(self, uses_velocity: bool) -> float:
        """Time constant by which the feedback lags, s, likewise."""
        return float((self.config.velocity if uses_velocity else self.config.position).lag)


class RealSensors(JointSensors):
    """Sensors that alter their readings, each signal in its own way; see ``conf/sensors/real.yaml``.

    Joint angles and velocities are measured; the foot and its velocity follow from them.
    """

    Config = RealSensorsConfig
    alters: tuple[str, ...] = ()
    sensing: Sensing | None
    """None if no signal is altered."""

    def reset(self, setup: Setup) -> None:
        """Prepare every channel; forget earlier readings."""
        self.alters = tuple(name for name in SIGNALS if vars(self.config)[name].alters)
        self.mechanism, self.step = setup.mechanism, 0
        self.observation = new_observation(setup.mechanism.shape[0], setup.mechanism.axes)
        self.sensing = make_sensing(self.config, _layout(*setup.mechanism.shape), setup) if self.alters else None

    def kernel_parts(self) -> KernelParts:
        """The channels, and the observation that they fill; nothing if no signal is altered."""
        return {} if self.sensing is None else {"sensing": self.sensing, "observation": self.observation}

    def measure(self, true: Measurement) -> Measurement:
        """The readings for the state ``true``."""
        if self.sensing is None:
            return true
        read_sensors(self.sensing, self.mechanism, self.step, true, self.observation)
        self.step += 1
        return copy_state(self.observation, true.travel)
