"""The walks of the study of a body with mass."""

from cmacexp.plants.mujoco_engine import load_mujoco
from cmacexp.study import Request, grid
from cmacexp.study.requests import Values

WALK = ("scenario=quadruped", "plant=mujoco_quadruped")
CHANGES: dict[str, tuple[str, ...]] = {
    "posture rate term": ("posture.rate_gain=0",),
    "force-feedback gain": ("force_control.elasticity=1e-4", "force_control.admittance=1e-4"),
    "learning rate": ("learning.rate=0.05",),
    "load sharing": ("force_control.load_sharing=static",),
    "smooth, low swing": ("gait.vertical=cubic", "gait.lift=0.1"),
    "load ramp": ("gait.load_ramp=0", "gait.touch_down=null"),
    "ground damping": ("terrain.damping=0",),
    "lead": ("learning.lead=0",),
}
"""What takes each change of ``conf/for_plant/mujoco_quadruped.yaml`` back, in the order in which they are made."""
NAMES = list(CHANGES)
NAMED = {name: name for name in NAMES} | {
    "force-feedback gain": "higher force-feedback gain", "learning rate": "higher learning rate",
    "load sharing": "dynamic load sharing", "lead": "lead of one sample",
}  # fmt: skip
"""What each change is called in a sentence."""
PAPERS_RATE, DAMPED = "learning.rate=0.1953125", "terrain.damping=50"
PAPERS = ("sampling_period=0.005", "controller.lead_alpha=10", PAPERS_RATE)
PUBLISHED, FINER, SAMPLING, COMPENSATOR = (
    "as published",
    "feedback alone, finer steps",
    "sampled faster",
    "weaker LEAD",
)
"""Walks with the paper's constants, or all but one of them, by the label ``variant``."""
CMAC, FEEDBACK = "CMAC", "feedback alone"
FIXED: dict[str, tuple[str, ...]] = {
    FEEDBACK: ("feedforward=none",),
    FINER: ("feedforward=none", "plant.substeps=20"),
    "exact inverse dynamics": ("feedforward=inverse_dynamics",),
}
"""Variants without anything that a seed decides."""
LEARNING: dict[str, tuple[str, ...]] = {
    PUBLISHED: (),
    "lead of one sample": ("learning.lead=1",),
    "lower learning rate": ("learning.rate=0.05",),
    "damped ground": (DAMPED,),
    SAMPLING: ("sampling_period=0.002",),
    COMPENSATOR: ("controller.lead_alpha=3",),
}
FEEDFORWARD = [name for name in (*FIXED, *LEARNING) if name not in (FEEDBACK, FINER, SAMPLING, COMPENSATOR)]
"""Those with a feedforward and the paper's sampling and compensator."""
FASTER: dict[str, tuple[str, ...]] = {
    "the paper's rate": (PAPERS_RATE,), "the paper's rate, damped ground": (PAPERS_RATE, DAMPED)
}  # fmt: skip
"""Ways to learn faster without the changes."""
NONE, ALL = "none of the changes", "all changes"
COMPARED, QUICK_COMPARED, SETTLED = 20, 6, 3
"""Cycles of a walk that learns, and of feedback alone, which repeats itself from its second cycle on."""
STARTS, LONG, QUICK_LONG = 10, 100, 8
LEADLESS = [0, 1, 2]
"""Starts that also walk without lead."""
SPREAD = 0.02
"""How far joint angles start from the plan, rad."""
LEADS = {"with lead": (), "without lead": CHANGES["lead"]}


def without(name: str) -> str:
    """The walk with all changes but one."""
    return f"without {name}"


def _taken_back(names: list[str]) -> tuple[str, ...]:
    return tuple(text for name in names for text in CHANGES[name])


def _pair(part: str, walk: str, off: list[str], cycles: int) -> list[Request]:
    """A walk in which the changes ``off`` are taken back, with a CMAC, and feedback alone on the same plan."""
    texts = _taken_back(off)
    learning = (*WALK, *texts, f"cycles={cycles}", f"record.cycles=[{cycles}]")
    plan = [text for text in texts if not text.startswith("learning.")]
    alone = (*WALK, *plan, "feedforward=none", f"cycles={SETTLED}", f"record.cycles=[{SETTLED}]")
    learnt = grid(*learning, seeded=True, part=part, walk=walk, feedforward=CMAC)
    return learnt + grid(*alone, part=part, walk=walk, feedforward=FEEDBACK)


def _published(cycles: int, quick: bool) -> list[Request]:
    common = (*WALK, *_taken_back(NAMES), *PAPERS, f"cycles={cycles}", f"record.cycles=[{cycles}]")
    references = ["aware"] if quick else ["literal", "aware"]
    found = []
    for variants, seeded in ((FIXED, False), (LEARNING, True)):
        chosen = dict(list(variants.items())[:1]) if quick else variants
        over: Values = {"reference": references, "variant": chosen}
        found += grid(*common, over=over, seeded=seeded, part="published")
    return found


def _ladder(cycles: int, quick: bool) -> list[Request]:
    """The changes made one after the other, and left out one at a time."""
    made, left_out = (NAMES[:1], NAMES[:1]) if quick else (NAMES, NAMES)
    found = _pair("made", NONE, NAMES, cycles)
    for count, name in enumerate(made, 1):
        found += _pair("made", f"+ {name}", NAMES[count:], cycles)
    found += _pair("left out", ALL, [], cycles)
    for name in left_out:
        found += _pair("left out", without(name), [name], cycles)
    common = (*WALK, *_taken_back(NAMES), f"cycles={cycles}", f"record.cycles=[{cycles}]")
    return found + grid(*common, over={"walk": FASTER}, seeded=True, part="faster", feedforward=CMAC)


def _starts(cycles: int, quick: bool) -> list[Request]:
    """Disturbed starts, each with a hash of its own; some of them without lead too."""
    common = (*WALK, f"plant.start_spread={SPREAD}", f"cycles={cycles}", f"record.cycles=[{cycles}]")
    found = []
    for (walk, texts), numbers in zip(LEADS.items(), (range(STARTS), LEADLESS), strict=True):
        starts = {str(n): (f"plant.start_seed={n}", f"seed={n}") for n in (numbers[:1] if quick else numbers)}
        found += grid(*common, *texts, over={"start": starts}, part="starts", walk=walk)
    return found


def runs(quick: bool) -> list[Request]:
    """The paper's constants; the changes; the disturbed starts."""
    load_mujoco()
    cycles = QUICK_COMPARED if quick else COMPARED
    return _published(cycles, quick) + _ladder(cycles, quick) + _starts(QUICK_LONG if quick else LONG, quick)
