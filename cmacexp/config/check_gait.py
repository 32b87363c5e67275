"""Checks of gait, timing and machine against each other."""

from cmacexp.config.fields import listed
from cmacexp.config.gait import PATTERNS
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput

SHORTEST_RAMP = 10
"""Samples of the shortest ramp of the load: a shorter one is a jump that no sampled motion follows."""
TOLERANCE = 1e-9
"""Largest relative distance of an event from its sample."""


def _is_whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) <= TOLERANCE * max(1.0, abs(ratio))


def _near_period(config: Config, divisor: int) -> float:
    """A short number near the sampling period that divides the cycle into a multiple of ``divisor``."""
    ratio = config.gait.cycle_time / config.sampling_period
    counts = [n for n in range(int(0.8 * ratio), int(1.25 * ratio) + 3) if n > 1 and n % divisor == 0]
    return min((config.gait.cycle_time / n for n in counts), key=lambda period: len(f"{period:.12g}"))


def check_timing(config: Config) -> None:
    """Require that every lift-off and touch-down falls on a sample of the cycle."""
    gait, divisor = config.gait, PATTERNS[config.gait.pattern].divisor
    ratio = gait.cycle_time / config.sampling_period
    if not _is_whole(ratio) or round(ratio) < 2:
        raise BadInput(
            "sampling_period",
            config.sampling_period,
            f"must divide gait.cycle_time={gait.cycle_time:g} s into at least 2 whole steps; "
            f"{_near_period(config, divisor):.12g} does",
        )
    steps = round(ratio)
    for phase in gait.touch_down or []:
        if not _is_whole(phase * ratio):
            near = round(phase * ratio) / steps
            raise BadInput(
                "gait.touch_down", phase, f"must fall on one of the {steps} samples of the cycle; {near:.12g} does"
            )
    if steps % divisor:
        raise BadInput(
            "sampling_period",
            config.sampling_period,
            f"gives {steps} steps a cycle, a {gait.pattern} gait needs a multiple of {divisor}: "
            f"try {_near_period(config, divisor):.12g}",
        )
    support = ratio * gait.duty_factor
    if not _is_whole(support) or round(support) < 1:
        near = max(1, round(support)) / steps
        raise BadInput(
            "gait.duty_factor",
            gait.duty_factor,
            f"touch-down must fall on one of the {steps} samples of the cycle; {near:.12g} does",
        )


def check_legs(config: Config) -> None:
    """Check gait and desired force against the number of legs of the machine."""
    gait, force, kind = config.gait, config.force_control.desired_force, config.machine.kind
    legs = 4 if config.has_body else 1
    if config.legs != legs:
        fitting = [name for name, pattern in PATTERNS.items() if pattern.legs == legs]
        raise BadInput("gait.pattern", gait.pattern, f"with machine.kind={kind} choose from {listed(fitting)}")
    if gait.touch_down is not None and len(gait.touch_down) != legs:
        raise BadInput(
            "gait.touch_down", gait.touch_down, f"must have one value for each of the {legs} legs, or be null"
        )
    if (force is None) != config.has_body:
        null, reason = ("null", ": the feet share the weight") if config.has_body else ("a number above 0 (N)", "")
        raise BadInput("force_control.desired_force", force, f"must be {null} with machine.kind={kind}{reason}")


def check_pattern(config: Config) -> None:
    """Check duty factor, stroke and load ramp against what the pattern of the gait allows."""
    gait, pattern = config.gait, PATTERNS[config.gait.pattern]
    least, duty = pattern.least_duty_factor, gait.duty_factor
    if least and not (least <= duty < 1 or gait.allow_unstable):
        raise BadInput(
            "gait.duty_factor",
            duty,
            f"must be at least {least:g} and below 1 for a statically stable {gait.pattern} gait; "
            "or gait.allow_unstable=true",
        )
    if pattern.lifts and duty == 1:
        raise BadInput(
            "gait.duty_factor", 1, f"must be below 1 with gait.pattern={gait.pattern}; or use gait=standing"
        )
    if not pattern.lifts and duty != 1:
        raise BadInput("gait.duty_factor", duty, f"must be 1 with gait.pattern={gait.pattern}")
    if not pattern.lifts and gait.stroke != 0:
        raise BadInput(
            "gait.stroke", gait.stroke, f"must be 0 with gait.pattern={gait.pattern}, which never lifts a foot"
        )
    support_time, shortest = duty * gait.cycle_time, SHORTEST_RAMP * config.sampling_period
    for key, ramp, other in (
        ("load_ramp", gait.load_ramp, gait.unload_ramp),
        ("unload_ramp", gait.unload_ramp, gait.load_ramp),
    ):
        longest = support_time - other
        if ramp and not shortest <= ramp <= longest - config.sampling_period:
            raise BadInput(
                f"gait.{key}",
                ramp,
                f"must be 0, or at least {shortest:g} s ({SHORTEST_RAMP} samples) and below {longest:g} s (support)",
            )
