"""Check a config before anything is planned or simulated."""

import os
import resource
from typing import Any

from cmacexp.config.cmac import CMACS, PHASE, check_size
from cmacexp.config.component import COMPONENTS, ComponentConfig, find_option
from cmacexp.config.fields import listed
from cmacexp.config.gait import PATTERNS
from cmacexp.config.machine import QuadrupedMachine, RobotMachine, ask_for_robot, read_model
from cmacexp.config.schema import Config, read_component
from cmacexp.errors import BadInput, require

Check = tuple[bool, str, Any, str]
"""Whether a combination of fields is wrong; the key that the message names, its value, and what it must be."""
SHORTEST_RAMP = 10
"""Samples of the shortest ramp of the load: a shorter one is a jump that no sampled motion follows."""
TOLERANCE = 1e-9
"""Largest relative distance of an event from its sample."""
MOST_ROWS = 2**24
"""Steps times legs of the longest cycle, which is held in memory as a whole."""
SAMPLE_BYTES = 1000
"""Memory that the plan, the samples and the traces of each leg take at each sample of a cycle, about."""
CELL_BYTES, ACTIVATION_BYTES = 12, 10
"""Memory of an active cell of a sample: its row and what finding it takes; its activation, unless it is 1."""
DISTANCE_BYTES = 16
"""Memory of the distance of a sample from a centre along one input: its difference and that squared."""
MOST_STEPS = 2**31 - 1
"""Steps of the longest run: the trace counts them in 32 bits."""


def _is_whole(ratio: float) -> bool:
    return abs(ratio - round(ratio)) <= TOLERANCE * max(1.0, abs(ratio))


def _near_period(config: Config, divisor: int) -> float:
    """A short number near the sampling period that divides the cycle into a multiple of ``divisor``."""
    ratio = config.gait.cycle_time / config.sampling_period
    counts = [n for n in range(int(0.8 * ratio), int(1.25 * ratio) + 3) if n > 1 and n % divisor == 0]
    periods = [config.gait.cycle_time / n for n in counts or [2 * divisor]]
    return min(periods, key=lambda period: len(f"{period:.12g}"))


def check_timing(config: Config) -> list[Check]:
    """Every lift-off and touch-down falls on a sample of the cycle."""
    gait, period, divisor = config.gait, config.sampling_period, PATTERNS[config.gait.pattern].divisor
    ratio = gait.cycle_time / period
    steps, support = round(ratio), ratio * gait.duty_factor
    divides = _is_whole(ratio) and steps >= 2
    near = "" if divides and steps % divisor == 0 else f"{_near_period(config, divisor):.12g}"
    at_sample = f"must fall on one of the {steps} samples of the cycle"
    whole_steps = f"must divide gait.cycle_time={gait.cycle_time:g} s into at least 2 whole steps"
    if not divides:
        return [(True, "sampling_period", period, f"{whole_steps}; {near} does")]
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
    """Gait and desired force fit the number of legs of the machine."""
    gait, force, kind = config.gait, config.force_control.desired_force, config.machine.kind
    legs, with_kind = 4 if config.has_body else 1, f"with machine.kind={config.machine.kind}"
    fitting = listed([name for name, pattern in PATTERNS.items() if pattern.legs == legs])
    is_dynamic = PATTERNS[gait.pattern].is_dynamic and kind != "robot"
    given = f"must be null {with_kind}: the feet share the weight"
    return [
        (config.legs != legs, "gait.pattern", gait.pattern, f"{with_kind} choose from {fitting}"),
        (
            is_dynamic,
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
            (force is None) != config.has_body,
            "force_control.desired_force",
            force,
            given if config.has_body else f"must be a number above 0 (N) {with_kind}",
        ),
    ]


def check_pattern(config: Config) -> list[Check]:
    """Duty factor, stroke and load ramps are what the pattern of the gait allows."""
    gait, pattern, period = config.gait, PATTERNS[config.gait.pattern], config.sampling_period
    least, duty, given = pattern.least_duty_factor, gait.duty_factor, f"with gait.pattern={gait.pattern}"
    is_stable = not least or least <= duty < 1 or gait.allow_unstable
    stable = f"must be at least {least:g} and below 1 for a statically stable {gait.pattern} gait"
    speed = gait.stroke / (duty * gait.cycle_time) if gait.speed is None else gait.speed
    travel, shortest = speed * duty * gait.cycle_time, SHORTEST_RAMP * period
    ramps = {
        "gait.load_ramp": (gait.load_ramp, duty * gait.cycle_time - gait.unload_ramp),
        "gait.unload_ramp": (gait.unload_ramp, duty * gait.cycle_time - gait.load_ramp),
    }
    return [
        (not is_stable, "gait.duty_factor", duty, f"{stable}; or gait.allow_unstable=true"),
        (pattern.lifts and duty == 1, "gait.duty_factor", duty, f"must be below 1 {given}; or use gait=standing"),
        (not pattern.lifts and duty != 1, "gait.duty_factor", duty, f"must be 1 {given}"),
        (
            not pattern.lifts and gait.stroke != 0,
            "gait.stroke",
            gait.stroke,
            f"must be 0 {given}, which never lifts a foot",
        ),
        (
            abs(gait.stroke - travel) > 1e-4 * max(travel, gait.stroke),
            "gait.stroke",
            gait.stroke,
            f"must be {travel:.6g} m with gait.speed={speed:g}; or set gait.speed=null",
        ),
        *(
            (
                ramp > 0 and not shortest <= ramp <= longest - period,
                key,
                ramp,
                f"must be 0, or at least {shortest:g} s ({SHORTEST_RAMP} samples) and below {longest:g} s (support)",
            )
            for key, (ramp, longest) in ramps.items()
        ),
    ]


def check_ground_and_payload(config: Config) -> list[Check]:
    """A step of the stiffness, a slope and a payload come where feet and body are, during the run."""
    terrain, payload, machine, legs = config.terrain, config.payload, config.machine, config.legs
    end, named = config.cycles * config.gait.cycle_time, terrain.step_legs
    hips = machine.hips if isinstance(machine, QuadrupedMachine | RobotMachine) else [(0.0, 0.0)]
    furthest = config.gait.stroke / 2.0 + config.body_speed * end + max(x for x, _ in hips)
    some_legs = "1" if legs == 1 else f"some of 1 to {legs}, each once"
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
            named is not None and not 0 < len(named) == len(set(named) & set(range(1, legs + 1))),
            "terrain.step_legs",
            named,
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
    """The cycles fit into memory, trace and run; delays and gains fit the cycle and the method of force control."""
    steps, record, most = config.steps_per_cycle, config.record, MOST_ROWS // config.legs
    no_damping = config.gains is not None and config.gains[1] == 0.0
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
            config.force_control.method == "damping" and no_damping,
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
    """Bytes that this process can have: the memory of the machine, or the limit of its address space if less."""
    installed = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return installed if limit == resource.RLIM_INFINITY else min(installed, limit)


def check_memory(config: Config) -> None:
    """Check that one cycle with its network fits into memory, before anything is planned; raises BadInput.

    Not part of :func:`check`: a config that another machine has run is valid, whatever this one has.
    """
    steps, part = config.steps_per_cycle, config.feedforward
    option = find_option("feedforward", read_component(part)["_target_"])
    rows, network, key, value = steps * config.legs, 0, "", 0
    if option in CMACS:
        key, value = "cmac.layers", config.cmac.layers
        cell = CELL_BYTES + (config.cmac.receptive_field != "rectangular") * ACTIVATION_BYTES
        network = rows * value * cell
    elif option == "rbf":  # leg by leg
        key, value = "feedforward.centres", part.centres
        network = steps * value * _count_inputs(config, part.inputs) * DISTANCE_BYTES
    needed, memory = rows * SAMPLE_BYTES + network, machine_memory()
    if needed > memory:
        period, gib = f"{config.sampling_period:g}", 2**30
        size = (
            f"needs {needed / gib:.1f} GiB, more than the {memory / gib:.1f} GiB of this machine or process: "
            f"{steps} samples a cycle of each leg"
        )
        if network < needed / 2:
            raise BadInput("sampling_period", period, f"{size}; use a longer one")
        raise BadInput(key, value, f"with sampling_period={period} {size}; use fewer, or a longer sampling_period")


def check(config: Config) -> None:
    """Check every combination of fields that can be judged before planning; raises BadInput."""
    if isinstance(config.machine, RobotMachine):  # it must have four legs, and a model that can be found
        if config.legs == 1 and config.scenario != "robot":
            raise ask_for_robot(config.machine)
        read_model(config.machine)
    for make_checks in CHECKS:
        for is_wrong, key, value, allowed in make_checks(config):
            require(not is_wrong, key, value, allowed)
    check_size(config.cmac, _count_inputs(config, config.cmac.inputs), config.joints)
    for group in COMPONENTS:
        component = vars(config)[group]
        if isinstance(component, ComponentConfig):
            component.check(config)
