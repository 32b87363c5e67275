"""What the study of robots that move runs: gaits, worlds that planners do not know, and another speed."""

from dataclasses import replace
from typing import Any

from cmacexp.study import Request, grid, starting_from
from pipelines.robots_runs import ALONE, BOTH, CMAC, START, require_robots

MODEL, FIXED = "nominal model", "CMAC, load as modelled"
KINDS = {
    **BOTH,
    MODEL: ("feedforward=inverse_dynamics",),
    FIXED: ("feedforward=cmac", "force_control.load_sharing=dynamic"),
}
GAITS = {
    "wave 0.075 m/s": ("gait=wave",),
    "walk 0.2 m/s": ("gait=walk", "gait.speed=0.2"),
    "trot 0.4 m/s": ("gait=trot", "gait.speed=0.4"),
    "trot 0.8 m/s": ("gait=trot", "gait.speed=0.8"),
    "amble 0.4 m/s": ("gait=amble", "gait.speed=0.4"),
    "pace 0.4 m/s": ("gait=pace", "gait.speed=0.4"),
}
TROT, FAST = "trot 0.4 m/s", "trot 0.8 m/s"
PERFECT = "perfect"
SENSORS = {PERFECT: (), "encoders": ("sensors=encoders",)}
GROUNDS = {"elastic": (), "rigid": ("plant=mujoco_robot_rigid",)}
AS_BUILT = ("machine=go2", "plant/as_built=go2", "plant.friction=0.786")
WORLDS = {
    "as modelled": ("machine=go1",),
    "payload of 20 %": ("machine=go1", "payload.weight=25"),
    "slope of 5 %": ("machine=go1", "terrain.slope=0.05", "terrain.slope_start=0.2"),
    "Go2 as built": AS_BUILT,
    "Go2 as built, lag": (*AS_BUILT, "actuator=go2"),
    "a sample late": ("machine=go1", "actuator.delay=1"),
    "trot, push of 90 N": ("machine=go1", *GAITS[TROT], "plant.push=90", "plant.push_time=3"),
}
AS_MODELLED, PAYLOAD, SLOPE, GO2, LAG, LATE, PUSH = WORLDS
ON_PATH, OFF_PATH = "on their paths", "disturbed"
STARTS = {ON_PATH: (), OFF_PATH: START}
GAIT, WORLD, BEFORE, ANEW, CARRIED = "gaits", "worlds", "before", "anew", "carried"
"""The parts of the study."""
QUICK, SETTLED, LEARNT, LASTED = 2, 12, 50, 300
"""Cycles of the quick form, of what learns nothing, of walks with a CMAC, and of those that must last."""
LASTING = (TROT, LAG, LATE)
NETWORKS = {"joint angles and velocities": ("cmac=quadruped",), "phase": ("cmac=phase",)}
"""What addresses the network whose weights are carried to another speed."""
MOVING = ("gait=trot", "gait.cycle_time=0.4", "plant.start_moving=true")
SLOW, FASTER = "gait.speed=0.3", "gait.speed=0.4"
"""Speeds before and after."""
SOON = 6
"""Cycle by which the plan has followed a load."""


def _walks(kind: str, lasts: int, *overrides: str, **more: Any) -> list[Request]:
    kept = (f"cycles={lasts}", f"record.cycles=[{lasts}]", *START)
    return grid("scenario=robot", *kept, *KINDS[kind], *overrides, seeded=True, kind=kind, **more)


def _length(kind: str, name: str, quick: bool) -> int:
    if quick:
        return QUICK
    return SETTLED if kind in (ALONE, MODEL) else LASTED if name in LASTING else LEARNT


def _carried(quick: bool) -> list[Request]:
    """Trots at another speed, anew and from the weights of the first one."""
    cycles = QUICK if quick else SOON
    over: dict[str, Any] = {"network": NETWORKS, "ground": GROUNDS, "start": STARTS}
    learns = [*KINDS[CMAC], *MOVING]
    before = grid(
        "scenario=robot",
        *learns,
        SLOW,
        f"cycles={QUICK if quick else LEARNT}",
        "record.weights=true",
        "record=trace",
        over=over,
        seeded=True,
        part=BEFORE,
    )
    anew, after = (
        grid("scenario=robot", *learns, FASTER, f"cycles={cycles}", over=over, seeded=True, part=part)
        for part in (ANEW, CARRIED)
    )
    sources = [replace(request, labels={name: request.labels[name] for name in over}) for request in before]
    return [*before, *anew, *starting_from(sources, after)]


def runs(quick: bool) -> list[Request]:
    """All walks; the quick form is of a trot and of one world, two cycles each; raises as :func:`require_robots`."""
    require_robots()
    walks = []
    for gait, texts in GAITS.items() if not quick else [(TROT, GAITS[TROT])]:
        for kind in BOTH:
            over: dict[str, Any] = (
                {"sensors": SENSORS, "ground": GROUNDS} if not quick else {"ground": {"elastic": ()}}
            )
            walks += _walks(kind, _length(kind, gait, quick), *texts, over=over, part=GAIT, gait=gait)
    for world, texts in WORLDS.items() if not quick else [(GO2, WORLDS[GO2])]:
        for kind in KINDS if world == GO2 else BOTH:
            over = {"ground": GROUNDS if not quick and world != SLOPE else {"elastic": ()}}
            walks += _walks(kind, _length(kind, world, quick), *texts, over=over, part=WORLD, world=world)
    return walks + _carried(quick)
