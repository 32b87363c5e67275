"""The config of real sensors: the imperfections and faults of each signal, with their checks."""

from dataclasses import dataclass

from cmacexp.config import ComponentConfig, Config, choice, number
from cmacexp.config.machine import HAS_BODY
from cmacexp.errors import require
from cmacexp.sensors.kernels import FAULTS, WITHOUT_VALUE

UNIT = "unit of the signal"
IMPERFECTIONS = ("noise", "noise_relative", "bias", "quantum", "delay", "lag", "dropout")
"""Fields of a signal that alter it where they are not 0."""
IMPERFECT = (" or ".join(f"own.{name}" for name in IMPERFECTIONS),)
"""What the fields need that say when, and in which legs, a signal is imperfect."""
BREAKS = ("own.kind != 'none'",)


@dataclass
class FaultConfig:
    """A permanent fault of a sensor."""

    kind: str = choice(*FAULTS)
    """One of the faults in cmacexp/sensors/kernels.py, which docs/sensors.md describes."""
    start: float = number("s", at_least=0, needs=BREAKS)
    """When the sensor breaks."""
    value: float = number(UNIT, needs=BREAKS)
    """The bias, the stuck reading or the standard deviation of the noise; 0 for kinds without a value."""

    def check(self, key: str) -> None:
        """Check ``value`` against the kind of the fault; raises BadInput."""
        chosen = f"with {key}.kind={self.kind}"
        for kinds, fits, allowed in (
            (WITHOUT_VALUE, self.value == 0.0, f"must be 0 {chosen}, which takes no value"),
            (("bias",), self.value != 0.0, f"must not be 0 {chosen}, or there is no fault"),
            (("noise",), self.value > 0.0, f"must be above 0 {chosen}, a standard deviation"),
        ):
            require(self.kind not in kinds or fits, f"{key}.value", self.value, allowed)


@dataclass
class LegFaultConfig(FaultConfig):
    """A fault in some legs."""

    legs: list[int] | None = number("leg", at_least=1, needs=(*BREAKS, *HAS_BODY))
    """Legs whose sensor breaks, by their numbers; null: all."""


@dataclass
class SignalConfig:
    """Imperfections of one signal, in this order: delay, noise, bias, quantisation, lag, drop-out, fault."""

    fault: FaultConfig
    start: float = number("s", at_least=0, needs=IMPERFECT)
    """Time from which this holds; a fault has a start of its own."""
    noise: float = number(UNIT, at_least=0, at_most=1e9)
    """Standard deviation of white noise."""
    noise_relative: float = number("", at_least=0, at_most=1e3)
    """Standard deviation of white noise over the value."""
    bias: float = number(UNIT, at_least=-1e9, at_most=1e9)
    """Added to every reading."""
    quantum: float = number(UNIT, at_least=0, at_most=1e9)
    """Readings are multiples of this; 0: not quantised."""
    delay: int = number("samples", at_least=0)
    """A reading is the value of so many samples before."""
    lag: float = number("s", at_least=0, at_most=1e3)
    """Time constant of a first-order low-pass filter of the readings; 0: not filtered."""
    dropout: float = number("", at_least=0, below=1)
    """Probability that a sample is lost."""
    dropout_reads: str = choice("last", "zero", needs=("own.dropout > 0",))
    """What a lost sample reads: the last good one, or 0."""

    @property
    def alters(self) -> bool:
        """Whether anything alters the signal."""
        return any(vars(self)[name] for name in IMPERFECTIONS) or self.fault.kind != "none"

    def check(self, key: str, config: Config) -> None:
        """Check delay, starts and fault against the run; raises BadInput."""
        longest, end = config.steps_per_cycle - 1, config.cycles * config.gait.cycle_time
        require(
            self.delay <= longest, f"{key}.delay", self.delay, f"must be at most {longest} samples, less than a cycle"
        )
        for place, start in ((key, self.start), (f"{key}.fault", self.fault.start)):
            require(start < end, f"{place}.start", start, f"must be below {end:g} s, the end of the run")
        self.fault.check(f"{key}.fault")


@dataclass
class LegSignalConfig(SignalConfig):
    """What alters a signal of some legs."""

    fault: LegFaultConfig
    legs: list[int] | None = number("leg", at_least=1, needs=(*IMPERFECT, *HAS_BODY))
    """Legs whose sensors this concerns, by their numbers; null: all."""

    def check(self, key: str, config: Config) -> None:
        """Check the legs too; raises BadInput."""
        for place, chosen in ((f"{key}.legs", self.legs), (f"{key}.fault.legs", self.fault.legs)):
            last = max(chosen or [1])
            require(last <= config.legs, place, last, f"must be at most {config.legs}, the legs of the machine")
            fits = chosen is None or 0 < len(chosen) == len(set(chosen))
            require(fits, place, chosen, "must name at least one leg, each once; or null for all")
        super().check(key, config)


@dataclass
class ChannelsConfig(ComponentConfig):
    """Some signals, each with imperfections of its own."""

    @property
    def signals(self) -> dict[str, SignalConfig]:
        """Signals by their names."""
        return {name: value for name, value in vars(self).items() if isinstance(value, SignalConfig)}

    @property
    def draws(self) -> bool:  # type: ignore[override]
        """Whether any signal is noisy, or loses samples."""
        signals = self.signals.values()
        return any(s.noise or s.noise_relative or s.dropout or s.fault.kind == "noise" for s in signals)

    def check(self, config: Config) -> None:
        """Check each signal against the machine and the run; raises BadInput."""
        for name, signal in self.signals.items():
            signal.check(f"sensors.{name}", config)


@dataclass
class RealSensorsConfig(ChannelsConfig):
    """Imperfections of each signal; the measured foot follows from the measured joints."""

    force: LegSignalConfig
    """Contact force, N."""
    position: LegSignalConfig
    """Joint angles, rad; of a point mass its position, m."""
    velocity: LegSignalConfig
    """Joint velocities, rad/s; of a point mass m/s."""
    height: SignalConfig
    """Height of a body, m."""
    tilt: SignalConfig
    """Pitch and roll of a body, rad."""
    height_rate: SignalConfig
    """m/s."""
    tilt_rate: SignalConfig
    """rad/s."""

    def check(self, config: Config) -> None:
        """Check each signal against the machine and the run; raises BadInput."""
        for name, signal in self.signals.items():
            fits = not signal.alters or config.has_body or isinstance(signal, LegSignalConfig)
            allowed = f"must be unaltered with machine.kind={config.machine.kind}, which has no body"
            require(fits, f"sensors.{name}", "altered", allowed)
        super().check(config)
