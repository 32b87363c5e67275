"""The config of real sensors: the imperfections and faults of each signal, with their checks."""

from dataclasses import dataclass

from cmacexp.config import ComponentConfig, Config, choice, number
from cmacexp.config.machine import HAS_BODY
from cmacexp.errors import require
from cmacexp.sensors.kernels import FAULTS, WITHOUT_VALUE

UNIT = "unit of the signal"
IMPERFECTIONS = ("noise", "noise_relative", "bias", "quantum", "delay", "lag", "dropout")
"""Fields of a signal that alter its readings where they are not 0."""
IMPERFECT = (" or ".join(f"own.{name}" for name in IMPERFECTIONS),)
"""Condition under which the start time and the legs of imperfections have an effect."""
BREAKS = ("own.kind != 'none'",)
"""Condition under which the other fields of a fault have an effect."""


@dataclass
class FaultConfig:
    """A permanent fault of a sensor."""

    kind: str = choice(*FAULTS)
    """Kind of fault, see docs/sensors.md; none: the sensor stays healthy."""
    start: float = number("s", at_least=0, needs=BREAKS)
    """Time at which the sensor fails."""
    value: float = number(UNIT, needs=BREAKS)
    """Bias, stuck reading or standard deviation of the noise, depending on ``kind``; 0 for other kinds."""

    def check(self, key: str) -> None:
        """Check that ``value`` fits the kind of the fault; raises BadInput with the ``key`` of the fault."""
        selected = f"with {key}.kind={self.kind}"
        for kinds, fits, allowed in (
            (WITHOUT_VALUE, self.value == 0.0, f"must be 0 {selected}, which takes no value"),
            (("bias",), self.value != 0.0, f"must not be 0 {selected}, or there is no fault"),
            (("noise",), self.value > 0.0, f"must be above 0 {selected}, a standard deviation"),
        ):
            require(self.kind not in kinds or fits, f"{key}.value", self.value, allowed)


@dataclass
class LegFaultConfig(FaultConfig):
    """A permanent fault of the sensors of some legs."""

    legs: list[int] | None = number("leg", at_least=1, needs=(*BREAKS, *HAS_BODY))
    """Numbers of the legs whose sensor fails; null: all legs."""


@dataclass
class SignalConfig:
    """Imperfections of one signal, in this order: delay, noise, bias, quantisation, lag, drop-out, fault."""

    fault: FaultConfig
    start: float = number("s", at_least=0, needs=IMPERFECT)
    """Time from which the imperfections act; a fault has its own start."""
    noise: float = number(UNIT, at_least=0, at_most=1e9)
    """Standard deviation of white noise."""
    noise_relative: float = number("", at_least=0, at_most=1e3)
    """Standard deviation of white noise, relative to the value."""
    bias: float = number(UNIT, at_least=-1e9, at_most=1e9)
    """Constant added to every reading."""
    quantum: float = number(UNIT, at_least=0, at_most=1e9)
    """Quantisation step; 0: not quantised."""
    delay: int = number("samples", at_least=0)
    """Delay of the readings."""
    lag: float = number("s", at_least=0, at_most=1e3)
    """Time constant of a first-order low-pass filter of the readings; 0: not filtered."""
    dropout: float = number("", at_least=0, below=1)
    """Probability that a sample is lost."""
    dropout_reads: str = choice("last", "zero", needs=("own.dropout > 0",))
    """Reading of a lost sample: the last valid reading, or zero."""

    @property
    def alters(self) -> bool:
        """True if an imperfection or a fault alters the signal."""
        return any(vars(self)[name] for name in IMPERFECTIONS) or self.fault.kind != "none"

    def check(self, key: str, config: Config) -> None:
        """Check delay, start times and fault of the signal ``key`` against the run; raises BadInput."""
        longest = config.steps_per_cycle - 1
        end = config.cycles * config.gait.cycle_time
        require(
            self.delay <= longest, f"{key}.delay", self.delay, f"must be at most {longest} samples, less than a cycle"
        )
        for group, start in ((key, self.start), (f"{key}.fault", self.fault.start)):
            require(start < end, f"{group}.start", start, f"must be below {end:g} s, the end of the run")
        self.fault.check(f"{key}.fault")


@dataclass
class LegSignalConfig(SignalConfig):
    """Imperfections and fault of a signal that every leg has; each may be limited to some legs."""

    fault: LegFaultConfig
    legs: list[int] | None = number("leg", at_least=1, needs=(*IMPERFECT, *HAS_BODY))
    """Numbers of the legs whose sensors are imperfect; null: all legs."""

    def check(self, key: str, config: Config) -> None:
        """Check the leg numbers, then the fields that every signal has; raises BadInput."""
        for legs_key, legs in ((f"{key}.legs", self.legs), (f"{key}.fault.legs", self.fault.legs)):
            last = max(legs or [1])
            require(last <= config.legs, legs_key, last, f"must be at most {config.legs}, the legs of the machine")
            fits = legs is None or 0 < len(legs) == len(set(legs))
            require(fits, legs_key, legs, "must name at least one leg, each once; or null for all")
        super().check(key, config)


@dataclass
class ChannelsConfig(ComponentConfig):
    """Base class for sensors whose signals each have their own imperfections and fault."""

    @property
    def signals(self) -> dict[str, SignalConfig]:
        """Imperfections of the signals, by signal name."""
        return {name: value for name, value in vars(self).items() if isinstance(value, SignalConfig)}

    @property
    def draws(self) -> bool:  # type: ignore[override]
        """True if a signal has noise or drop-outs, which draw random numbers."""
        signals = self.signals.values()
        return any(s.noise or s.noise_relative or s.dropout or s.fault.kind == "noise" for s in signals)

    def check(self, config: Config) -> None:
        """Check each signal against the machine and the run; raises BadInput."""
        for name, signal in self.signals.items():
            signal.check(f"sensors.{name}", config)


@dataclass
class RealSensorsConfig(ChannelsConfig):
    """Imperfections of each signal; the measured foot position is computed from the measured joint angles."""

    force: LegSignalConfig
    """Contact force, N."""
    position: LegSignalConfig
    """Joint angles, rad; for a point mass its position, m."""
    velocity: LegSignalConfig
    """Joint velocities, rad/s; for a point mass its velocity, m/s."""
    height: SignalConfig
    """Height of the body, m."""
    tilt: SignalConfig
    """Pitch and roll of the body, rad."""
    height_rate: SignalConfig
    """Vertical velocity of the body, m/s."""
    tilt_rate: SignalConfig
    """Pitch and roll rates of the body, rad/s."""

    def check(self, config: Config) -> None:
        """Check that no body signal of a machine without a body is altered, then each signal; raises BadInput."""
        for name, signal in self.signals.items():
            fits = not signal.alters or config.has_body or isinstance(signal, LegSignalConfig)
            require(
                fits,
                f"sensors.{name}",
                "altered",
                f"must be unaltered with machine.kind={config.machine.kind}, which has no body",
            )
        super().check(config)
