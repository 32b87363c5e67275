"""The paper's walk with a body that has mass: the quadruped in MuJoCo, with friction under its feet.

``python -m pipelines.dynamic_body`` (some minutes on two cores; needs the extra ``mujoco``). Lin & Song 1997 balance
the body in every instant. What this claims of a body that floats: the paper's constants fall; sampled faster, with
less LEAD and the desired force as feedforward, it learns positions, but its forces get worse; and which changes, only
together, make force tracking better too.
"""

from collections.abc import Sequence

from cmacexp.plants.mujoco_engine import load_mujoco
from cmacexp.report.page import Section
from pipelines.analysis.dynamic_body_sections import falls_section, ladder_section, starts_section, walks_section
from pipelines.analysis.dynamic_body_words import ALL, BASE, LATE, PAPER, START, alone, first, plain, without
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

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
"""What takes each change back, in the order in which the ladder makes them."""
PAPERS_RATE, DAMPED = "learning.rate=0.1953125", "terrain.damping=50"
PAPERS = ("sampling_period=0.005", "controller.lead_alpha=10", PAPERS_RATE)
VARIANTS: dict[str, tuple[str, ...]] = {
    "feedback alone": ("feedforward=none",),
    "feedback alone, but integrated 20 times finer": ("feedforward=none", "plant.substeps=20"),
    "as published": (),
    "lead 1": ("learning.lead=1",),
    "a quarter of the rate": ("learning.rate=0.05",),
    "exact inverse dynamics": ("feedforward=inverse_dynamics",),
    "as published, damped ground": (DAMPED,),
    "but sampled at 2 ms": ("sampling_period=0.002",),
    "but LEAD 10/3": ("controller.lead_alpha=3",),
}
"""Ways to learn, and less than all of what lets it walk, with the constants of the paper."""
PLAIN: dict[str, tuple[str, ...]] = {
    "feedback alone": ("feedforward=none",),
    "a quarter of the paper's rate": (),
    "the paper's rate": (PAPERS_RATE,),
    "the paper's rate, damped ground": (PAPERS_RATE, DAMPED),
}
"""Ways to learn without the changes."""
STARTS, LONG = 10, 100
COMPARED, SETTLED = 20, 3
"""Cycles of a run that learns, and of feedback alone, which repeats itself from its second cycle on."""
SPREAD = 0.02
"""How far joint angles start from the plan, rad: the foot is up to 14 mm off, the ground pressed in by 3 mm."""


def _with(chosen: Sequence[str], *more: str) -> list[str]:
    """Overrides ``chosen``, but for what ``more`` sets."""
    given = {text.partition("=")[0] for text in more}
    return [*(text for text in chosen if text.partition("=")[0] not in given), *more]


def _run(off: Sequence[str], *more: str, cycles: int, thin: bool = True) -> list[str]:
    """A walk in which the changes ``off`` are taken back; thinned, its trace keeps the last cycle alone."""
    kept = [f"record.cycles=[{cycles}]"] if thin else []
    return [*WALK, *_with([text for name in off for text in CHANGES[name]], *more), f"cycles={cycles}", *kept]


def _both(name: str, off: Sequence[str], cycles: int) -> dict[str, list[str]]:
    """A walk that learns, and feedback alone on the same plan; what changes only the learning is then left out."""
    felt = [each for each in off if not CHANGES[each][0].startswith("learning.")]
    return {name: _run(off, cycles=cycles), alone(name): _run(felt, "feedforward=none", cycles=SETTLED)}


def _without_changes(names: Sequence[str], cycles: int, quick: bool) -> dict[str, list[str]]:
    """The paper's constants with every way to learn; then those with which it walks, but no more changes."""
    runs = {}
    for reference in ("aware",) if quick else ("literal", "aware"):
        for variant, more in VARIANTS.items():
            if not quick or variant in ("feedback alone", "as published"):
                own = _with(PAPERS, f"reference={reference}", *more)
                runs[f"{PAPER}, {reference}, {variant}"] = _run(names, *own, cycles=cycles, thin=False)
    return runs | {plain(name): _run(names, *more, cycles=cycles, thin=False) for name, more in PLAIN.items()}


def jobs(quick: bool) -> Jobs:
    """The paper's constants; the ladder up, and without one rung; the disturbed starts."""
    load_mujoco()
    names, cycles = list(CHANGES), 6 if quick else COMPARED
    runs = _without_changes(names, cycles, quick)
    runs |= _both(BASE, names, cycles)
    for count in range(1, len(names)):
        if not quick or count == 1:
            runs |= _both(first(names[:count]), names[count:], cycles)
    runs |= _both(ALL, [], cycles)
    for name in names[:1] if quick else names:
        runs |= _both(without(name), [name], cycles)
    long = 8 if quick else LONG
    for seed in range(2 if quick else STARTS):
        start = (f"plant.start_spread={SPREAD}", f"plant.start_seed={seed}")
        runs[f"{START} {seed}"] = [*WALK, *start, f"cycles={long}", f"record.cycles=[{cycles},{long}]"]
    runs[LATE] = [*WALK, *CHANGES["lead"], f"cycles={long}", f"record.cycles=[{cycles},{long}]"]
    return runs


def summarise(runs: Runs) -> list[Section]:
    """That it falls, that it walks, what makes its forces better, and whether that lasts."""
    return [falls_section(runs), walks_section(runs), ladder_section(runs, list(CHANGES)), starts_section(runs)]


PURPOSE = (
    "The quadruped in MuJoCo with a body of 1 kg that floats: the paper's constants fall; which changes let it walk, "
    "and which let learning improve its forces as well as its positions."
)
STUDY = Study("dynamic_body", "A body with mass", PURPOSE, jobs, summarise)

if __name__ == "__main__":
    main(STUDY)
