"""What the study of robots runs: five robots with every feedforward, and what is changed or left out."""

from typing import Any

from cmacexp.models.robot import load_mujoco
from cmacexp.models.robot_file import find_model
from cmacexp.study import Request, grid

ALONE, EXACT, HEAVY = "feedback only", "nominal model", "model 20 % too heavy"
CMAC, ON_MODEL, ILC, RBF = "CMAC", "CMAC on that model", "ILC", "RBF"
ALONE_LIGHT, CMAC_LIGHT = "feedback only, lighter robot", "CMAC, lighter robot"
LIGHTER = tuple(f"plant.as_built.{name}_factor={1 / 1.2:.4f}" for name in ("trunk_mass", "trunk_inertia", "leg_mass"))
"""A robot whose trunk, thighs and calves weigh 20 % more in model, plan and gains than in the plant."""
FEEDFORWARDS, STARTS, OTHERS, GROUND, LEFT_OUT = "feedforwards", "starts", "others", "ground", "left out"
LEAD, PLANAR = "lead", "planar"
"""The parts of the study."""
WITH_LEAD, WITHOUT_LEAD = "lead of one sample", "no lead"
ROBOTS = {
    "Go1": ("machine=go1",),
    "Go2": ("machine=go2",),
    "Aliengo": ("machine=aliengo",),
    "Mini Cheetah": ("machine=mini_cheetah",),
    "HyQReal1": ("machine=hyqreal1",),
}
FURTHER = {
    "Spot": ("machine=spot",),
    "A2": ("machine=a2",),
    "B2": ("machine=b2",),
    "HyQReal2": ("machine=hyqreal2",),
    "Pegasus": ("machine=pegasus",),
}
"""Robots that walk with the rule as well."""
TRIED = "Go1"
"""The robot that loses parts of the method."""
MODELS = {
    ALONE: ("feedforward=none",),
    EXACT: ("feedforward=inverse_dynamics",),
    ALONE_LIGHT: ("feedforward=none", *LIGHTER),
    HEAVY: ("feedforward=inverse_dynamics", *LIGHTER),
}
"""What learns nothing."""
LEARNERS = {
    CMAC: ("feedforward=cmac",),
    CMAC_LIGHT: ("feedforward=cmac", *LIGHTER),
    ON_MODEL: ("feedforward=cmac_on_model", *LIGHTER),
    ILC: ("feedforward=ilc",),
    RBF: ("feedforward=rbf",),
}
BOTH = {ALONE: MODELS[ALONE], CMAC: LEARNERS[CMAC]}
POSTURE_RATE = "posture rate"
WITHOUT = {
    POSTURE_RATE: ("posture.rate_gain=0",),
    "load ramps": ("gait.load_ramp=0", "gait.unload_ramp=0"),
    "time between touch-down and lift-off": ("gait.touch_down=null",),
    "rate of the load": ("force_control.load_rate=false",),
    "inertia in the load sharing": ("force_control.load_sharing=static",),
    "force feedback": ("force_control.elasticity=0", "force_control.admittance=0"),
    "ground damping": ("terrain.damping=0",),
    "LEAD compensator": ("controller.lead_alpha=1",),
}
"""What takes each part of the method away."""
BY_RULE, SHORT = "period by rule", "period of 1 ms"
PERIODS = {BY_RULE: (), SHORT: ("sampling_period=0.001",)}
"""Sampling periods of the disturbed walks."""
LEADS = {WITH_LEAD: (), WITHOUT_LEAD: ("learning.lead=0",)}
START = ("plant.start_spread=0.05", "plant.start_seed=${seed}")
"""A disturbed walk: every joint starts up to 0.05 rad off the plan; seeds differ in that and in the hash."""
SETTLED = 12
"""Cycles of feedforwards that learn nothing: by then their walks repeat themselves, from whichever start."""
QUICK = 2
"""Cycles of every walk of the quick form; learning begins in the second."""
EARLY, JUDGED, LONG = 20, 50, 100
"""Cycles in which learners are compared, early and late, and of the walks with a CMAC, which must last."""
TRIED_FOR, DRIFTED = 25, 200
"""Cycles of walks without a part of the method, and of those that show what lead is for."""


def walks(cycles: int, *overrides: str, seeded: bool = True, **more: Any) -> list[Request]:
    """Walks of robots, each from disturbed starts, one for each seed; the trace of the last cycle is kept."""
    kept = (f"cycles={cycles}", f"record.cycles=[{cycles}]")
    return grid("scenario=robot", *kept, *START, *overrides, seeded=seeded, **more)


def _with_feedforwards(quick: bool) -> list[Request]:
    """The first robots with every feedforward, and with a CMAC for longer, sampled in two ways."""
    robots, kinds = ({TRIED: ROBOTS[TRIED]}, BOTH) if quick else (ROBOTS, MODELS | LEARNERS)
    found = []
    for period, texts in PERIODS.items():
        cycles, chosen = QUICK if quick else LONG, dict[str, Any](part=STARTS, period=period)
        found += walks(cycles, *LEARNERS[CMAC], *texts, over={"robot": robots}, **chosen)
    for kind, texts in kinds.items():
        cycles = QUICK if quick else JUDGED if kind in LEARNERS else SETTLED
        found += walks(cycles, *texts, over={"robot": robots}, part=FEEDFORWARDS, kind=kind)
    return found


def _elsewhere(quick: bool) -> list[Request]:
    """Feedback only and a CMAC on the rigid floor, and on the further robots."""
    tried = {TRIED: ROBOTS[TRIED]}
    found = []
    for part, robots, texts, cycles in (
        (GROUND, ROBOTS, ("plant=mujoco_robot_rigid",), JUDGED),
        (OTHERS, FURTHER, (), EARLY),
    ):
        for kind, feedforward in BOTH.items():
            lasts = QUICK if quick else cycles if kind == CMAC else SETTLED
            over = {"robot": tried if quick else robots}
            found += walks(lasts, *feedforward, *texts, over=over, part=part, kind=kind)
    return found


def require_robots() -> None:
    """Require MuJoCo and the models.

    Raises:
        BadInput: they are not installed; says how to install them.
    """
    load_mujoco()
    find_model("go1", None)


def runs(quick: bool) -> list[Request]:
    """All walks; the quick form is of one robot, two cycles each; raises as :func:`require_robots`."""
    require_robots()
    tried, trial = {TRIED: ROBOTS[TRIED]}, LEARNERS[CMAC]
    early, tried_for, drifted = [QUICK] * 3 if quick else [EARLY, TRIED_FOR, DRIFTED]
    without = {POSTURE_RATE: WITHOUT[POSTURE_RATE]} if quick else WITHOUT
    rates = {"force_control.load_rate": ["false", "true"]}
    planar = ("scenario=quadruped", "gait.load_ramp=0.12", f"cycles={early}", f"record.cycles=[{early}]")
    return [
        *_with_feedforwards(quick),
        *_elsewhere(quick),
        *walks(tried_for, *trial, over={"robot": tried, "without": without}, part=LEFT_OUT),
        *walks(drifted, *trial, over={"robot": tried, "lead": LEADS}, part=LEAD),
        *grid(*planar, over=rates, seeded=True, part=PLANAR),
    ]
