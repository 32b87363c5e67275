"""Checks of ground and payload against the run: a change that has no effect is a mistake."""

from cmacexp.config.machine import BodyMachine
from cmacexp.config.schema import Config
from cmacexp.errors import BadInput


def check_stiffness_step(config: Config) -> None:
    """Check that a step of the stiffness falls into the run, under legs of the machine."""
    terrain, legs, end = config.terrain, config.legs, config.cycles * config.gait.cycle_time
    if terrain.step_time is None:
        for key, value, without in (("factor", terrain.step_factor, 1.0), ("legs", terrain.step_legs, None)):
            if value != without:
                raise BadInput(
                    f"terrain.step_{key}",
                    value,
                    f"needs terrain.step_time, at least 0 and below {end:g} s, the end of the run",
                )
        return
    if terrain.step_time >= end:
        raise BadInput("terrain.step_time", terrain.step_time, f"must be below {end:g} s, the end of the run")
    named = terrain.step_legs
    if named is not None and (not named or len(set(named)) < len(named) or max(named) > legs):
        allowed = "1" if legs == 1 else f"some of 1 to {legs}, each once"
        raise BadInput("terrain.step_legs", named, f"must be {allowed}; or null for all")


def furthest_foot(config: Config) -> float:
    """The largest x in the world, m, at which a foot is planned to stand."""
    machine, half = config.machine, config.gait.stroke / 2.0
    if not isinstance(machine, BodyMachine):
        return half
    return half + config.body_speed * config.cycles * config.gait.cycle_time + max(x for x, _ in machine.hips)


def check_slope(config: Config) -> None:
    """Check that a slope begins where feet come."""
    terrain, furthest = config.terrain, furthest_foot(config)
    if terrain.slope and terrain.slope_start >= furthest:
        raise BadInput(
            "terrain.slope_start",
            terrain.slope_start,
            f"must be below {furthest:.4g} m, the furthest that a foot gets",
        )


def check_payload(config: Config) -> None:
    """Check that a payload lies on a body, within the rectangle of its hips, during the run."""
    payload, machine, end = config.payload, config.machine, config.cycles * config.gait.cycle_time
    if not payload.weight:
        return
    if not isinstance(machine, BodyMachine):
        raise BadInput(
            "payload.weight", payload.weight, f"must be 0 with machine.kind={machine.kind}: it has no body"
        )
    if payload.time >= end:
        raise BadInput("payload.time", payload.time, f"must be below {end:g} s, the end of the run")
    for axis, value, hips in zip("xy", (payload.x, payload.y), zip(*machine.hips, strict=True), strict=True):
        if not min(hips) <= value <= max(hips):
            raise BadInput(
                f"payload.{axis}", value, f"must be from {min(hips):g} to {max(hips):g} m, between the hips"
            )
