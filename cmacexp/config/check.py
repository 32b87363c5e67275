"""Checks of a config that one field alone cannot tell."""

from cmacexp.config.check_environment import check_payload, check_slope, check_stiffness_step
from cmacexp.config.check_sensors import check_sensors
from cmacexp.config.cmac import check_memory
from cmacexp.config.feedforwards import INPUTS, PerceptronConfig, RadialBasisConfig
from cmacexp.config.fields import check_fields, listed
from cmacexp.config.machine import QuadrupedMachine
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput

OUTPUTS = 2
"""Outputs of a CMAC: one torque for each joint of its leg."""
LEGS = {"transfer_first": 1, "standing": 1, "wave": 4}
"""Legs that each gait pattern is for."""
MOST_ROWS = 2**24
"""Steps times legs of the longest cycle, which is worked on as a whole."""
MOST_STEPS = 2**31 - 1
"""Steps of the longest run: the trace counts them in 32 bits."""
SHORTEST_RAMP = 10
"""Samples of the shortest ramp of the load: a shorter one is a jump that no sampled motion follows."""
TOLERANCE = 1e-9
"""Largest relative distance of an event from its sample."""


def _is_whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) <= TOLERANCE * max(1.0, abs(ratio))


def _near_period(config: Config, multiple: int) -> float:
    """A sampling period near that of ``config`` that divides the cycle well, and is short to write."""
    ratio = config.gait.cycle_time / config.sampling_period
    counts = [n for n in range(int(0.8 * ratio), int(1.25 * ratio) + 3) if n > 1 and n % multiple == 0]
    return min((config.gait.cycle_time / n for n in counts), key=lambda period: len(f"{period:.12g}"))


def check_timing(config: Config) -> None:
    """Hold lift-off and touch-down to samples of the cycle."""
    gait = config.gait
    ratio = gait.cycle_time / config.sampling_period
    if not _is_whole(ratio) or round(ratio) < 2:
        near = _near_period(config, 2 if gait.pattern == "wave" else 1)
        raise BadInput(
            "sampling_period",
            config.sampling_period,
            f"must divide gait.cycle_time={gait.cycle_time:g} s into at least 2 whole steps; {near:.12g} does",
        )
    for phase in gait.touch_down or []:
        if not _is_whole(phase * ratio):
            near = round(phase * ratio) / round(ratio)
            raise BadInput(
                "gait.touch_down",
                phase,
                f"must fall on one of the {round(ratio)} samples of the cycle; {near:.12g} does",
            )
    if gait.pattern == "wave" and round(ratio) % 2:
        near = _near_period(config, 2)
        raise BadInput(
            "sampling_period",
            config.sampling_period,
            f"gives {round(ratio)} steps a cycle, a wave gait needs an even number: try {near:.12g}",
        )
    support = ratio * gait.duty_factor
    if not _is_whole(support) or round(support) < 1:
        near = max(1, round(support)) / round(ratio)
        raise BadInput(
            "gait.duty_factor",
            gait.duty_factor,
            f"touch-down must fall on one of the {round(ratio)} samples of the cycle; {near:.12g} does",
        )


def check_machine(config: Config) -> None:
    """Hold gait and desired force to the number of legs."""
    gait, force = config.gait, config.force_control.desired_force
    legs = 4 if isinstance(config.machine, QuadrupedMachine) else 1
    if LEGS[gait.pattern] != legs:
        fitting = [name for name, number in LEGS.items() if number == legs]
        raise BadInput(
            "gait.pattern", gait.pattern, f"with machine.kind={config.machine.kind} choose from {listed(fitting)}"
        )
    if gait.touch_down is not None and len(gait.touch_down) != legs:
        raise BadInput(
            "gait.touch_down", gait.touch_down, f"must have one value for each of the {legs} legs, or be null"
        )
    if (force is None) != (legs == 4):
        allowed = "must be null: the weight is shared out" if legs == 4 else "must be a number above 0 (N)"
        raise BadInput("force_control.desired_force", force, f"{allowed} with machine.kind={config.machine.kind}")


def check_pattern(config: Config) -> None:
    """Hold the duty factor to what the gait's pattern can do."""
    gait = config.gait
    if gait.pattern == "wave" and not (0.75 <= gait.duty_factor < 1 or gait.allow_unstable):
        raise BadInput(
            "gait.duty_factor",
            gait.duty_factor,
            "must be at least 0.75 and below 1 for a wave gait with three feet down; or gait.allow_unstable=true",
        )
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
    shortest = SHORTEST_RAMP * config.sampling_period
    if gait.load_ramp and not shortest <= gait.load_ramp <= support_time - config.sampling_period:
        raise BadInput(
            "gait.load_ramp",
            gait.load_ramp,
            f"must be 0, or from {shortest:g} s ({SHORTEST_RAMP} samples) to below {support_time:g} s of support",
        )


def check_inputs(key: str, inputs: list[str]) -> None:
    """Hold the inputs of a network to some, each once."""
    if not inputs or len(set(inputs)) != len(inputs):
        raise BadInput(key, inputs, f"must name at least one of {', '.join(INPUTS)}, each once")


def check_feedforward(config: Config) -> None:
    """Hold inputs and nearest Gaussians of a network to what there is."""
    part = config.feedforward
    if isinstance(part, RadialBasisConfig | PerceptronConfig):
        check_inputs("feedforward.inputs", part.inputs)
    if isinstance(part, RadialBasisConfig) and part.active > part.centres:
        raise BadInput("feedforward.active", part.active, f"must be at most feedforward.centres={part.centres}")


def check_cmac(config: Config) -> None:
    """Hold the inputs of the CMAC to some, each once, and its memory to what they need."""
    inputs = config.cmac.inputs
    check_inputs("cmac.inputs", inputs)
    check_memory(config.cmac, 2 * len(inputs), OUTPUTS)


def check_gains(config: Config) -> None:
    """Hold the gain that a force control method divides by above 0."""
    if config.force_control.method == "damping" and config.gains is not None and config.gains[1] == 0.0:
        raise BadInput("controller.velocity_gain", 0.0, "must be above 0 with force_control=damping (eq. 11)")


def check_length(config: Config) -> None:
    """Hold the cycle to what fits into memory, and the run to what the trace can count."""
    steps, legs = config.steps_per_cycle, LEGS[config.gait.pattern]
    if steps * legs > MOST_ROWS:
        raise BadInput(
            "sampling_period",
            config.sampling_period,
            f"gives {steps} steps a cycle, more than the {MOST_ROWS // legs} that a cycle can have",
        )
    if config.cycles > MOST_STEPS // steps:
        raise BadInput("cycles", config.cycles, f"must be at most {MOST_STEPS // steps} with {steps} steps a cycle")


def check_actuator(config: Config) -> None:
    """Hold the delay of the torques to less than a cycle."""
    longest = config.steps_per_cycle - 1
    if config.actuator.delay > longest:
        raise BadInput("actuator.delay", config.actuator.delay, f"must be at most {longest}, less than a cycle")


def check_record(config: Config) -> None:
    """Hold the cycles to be kept to those that there are."""
    for cycle in config.record.cycles or []:
        if cycle > config.cycles:
            raise BadInput("record.cycles", cycle, f"must be at most {config.cycles}, the cycles of the run")


def check(config: Config) -> None:
    """Check every field and every combination that can be told before planning.

    Raises:
        BadInput: names the key, the value, what is allowed and how to mend it.
    """
    check_fields(config)
    check_timing(config)
    check_machine(config)
    check_stiffness_step(config, LEGS[config.gait.pattern])
    check_slope(config)
    check_payload(config)
    check_pattern(config)
    check_length(config)
    check_record(config)
    check_gains(config)
    check_cmac(config)
    check_feedforward(config)
    check_actuator(config)
    check_sensors(config, LEGS[config.gait.pattern], isinstance(config.machine, QuadrupedMachine))
