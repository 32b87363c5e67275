"""Checks of gait, timing and machine against each other."""

from collections.abc import Iterator

from cmacexp.config.fields import listed
from cmacexp.config.gait import PATTERNS
from cmacexp.config.schema import Config

Mistakes = Iterator[tuple[str, str]]
"""The keys that are wrong, with what is allowed of each; computed one by one, since the first ends the check."""
ROBOT = "robot"
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


def check_timing(config: Config) -> Mistakes:
    """Every lift-off and touch-down falls on a sample of the cycle."""
    gait, divisor = config.gait, PATTERNS[config.gait.pattern].divisor
    ratio = gait.cycle_time / config.sampling_period
    steps, support = round(ratio), ratio * gait.duty_factor
    if not _is_whole(ratio) or steps < 2:
        near = f"{_near_period(config, divisor):.12g} does"
        yield (
            "sampling_period",
            f"must divide gait.cycle_time={gait.cycle_time:g} s into at least 2 whole steps; {near}",
        )
    for i, phase in enumerate(gait.touch_down or []):
        if not _is_whole(phase * ratio):
            near = f"{round(phase * ratio) / steps:.12g} does"
            yield f"gait.touch_down.{i}", f"must fall on one of the {steps} samples of the cycle; {near}"
    if steps % divisor:
        needs = f"gives {steps} steps a cycle, a {gait.pattern} gait needs a multiple of {divisor}"
        yield "sampling_period", f"{needs}: try {_near_period(config, divisor):.12g}"
    if not _is_whole(support) or round(support) < 1:
        near = f"{max(1, round(support)) / steps:.12g} does"
        yield "gait.duty_factor", f"touch-down must fall on one of the {steps} samples of the cycle; {near}"


def check_legs(config: Config) -> Mistakes:
    """Gait and desired force fit the number of legs of the machine."""
    gait, kind, legs = config.gait, config.machine.kind, 4 if config.has_body else 1
    if config.legs != legs:
        fitting = listed([name for name, pattern in PATTERNS.items() if pattern.legs == legs])
        yield "gait.pattern", f"with machine.kind={kind} choose from {fitting}"
    elif PATTERNS[gait.pattern].is_dynamic and kind != ROBOT:
        yield "gait.pattern", f"needs a body that moves: with machine.kind={kind} choose wave, or scenario=robot"
    if gait.touch_down is not None and len(gait.touch_down) != legs:
        yield "gait.touch_down", f"must have one value for each of the {legs} legs, or be null"
    if (config.force_control.desired_force is None) != config.has_body:
        null, reason = ("null", ": the feet share the weight") if config.has_body else ("a number above 0 (N)", "")
        yield "force_control.desired_force", f"must be {null} with machine.kind={kind}{reason}"


def check_pattern(config: Config) -> Mistakes:
    """Duty factor, stroke and load ramp are what the pattern of the gait allows."""
    gait, pattern, period = config.gait, PATTERNS[config.gait.pattern], config.sampling_period
    least, duty, given = pattern.least_duty_factor, gait.duty_factor, f"with gait.pattern={gait.pattern}"
    if least and not (least <= duty < 1 or gait.allow_unstable):
        stable = f"for a statically stable {gait.pattern} gait; or gait.allow_unstable=true"
        yield "gait.duty_factor", f"must be at least {least:g} and below 1 {stable}"
    if pattern.lifts and duty == 1:
        yield "gait.duty_factor", f"must be below 1 {given}; or use gait=standing"
    if not pattern.lifts and duty != 1:
        yield "gait.duty_factor", f"must be 1 {given}"
    if not pattern.lifts and gait.stroke != 0:
        yield "gait.stroke", f"must be 0 {given}, which never lifts a foot"
    if gait.speed is not None:
        travel = gait.speed * duty * gait.cycle_time
        if abs(gait.stroke - travel) > 1e-4 * max(travel, gait.stroke):
            yield "gait.stroke", f"must be {travel:.6g} m with gait.speed={gait.speed:g}; or set gait.speed=null"
    shortest = SHORTEST_RAMP * period
    for key, ramp, other in (
        ("load", gait.load_ramp, gait.unload_ramp),
        ("unload", gait.unload_ramp, gait.load_ramp),
    ):
        longest = duty * gait.cycle_time - other
        if ramp and not shortest <= ramp <= longest - period:
            bounds = f"at least {shortest:g} s ({SHORTEST_RAMP} samples) and below {longest:g} s (support)"
            yield f"gait.{key}_ramp", f"must be 0, or {bounds}"
