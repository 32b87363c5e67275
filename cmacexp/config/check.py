"""Check a config before anything is planned or simulated."""

import os
import resource
from typing import Any

from cmacexp.config.cmac import CMACS, PHASE, check_size
from cmacexp.config.component import COMPONENTS, ComponentConfig, find_option
from cmacexp.config.fields import listed
from cmacexp.config.gait import PATTERNS, SHORTEST_RAMP_SAMPLES
from cmacexp.config.machine import QuadrupedMachine, RobotMachine, ask_for_robot, read_model
from cmacexp.config.schema import Config, read_component
from cmacexp.errors import BadInput, require

Check = tuple[bool, str, Any, str]
"""True if a combination of fields is invalid; then the key that the message names, its value, and the requirement."""
TOLERANCE = 1e-9
"""Largest relative deviation of the time of an event from that of its sample."""
MOST_ROWS = 2**24
"""Largest number of steps times legs of a cycle, which is in memory as a whole."""
SAMPLE_BYTES = 1000
"""Approximate memory for plan, samples and trace of a leg, per sample of a cycle, B."""
CELL_BYTES = 12
"""Memory for an active cell of a sample, B: its row, and the search for the row."""
ACTIVATION_BYTES = 10
"""Memory for the activation of a cell, B; not needed if all activations are 1."""
DISTANCE_BYTES = 16
"""Memory for the distance of a sample from a centre along one input, B: the difference and its square."""
MOST_STEPS = 2**31 - 1
"""Number of steps of the longest run: the trace counts them with 32 bits."""
GIB = 2**30


def _is_whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) <= TOLERANCE * max(1.0, abs(ratio))


def _near_period(config: Config, divisor: int) -> float:
    """Return a short number near the sampling period, s, that gives a multiple of ``divisor`` steps per cycle."""
    ratio = config.gait.cycle_time / config.sampling_period
    counts = [n for n in range(int(0.8 * ratio), int(1.25 * ratio) + 3) if n > 1 and n % divisor == 0]
    periods = [config.gait.cycle_time / n for n in counts or [2 * divisor]]
    return min(periods, key=lambda period: len(f"{period:.12g}"))


def check_timing(config: Config) -> list[Check]:
    """Check that every lift-off and touch-down falls on a sample of the cycle."""
    gait = config.gait
    period = config.sampling_period
    divisor = PATTERNS[gait.pattern].divisor
    ratio = gait.cycle_time / period
    steps = round(ratio)
    support = ratio * gait.duty_factor
    divides = _is_whole(ratio) and steps >= 2
    near = "" if divides and steps % divisor == 0 else f"{_near_period(config, divisor):.12g}"
    at_sample = f"must fall on one of the {steps} samples of the cycle"
    if not divides:
        allowed = f"must divide gait.cycle_time={gait.cycle_time:g} s into at least 2 whole steps; {near} does"
        return [(True, "sampling_period", period, allowed)]
    return [
        *(
            (
                not _is_whole(phase * ratio),
                "gait.touch_down",
                phase,
                f"{at_sample}; {round(phase * ratio) / steps:.12g} does",
            )
            for phase in gait.touch_down or []
        ),
        (
            steps % divisor != 0,
            "sampling_period",
            period,
            f"gives {steps} steps a cycle, a {gait.pattern} gait needs a multiple of {divisor}: try {near}",
        ),
        (
            not _is_whole(support) or round(support) < 1,
            "gait.duty_factor",
            gait.duty_factor,
            f"touch-down {at_sample}; {max(1, round(support)) / steps:.12g} does",
        ),
    ]


def check_legs(config: Config) -> list[Check]:
    """Check that gait and desired force fit the number of legs of the machine."""
    gait = config.gait
    force = config.force_control.desired_force
    legs = 4 if config.has_body else 1
    width = config.machine.width if isinstance(config.machine, RobotMachine) else gait.width
    with_kind = f"with machine.kind={config.machine.kind}"
    fitting = listed([name for name, pattern in PATTERNS.items() if pattern.legs == legs])
    return [
        (config.legs != legs, "gait.pattern", gait.pattern, f"{with_kind} choose from {fitting}"),
        (
            PATTERNS[gait.pattern].is_dynamic and config.machine.kind != "robot",
            "gait.pattern",
            gait.pattern,
            f"needs a body that moves: {with_kind} choose wave, or scenario=robot",
        ),
        (
            gait.touch_down is not None and len(gait.touch_down) != legs,
            "gait.touch_down",
            gait.touch_down,
            f"must have one value for each of the {legs} legs, or be null",
        ),
        (
            width != gait.width,
            "machine.width",
            width,
            "is that of gait.width: set gait.width instead",
        ),
        (
            (force is None) != config.has_body,
            "force_control.desired_force",
            force,
            f"must be null {with_kind}: the feet share the weight"
            if config.has_body
            else f"must be a number above 0 (N) {with_kind}",
        ),
    ]


def check_pattern(config: Config) -> list[Check]:
    """Check that duty factor, stroke and load ramps fit the pattern of the gait."""
    gait = config.gait
    pattern = PATTERNS[gait.pattern]
    least = pattern.least_duty_factor
    duty = gait.duty_factor
    with_pattern = f"with gait.pattern={gait.pattern}"
    is_stable = not least or least <= duty < 1 or gait.allow_unstable
    speed = gait.stroke / (duty * gait.cycle_time) if gait.speed is None else gait.speed
    travel = speed * duty * gait.cycle_time
    shortest = SHORTEST_RAMP_SAMPLES * config.sampling_period
    ramps = {
        "gait.load_ramp": (gait.load_ramp, duty * gait.cycle_time - gait.unload_ramp),
        "gait.unload_ramp": (gait.unload_ramp, duty * gait.cycle_time - gait.load_ramp),
    }
    return [
        (
            not is_stable,
            "gait.duty_factor",
            duty,
            f"must be at least {least:g} and below 1 for a statically stable {gait.pattern} gait; "
            "or gait.allow_unstable=true",
        ),
        (
            pattern.lifts and duty == 1,
            "gait.duty_factor",
            duty,
            f"must be below 1 {with_pattern}; or use gait=standing",
        ),
        (not pattern.lifts and duty != 1, "gait.duty_factor", duty, f"must be 1 {with_pattern}"),
        (
            not pattern.lifts and gait.stroke != 0,
            "gait.stroke",
            gait.stroke,
            f"must be 0 {with_pattern}, which never lifts a foot",
        ),
        (
            abs(gait.stroke - travel) > 1e-4 * max(travel, gait.stroke),
            "gait.stroke",
            gait.stroke,
            f"must be {travel:.6g} m with gait.speed={speed:g}; or set gait.speed=null",
        ),
        *(
            (
                ramp > 0 and not shortest <= ramp <= longest - config.sampling_period,
                key,
                ramp,
                f"must be 0, or at least {shortest:g} s ({SHORTEST_RAMP_SAMPLES} samples) "
                f"and below {longest:g} s (support)",
            )
            for key, (ramp, longest) in ramps.items()
        ),
    ]


def check_ground_and_payload(config: Config) -> list[Check]:
    """Check that a stiffness step, a slope and a payload occur during the run, where the feet or the body are."""
    terrain = config.terrain
    payload = config.payload
    machine = config.machine
    end = config.cycles * config.gait.cycle_time
    hips = machine.hips if isinstance(machine, QuadrupedMachine | RobotMachine) else [(0.0, 0.0)]
    furthest = config.gait.stroke / 2.0 + config.body_speed * end + max(x for x, _ in hips)
    some_legs = "1" if config.legs == 1 else f"some of 1 to {config.legs}, each once"
    has_none = f"must be 0 with machine.kind={machine.kind}: it has no body"
    bounds = [(axis, min(values), max(values)) for axis, values in zip("xy", zip(*hips, strict=True), strict=True)]
    return [
        (
            terrain.step_time is not None and terrain.step_time >= end,
            "terrain.step_time",
            terrain.step_time,
            f"must be below {end:g} s, the end of the run",
        ),
        (
            terrain.step_legs is not None
            and not 0 < len(terrain.step_legs) == len(set(terrain.step_legs) & set(range(1, config.legs + 1))),
            "terrain.step_legs",
            terrain.step_legs,
            f"must be {some_legs}; or null for all",
        ),
        (
            terrain.slope != 0 and terrain.slope_start >= furthest,
            "terrain.slope_start",
            terrain.slope_start,
            f"must be below {furthest:.4g} m, the furthest that a foot gets",
        ),
        (payload.weight > 0 and not config.has_body, "payload.weight", payload.weight, has_none),
        (
            payload.weight > 0 and payload.time >= end,
            "payload.time",
            payload.time,
            f"must be below {end:g} s, the end of the run",
        ),
        *(
            (
                payload.weight > 0 and not low <= vars(payload)[axis] <= high,
                f"payload.{axis}",
                vars(payload)[axis],
                f"must be from {low:g} to {high:g} m, between the hips",
            )
            for axis, low, high in bounds
        ),
    ]


def check_run(config: Config) -> list[Check]:
    """Check the number of steps, the choice of what is recorded, the damping gain and the actuator delay."""
    steps = config.steps_per_cycle
    record = config.record
    most = MOST_ROWS // config.legs
    return [
        (
            steps > most,
            "sampling_period",
            config.sampling_period,
            f"gives {steps} steps a cycle, more than the {most} that a cycle can have",
        ),
        (
            config.cycles > MOST_STEPS // steps,
            "cycles",
            config.cycles,
            f"must be at most {MOST_STEPS // steps} with {steps} steps a cycle",
        ),
        (record.cycles == [], "record.cycles", [], "must name at least one cycle; or null for all"),
        *(
            (
                cycle > config.cycles,
                "record.cycles",
                cycle,
                f"must be at most {config.cycles}, the cycles of the run",
            )
            for cycle in record.cycles or []
        ),
        (
            record.recording and not record.trace,
            "record.recording",
            True,
            "must be false with record.trace=false: a recording is made of the traces",
        ),
        (
            config.force_control.method == "damping" and config.gains is not None and config.gains[1] == 0.0,
            "controller.velocity_gain",
            0.0,
            "must be above 0 with force_control=damping (eq. 11)",
        ),
        (
            config.actuator.delay >= steps,
            "actuator.delay",
            config.actuator.delay,
            f"must be at most {steps - 1}, less than a cycle",
        ),
    ]


CHECKS = (check_timing, check_legs, check_ground_and_payload, check_pattern, check_run)


def _count_inputs(config: Config, names: list[str]) -> int:
    return sum(2 if name == PHASE else config.joints for name in names)


def machine_memory() -> int:
    """Return the memory available to this process, B: that of the machine or, if less, its address space limit."""
    installed = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return installed if limit == resource.RLIM_INFINITY else min(installed, limit)


def check_memory(config: Config) -> None:
    """Check, before anything is planned, that one cycle with its network fits into memory; raises BadInput.

    This is not part of :func:`check`: the config of a stored run is valid even if this machine has less memory.
    """
    steps = config.steps_per_cycle
    rows = steps * config.legs
    feedforward = config.feedforward
    option = find_option("feedforward", read_component(feedforward)["_target_"])
    network = 0
    if option in CMACS:
        cell_bytes = CELL_BYTES + (config.cmac.receptive_field != "rectangular") * ACTIVATION_BYTES
        network = rows * config.cmac.layers * cell_bytes
    elif option == "rbf":  # computed for one leg after the other
        network = steps * feedforward.centres * _count_inputs(config, feedforward.inputs) * DISTANCE_BYTES
    needed = rows * SAMPLE_BYTES + network
    memory = machine_memory()
    if needed > memory:
        period = f"{config.sampling_period:g}"
        size = (
            f"needs {needed / GIB:.1f} GiB, more than the {memory / GIB:.1f} GiB of this machine or process: "
            f"{steps} samples a cycle of each leg"
        )
        if network < needed / 2:
            raise BadInput("sampling_period", period, f"{size}; use a longer one")
        is_cmac = option in CMACS
        key = "cmac.layers" if is_cmac else "feedforward.centres"
        value = config.cmac.layers if is_cmac else feedforward.centres
        raise BadInput(key, value, f"with sampling_period={period} {size}; use fewer, or a longer sampling_period")


def check(config: Config) -> None:
    """Check all combinations of fields that can be checked before planning; raises BadInput."""
    if isinstance(config.machine, RobotMachine):
        if config.legs == 1 and config.scenario != "robot":
            raise ask_for_robot(config.machine.model)
        read_model(config.machine)
    for make_checks in CHECKS:
        for is_wrong, key, value, allowed in make_checks(config):
            require(not is_wrong, key, value, allowed)
    check_size(config.cmac, _count_inputs(config, config.cmac.inputs), config.joints)
    for group in COMPONENTS:
        component = vars(config)[group]
        if isinstance(component, ComponentConfig):
            component.check(config)
