"""Checks of ground and payload against the run: a change that has no effect is a mistake."""

from cmacexp.config.check_gait import Mistakes
from cmacexp.config.machine import BodyMachine
from cmacexp.config.schema import Config


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
