"""What the study of robots that move runs: gaits, worlds that planners do not know, and another speed."""

from dataclasses import replace
from typing import Any

from cmacexp.study import Request, grid, starting_from
from pipelines.robots_runs import ALONE, BOTH, CMAC, QUICK, SETTLED, START, require_robots, walks

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
LEARNT, LASTED = 50, 300
"""Cycles of walks with a CMAC, and of those that must last."""
LASTING = (TROT, LAG, LATE)
BUILT = range(16)
"""Seeds of the Go2 as built, more than of others: by feedback only it falls from many starts."""
NETWORKS = {"joint angles and velocities": ("cmac=quadruped",), "phase": ("cmac=phase",)}
"""What addresses the network whose weights are carried to another speed."""
MOVING = ("gait=trot", "gait.cycle_time=0.4", "plant.start_moving=true")
SLOW, FASTER = "gait.speed=0.3", "gait.speed=0.4"
"""Speeds before and after."""
SOON = 6
"""Cycle by which the plan has followed a load."""


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
    found = []
    for gait, texts in GAITS.items() if not quick else [(TROT, GAITS[TROT])]:
        over: dict[str, Any] = {"sensors": SENSORS, "ground": GROUNDS} if not quick else {"ground": {"elastic": ()}}
        for kind, feedforward in BOTH.items():
            own: dict[str, Any] = {"part": GAIT, "gait": gait, "kind": kind}
            found += walks(_length(kind, gait, quick), *feedforward, *texts, over=over, **own)
    for world, texts in WORLDS.items() if not quick else [(GO2, WORLDS[GO2])]:
        over = {"ground": GROUNDS if not quick and world != SLOPE else {"elastic": ()}}
        more = {"seed": BUILT[: QUICK if quick else None]} if world == GO2 else {}
        for kind in KINDS if world == GO2 else BOTH:
            own = {"part": WORLD, "world": world, "kind": kind, "seeded": world != GO2}
            found += walks(_length(kind, world, quick), *KINDS[kind], *texts, over=over | more, **own)
    return found + _carried(quick)
