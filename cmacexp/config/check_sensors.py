"""Checks of sensors: what contradicts itself, the machine or the run."""

from collections.abc import Sequence
from dataclasses import fields

from cmacexp.config.schema import Config
from cmacexp.config.sensors import FaultConfig, LegSignalConfig, RealSensorsConfig, SignalConfig
from cmacexp.errors import BadInput

STUCK = ("zero", "last", "value")
"""Faults after which a sensor tells nothing any more."""


def _signals(sensors: RealSensorsConfig) -> list[tuple[str, SignalConfig]]:
    return [(f"sensors.{each.name}", getattr(sensors, each.name)) for each in fields(sensors)[1:]]


def _check_legs(key: str, chosen: Sequence[int] | None, legs: int) -> None:
    if chosen is None:
        return
    for leg in chosen:
        if leg > legs:
            raise BadInput(f"{key}.legs", leg, f"must be at most {legs}, the legs of the machine")
    if not chosen or len(set(chosen)) != len(chosen):
        raise BadInput(f"{key}.legs", list(chosen), "must name at least one leg, each once; or null for all")


def _check_start(key: str, start: float, config: Config) -> None:
    end = config.cycles * config.gait.cycle_time
    if start >= end:
        raise BadInput(f"{key}.start", start, f"must be below {end:g} s, the end of the run")


def _check_fault(key: str, fault: FaultConfig) -> None:
    if fault.kind in ("none", "zero", "last") and fault.value != 0.0:
        raise BadInput(
            f"{key}.value", fault.value, f"must be 0 with {key}.kind={fault.kind}; value, bias, noise take one"
        )
    if fault.kind == "bias" and fault.value == 0.0:
        raise BadInput(f"{key}.value", fault.value, f"must not be 0 with {key}.kind=bias, or nothing breaks")
    if fault.kind == "noise" and fault.value <= 0.0:
        raise BadInput(f"{key}.value", fault.value, f"must be above 0 with {key}.kind=noise, a standard deviation")


def _check_signal(key: str, signal: SignalConfig, config: Config, legs: int) -> None:
    longest = config.steps_per_cycle - 1
    if signal.delay > longest:
        raise BadInput(f"{key}.delay", signal.delay, f"must be at most {longest} samples, less than a cycle")
    for place, start in ((key, signal.start), (f"{key}.fault", signal.fault.start)):
        _check_start(place, start, config)
    _check_fault(f"{key}.fault", signal.fault)
    own = getattr(signal, "legs", None)
    broken = getattr(signal.fault, "legs", None)
    _check_legs(key, own, legs)
    _check_legs(f"{key}.fault", broken, legs)
    both = set(own or range(1, legs + 1)) & set(broken or range(1, legs + 1))
    if signal.dropout and signal.fault.kind in STUCK and both:
        raise BadInput(
            f"{key}.dropout",
            signal.dropout,
            f"must be 0 with {key}.fault.kind={signal.fault.kind}: a stuck sensor loses no samples; "
            "give them different legs",
        )


def check_sensors(config: Config, legs: int, has_body: bool) -> None:
    """Hold built-in sensors to the machine and to the run, and each signal to what can be true at once.

    Raises:
        BadInput: names the key, the value and the bound.
    """
    sensors = config.sensors
    if not isinstance(sensors, RealSensorsConfig):
        return
    for key, signal in _signals(sensors):
        if signal.alters and not has_body and not isinstance(signal, LegSignalConfig):
            raise BadInput(key, "altered", f"must do nothing with machine.kind={config.machine.kind}: it has no body")
        _check_signal(key, signal, config, legs)
