"""Checks of a config that one field alone cannot tell."""

from cmacexp.config.fields import check_fields
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput

OUTPUTS = 2
"""Outputs of a CMAC: one torque for each joint of its leg."""
WORD_BYTES = 8
"""Bytes of a CMAC weight, a float64."""
MOST_STEPS = 2**25
"""Steps of the longest run; its samples are kept in memory until it ends."""
TOLERANCE = 1e-9
"""Largest relative distance of an event from its sample."""


def _is_whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) <= TOLERANCE * max(1.0, abs(ratio))


def check_timing(config: Config) -> None:
    """Hold lift-off and touch-down to samples of the cycle."""
    gait = config.gait
    ratio = gait.cycle_time / config.sampling_period
    if not _is_whole(ratio) or round(ratio) < 2:
        counts = range(max(2, int(0.8 * ratio)), max(3, int(1.25 * ratio)) + 1)
        near = min((gait.cycle_time / n for n in counts), key=lambda period: len(f"{period:.12g}"))
        raise BadInput(
            "sampling_period",
            config.sampling_period,
            f"must divide gait.cycle_time={gait.cycle_time:g} s into at least 2 whole steps; {near:.12g} does",
        )
    support = ratio * gait.duty_factor
    if not _is_whole(support) or round(support) < 1:
        near = max(1, round(support)) / round(ratio)
        raise BadInput(
            "gait.duty_factor",
            gait.duty_factor,
            f"touch-down must fall on one of the {round(ratio)} samples of the cycle; {near:.12g} does",
        )


def check_pattern(config: Config) -> None:
    """Hold the duty factor to what the gait's pattern can do."""
    gait = config.gait
    if gait.pattern == "standing":
        if gait.duty_factor != 1:
            raise BadInput("gait.duty_factor", gait.duty_factor, "must be 1 with gait.pattern=standing")
        if gait.stroke != 0:
            raise BadInput(
                "gait.stroke", gait.stroke, "must be 0 with gait.pattern=standing, which never lifts a foot"
            )
    elif gait.duty_factor == 1:
        raise BadInput(
            "gait.duty_factor", 1, f"must be below 1 with gait.pattern={gait.pattern}; or take gait=standing"
        )
    support_time = gait.duty_factor * gait.cycle_time
    if gait.load_ramp >= support_time:
        raise BadInput(
            "gait.load_ramp",
            gait.load_ramp,
            f"must be below the support time, {support_time:g} s (0 switches it off)",
        )


def check_memory(config: Config) -> None:
    """Hold the CMAC's memory to at least one weight per layer and output."""
    cmac = config.cmac
    least = cmac.layers * OUTPUTS * WORD_BYTES
    if cmac.memory_bytes < least:
        raise BadInput(
            "cmac.memory_bytes",
            cmac.memory_bytes,
            f"must be at least {least} B, one float64 per layer and output ({cmac.layers} layers)",
        )
    if not cmac.inputs or len(set(cmac.inputs)) != len(cmac.inputs):
        raise BadInput(
            "cmac.inputs", cmac.inputs, "must name at least one of angle, velocity, acceleration, each once"
        )
    dense = least * cmac.resolution_elements ** (2 * len(cmac.inputs))
    if cmac.addressing == "dense" and dense > cmac.memory_bytes:
        raise BadInput(
            "cmac.memory_bytes",
            cmac.memory_bytes,
            f"dense addressing of {2 * len(cmac.inputs)} inputs needs {dense} B (at most {2**34} B are allowed); "
            "give it that, take fewer cmac.inputs or layers, or cmac.addressing=hashed",
        )


def check_length(config: Config) -> None:
    """Hold the run to what fits into memory."""
    most = MOST_STEPS // config.steps_per_cycle
    if config.cycles > most:
        raise BadInput("cycles", config.cycles, f"must be at most {most} with {config.steps_per_cycle} steps a cycle")


def check(config: Config) -> None:
    """Check every field and every combination that can be told before planning.

    Raises:
        BadInput: names the key, the value, what is allowed and how to mend it.
    """
    check_fields(config)
    check_timing(config)
    check_pattern(config)
    check_length(config)
    check_memory(config)
