"""Check a config before anything is planned or simulated."""

from typing import Any

from cmacexp.config.check_gait import Mistakes, check_legs, check_pattern, check_timing
from cmacexp.config.cmac import PHASE, check_size
from cmacexp.config.component import COMPONENTS, ComponentConfig
from cmacexp.config.fields import check_fields
from cmacexp.config.machine import BodyMachine, RobotMachine, ask_for_robot, read_model
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput

MOST_ROWS = 2**24
"""Steps times legs of the longest cycle, which is held in memory as a whole."""
MOST_STEPS = 2**31 - 1
"""Steps of the longest run: the trace counts them in 32 bits."""


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


def check_robot(config: Config) -> None:
    """Check that a robot has four legs, and a model that can be found: a quadruped with three hinges a leg."""
    if isinstance(config.machine, RobotMachine):
        if config.legs == 1 and config.scenario != "robot":
            raise ask_for_robot(config.machine)
        read_model(config.machine)


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


def check(config: Config) -> None:
    """Check every field, and every combination that can be judged before planning; raises BadInput."""
    check_fields(config)
    check_robot(config)
    for find_mistakes in CHECKS:
        for key, allowed in find_mistakes(config):
            raise _mistake(config, key, allowed)
    check_size(config.cmac, sum(2 if name == PHASE else config.joints for name in config.cmac.inputs), config.joints)
    for group in COMPONENTS:
        component = getattr(config, group)
        if isinstance(component, ComponentConfig):
            component.check(config)
