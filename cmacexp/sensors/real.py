"""Imperfect sensors: noise, bias, quantisation, delay, lag, drop-outs and faults."""

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
from cmacexp.typing import Counts

SENSOR_SEED = 0x53454E53
"""Constant mixed into the run seed, so that sensors and other components draw different random numbers."""


def _applies(setting: SignalConfig | FaultConfig, leg: int) -> bool:
    """Return True if imperfections or a fault apply to ``leg``, a leg number from 1; 0 for the body."""
    legs = setting.legs if isinstance(setting, LegSignalConfig | LegFaultConfig) else None
    return legs is None or leg in legs


def _channel(signal: SignalConfig, leg: int, sampling_period: float) -> tuple[Any, ...]:
    """Return the fields of a CHANNEL row for one signal of ``leg``, a leg number from 1; 0 for the body."""
    fault = signal.fault
    row: dict[str, Any] = dict.fromkeys(CHANNEL.names or (), 0)
    if _applies(signal, leg):
        row |= {
            **{name: vars(signal)[name] for name in IMPERFECTIONS},
            "lag": first_order_share(signal.lag, sampling_period) if signal.lag else 0.0,
            "start": round(signal.start / sampling_period),
            "drops_to_zero": signal.dropout_reads == "zero",
        }
    if _applies(fault, leg):
        row |= {
            "fault": FAULTS[fault.kind],
            "fault_start": round(fault.start / sampling_period),
            "fault_value": fault.value,
        }
    row["alters"] = any(row[name] for name in IMPERFECTIONS) or row["fault"] != NO_FAULT
    return tuple(row.values())


def _layout(legs: int, joints: int) -> list[tuple[str, int]]:
    """List signal name and leg number (0 for the body) of every channel, in the order used by ``read_sensors``."""
    of_a_leg = ["force", *["position"] * joints, *["velocity"] * joints]
    of_the_body = ["height", "tilt", "tilt", "height_rate", "tilt_rate", "tilt_rate"]
    return [(name, leg + 1) for leg in range(legs) for name in of_a_leg] + [(name, 0) for name in of_the_body]


def make_keys(channels: int, seed: int) -> Counts:
    """Derive integer seeds (C, 3) for noise, drop-out and fault of C ``channels`` from the ``seed`` of the run."""
    start = mix(SENSOR_SEED, seed)
    return np.array([[mix(mix(start, c), use) for use in range(3)] for c in range(channels)], dtype=np.int64)


def make_sensing(config: ChannelsConfig, layout: list[tuple[str, int]], setup: Setup) -> Sensing:
    """Make the channels of sensors, before their first reading.

    The ``layout`` lists signal name and leg number (0 for the body) of each channel.
    """
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
    """Base class for sensors of joint angles and velocities whose delay and lag act on the feedback.

    With velocity feedback the delay of the positions is ignored: at the frequencies that a wrong lead amplifies, the
    velocity terms dominate.
    """

    def __init__(self, config: Any):
        self.config = config

    def feedback_delay(self, uses_velocity: bool) -> int:
        """Return the delay in samples of velocities if the feedback ``uses_velocity``, else of positions."""
        return int((self.config.velocity if uses_velocity else self.config.position).delay)

    def feedback_lag(self, uses_velocity: bool) -> float:
        """Return the lag time constant, s, of velocities if the feedback ``uses_velocity``, else of positions."""
        return float((self.config.velocity if uses_velocity else self.config.position).lag)


class RealSensors(JointSensors):
    """Sensors with noise, bias, quantisation, delay, lag, drop-outs and faults, set separately for each signal.

    Joint angles and velocities are measured; foot position and velocity are computed from them. See
    ``conf/sensors/real.yaml``.
    """

    Config = RealSensorsConfig
    alters: tuple[str, ...] = ()
    sensing: Sensing | None
    """Channels of the sensors; None if no signal is altered."""

    def reset(self, setup: Setup) -> None:
        """Prepare all channels for a run and discard earlier readings."""
        self.alters = tuple(name for name in SIGNALS if vars(self.config)[name].alters)
        self.mechanism = setup.mechanism
        self.step = 0
        self.observation = new_observation(setup.mechanism.shape[0], setup.mechanism.axes)
        self.sensing = make_sensing(self.config, _layout(*setup.mechanism.shape), setup) if self.alters else None

    def measure(self, true: Measurement) -> Measurement:
        """Return the sensor readings of the ``true`` state."""
        if self.sensing is None:
            return true
        read_sensors(self.sensing, self.mechanism, self.step, true, self.observation)
        self.step += 1
        return copy_state(self.observation, true.travel)
