"""The configuration of sensors."""

from dataclasses import dataclass

from cmacexp.config.fields import choice, number

UNIT = "unit of the signal"


@dataclass
class FaultConfig:
    """A sensor that breaks and stays so."""

    kind: str = choice("none", "zero", "last", "value", "bias", "noise")
    """Stuck at zero, at its last reading, at ``value``; or ``value`` is added, or is the deviation of white noise."""
    start: float = number("s", at_least=0)
    value: float = number(UNIT)


@dataclass
class LegFaultConfig(FaultConfig):
    """Of some legs."""

    legs: list[int] | None = number("leg", at_least=1)
    """null: all."""


@dataclass
class SignalConfig:
    """What becomes of one signal, in this order: late, noisy, biased, quantised, now and then lost, broken."""

    fault: FaultConfig
    start: float = number("s", at_least=0)
    """From when; a fault has a start of its own."""
    noise: float = number(UNIT, at_least=0, at_most=1e9)
    """Standard deviation of white noise."""
    noise_relative: float = number("", at_least=0, at_most=1e3)
    """Standard deviation of white noise over the value."""
    bias: float = number(UNIT, at_least=-1e9, at_most=1e9)
    quantum: float = number(UNIT, at_least=0, at_most=1e9)
    """Readings are multiples of this; 0: not quantised."""
    delay: int = number("samples", at_least=0)
    dropout: float = number("", at_least=0, below=1)
    """Probability that a sample is lost."""
    dropout_reads: str = choice("last", "zero")
    """What a lost sample reads: the last good one, or 0."""

    @property
    def alters(self) -> bool:
        """Whether it does anything to the signal."""
        own = (self.noise, self.noise_relative, self.bias, self.quantum, self.delay, self.dropout)
        return any(own) or self.fault.kind != "none"


@dataclass
class LegSignalConfig(SignalConfig):
    """Of some legs."""

    fault: LegFaultConfig
    legs: list[int] | None = number("leg", at_least=1)
    """null: all."""


@dataclass
class RealSensorsConfig:
    """Every signal with what becomes of it; the foot follows from the joints that are measured."""

    _target_: str
    force: LegSignalConfig
    """Contact force, N."""
    position: LegSignalConfig
    """Joint angles, rad; of a point mass its position, m."""
    velocity: LegSignalConfig
    """Joint velocities, rad/s; of a point mass m/s."""
    height: SignalConfig
    """Of a body, m."""
    tilt: SignalConfig
    """Pitch and roll of a body, rad."""
    height_rate: SignalConfig
    """m/s."""
    tilt_rate: SignalConfig
    """rad/s."""
