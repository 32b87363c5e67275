"""Check a config before anything is planned or simulated."""

import os
import resource
from collections.abc import Iterator
from typing import Any

from cmacexp.config.cmac import CMACS, PHASE, check_size
from cmacexp.config.component import COMPONENTS, ComponentConfig, find_option
from cmacexp.config.fields import listed
from cmacexp.config.gait import PATTERNS
from cmacexp.config.machine import BodyMachine, RobotMachine, ask_for_robot, read_model
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput

Mistakes = Iterator[tuple[str, str]]
"""The keys that are wrong, with what is allowed of each; computed one by one, since the first ends the check."""
SHORTEST_RAMP = 10
"""Samples of the shortest ramp of the load: a shorter one is a jump that no sampled motion follows."""
TOLERANCE = 1e-9
"""Largest relative distance of an event from its sample."""
MOST_ROWS = 2**24
"""Steps times legs of the longest cycle, which is held in memory as a whole."""
SAMPLE_BYTES = 1000
"""Of the plan, the samples and the traces of each leg at each sample of a cycle, about."""
CELL_BYTES, ACTIVATION_BYTES = 12, 10
"""Of an active cell of a sample: its row and what finding it takes; its activation, unless it is 1."""
DISTANCE_BYTES = 16
"""Of the distance of a sample from a centre along one input: its difference and that squared."""
MOST_STEPS = 2**31 - 1
"""Steps of the longest run: the trace counts them in 32 bits."""


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
    elif PATTERNS[gait.pattern].is_dynamic and kind != "robot":
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


def check_stiffness_step(config: Config) -> Mistakes:
    """A step of the stiffness falls into the run, under legs of the machine."""
    terrain, legs, end = config.terrain, config.legs, config.cycles * config.gait.cycle_time
    if terrain.step_time is not None and terrain.step_time >= end:
        yield "terrain.step_time", f"must be below {end:g} s, the end of the run"
    if (named := terrain.step_legs) is not None and not 0 < len(named) == len(set(named) & set(range(1, legs + 1))):
        allowed = "1" if legs == 1 else f"some of 1 to {legs}, each once"
        yield "terrain.step_legs", f"must be {allowed}; or null for all"


def check_slope(config: Config) -> Mistakes:
    """A slope begins where feet come."""
    machine, furthest = config.machine, config.gait.stroke / 2.0
    if isinstance(machine, BodyMachine):
        walked = config.body_speed * config.cycles * config.gait.cycle_time
        furthest += walked + max(x for x, _ in machine.hips)
    if config.terrain.slope and config.terrain.slope_start >= furthest:
        yield "terrain.slope_start", f"must be below {furthest:.4g} m, the furthest that a foot gets"


def check_payload(config: Config) -> Mistakes:
    """A payload lies on a body, within the rectangle of its hips, during the run."""
    payload, machine, end = config.payload, config.machine, config.cycles * config.gait.cycle_time
    if not payload.weight:
        return
    if not isinstance(machine, BodyMachine):
        yield "payload.weight", f"must be 0 with machine.kind={machine.kind}: it has no body"
    if payload.time >= end:
        yield "payload.time", f"must be below {end:g} s, the end of the run"
    for axis, hips in zip("xy", zip(*machine.hips, strict=True), strict=True):
        if not min(hips) <= getattr(payload, axis) <= max(hips):
            yield f"payload.{axis}", f"must be from {min(hips):g} to {max(hips):g} m, between the hips"


def check_run(config: Config) -> Mistakes:
    """The cycles fit into memory, trace and run; delays and gains fit the cycle and the method of force control."""
    steps = config.steps_per_cycle
    if steps * config.legs > MOST_ROWS:
        most = MOST_ROWS // config.legs
        yield "sampling_period", f"gives {steps} steps a cycle, more than the {most} that a cycle can have"
    if config.cycles > MOST_STEPS // steps:
        yield "cycles", f"must be at most {MOST_STEPS // steps} with {steps} steps a cycle"
    for i, cycle in enumerate(config.record.cycles or []):
        if cycle > config.cycles:
            yield f"record.cycles.{i}", f"must be at most {config.cycles}, the cycles of the run"
    if config.record.recording and not config.record.trace:
        yield "record.recording", "must be false with record.trace=false: a recording is made of the traces"
    if config.force_control.method == "damping" and config.gains is not None and config.gains[1] == 0.0:
        yield "controller.velocity_gain", "must be above 0 with force_control=damping (eq. 11)"
    if config.actuator.delay >= steps:
        yield "actuator.delay", f"must be at most {steps - 1}, less than a cycle"


CHECKS = (check_timing, check_legs, check_stiffness_step, check_slope, check_payload, check_pattern, check_run)


def _mistake(config: Config, key: str, allowed: str) -> BadInput:
    """The mistake of a key, whose last part may be the place of an item in a list."""
    value: Any = config
    for name in key.split("."):
        if isinstance(value, list):
            value, key = value[int(name)], key.removesuffix(f".{name}")
        else:
            value = value[name] if isinstance(value, dict) else getattr(value, name)
    return BadInput(key, value, allowed)


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
    option = find_option("feedforward", part["_target_"] if isinstance(part, dict) else part._target_)
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
        size = f"needs {needed / gib:.1f} GiB, more than the {memory / gib:.1f} GiB of this machine or process: "
        size += f"{steps} samples a cycle of each leg"
        if network < needed / 2:
            raise BadInput("sampling_period", period, f"{size}; use a longer one")
        raise BadInput(key, value, f"with sampling_period={period} {size}; use fewer, or a longer sampling_period")


def check(config: Config) -> None:
    """Check every combination of fields that can be judged before planning; raises BadInput."""
    if isinstance(config.machine, RobotMachine):  # it must have four legs, and a model that can be found
        if config.legs == 1 and config.scenario != "robot":
            raise ask_for_robot(config.machine)
        read_model(config.machine)
    for find_mistakes in CHECKS:
        for key, allowed in find_mistakes(config):
            raise _mistake(config, key, allowed)
    check_size(config.cmac, _count_inputs(config, config.cmac.inputs), config.joints)
    for group in COMPONENTS:
        component = getattr(config, group)
        if isinstance(component, ComponentConfig):
            component.check(config)
