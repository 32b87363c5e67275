"""Ground and load that change during a run, patches and slopes, all unknown to the planner.

``python -m pipelines.terrain`` makes the ground stiffer or loads the body in the middle of a run, and lets machines
walk over patches and slopes, each with a CMAC whose learning lasts and with feedback alone.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from cmacexp.cli.study import main
from cmacexp.study import Criterion, Finding, Request, Results, Study, at_least, at_most, grid
from cmacexp.typing import Array
from pipelines import terrain_views as views
from pipelines.terrain_views import (
    CMAC,
    FEEDBACK,
    INFORMED,
    UNCHANGED,
    WITHIN,
    end_ratio,
    force_metric,
    walked,
)

LEG = ("scenario=one_leg", "reference=aware", "learning.lead=1")
LASTING = ("learning.lead=1", "gait.load_ramp=0.12", "force_control.elasticity=1e-3", "force_control.admittance=1e-3")
"""Settings with which the quadruped learns for hundreds of cycles without drift."""
WALK = ("scenario=quadruped", *LASTING)
CYCLE_TIME = 3.0
"""T of both scenarios, s."""
CHANGED, QUICK_CHANGED = (40, 100), (12, 24)
"""Cycles before the change, and in all."""
FACTOR, PAYLOAD, AHEAD = 3, 10, 0.1
"""Step of the ground's stiffness, weight of the payload, N, and how far ahead of the centre it may lie, m."""
STEP = (f"terrain.step_factor={FACTOR}", "terrain.step_time={}")
LOAD = (f"payload.weight={PAYLOAD}", "payload.time={}")


class Change(NamedTuple):
    """Something that happens to a machine."""

    words: str
    machine: tuple[str, ...]
    happens: tuple[str, ...]
    """With ``{}`` in the place of its time, s."""
    known: tuple[str, ...] = ()
    """What makes it so from the start, and known to the plan."""


STIFFER = f"ground {FACTOR} times as stiff"
CHANGES: Mapping[str, Change] = {
    "leg": Change(f"one leg, {STIFFER}", LEG, STEP, (f"terrain.stiffness={FACTOR * 10}",)),
    "stiff": Change(STIFFER, WALK, STEP, (f"terrain.stiffness={FACTOR * 1e4}",)),
    "payload": Change(f"{PAYLOAD} N on the centre", WALK, LOAD, (f"machine.weight={PAYLOAD + 40}",)),
    "ahead": Change(f"{PAYLOAD} N {AHEAD:g} m ahead", WALK, (*LOAD, f"payload.x={AHEAD}")),
}
WORDS = {name: change.words for name, change in CHANGES.items()}
CYCLES, QUICK_CYCLES = 60, 15
SPREADS, SLOPES = (0.0, 0.2, 0.4, 0.6, 0.8), (-0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2)
PATCHES = ("terrain.patch_size=0.15", "terrain.patch_seed=${seed}")
START, QUICK_START = 10.0, 2.0
"""Where a slope begins, m."""
TILT = 0.05
"""Largest tilt, rad, at which a body counts as level."""
WHOLE = 0.9
"""Share of the planned time from which a walk counts as completed."""


def _changes(quick: bool) -> list[Request]:
    """Each change with a CMAC and with feedback alone; without it; and with a plan that knows of it."""
    before, cycles = QUICK_CHANGED if quick else CHANGED
    found = []
    for name, change in CHANGES.items():
        happens = tuple(text.format(before * CYCLE_TIME) for text in change.happens)
        learning = {CMAC: happens, UNCHANGED: ()} | ({INFORMED: change.known} if change.known else {})
        common = (*change.machine, f"cycles={cycles}", "record.cycles=[1]")
        found += grid(*common, over={"walk": learning}, seeded=True, change=name)
        found += grid(*common, *happens, "feedforward=none", change=name, walk=FEEDBACK)
    return found


def _grounds(quick: bool) -> list[Request]:
    """Patches, which every seed draws anew, and slopes up and down."""
    spreads, slopes = (SPREADS[::2], SLOPES[2:7:2]) if quick else (SPREADS, SLOPES)
    common = (*WALK, f"cycles={QUICK_CYCLES if quick else CYCLES}", "record.cycles=[1]")
    found = []
    for walk, feedforward in {CMAC: "feedforward=cmac", FEEDBACK: "feedforward=none"}.items():
        over = {"terrain.patch_spread": spreads}
        found += grid(*common, *PATCHES, feedforward, over=over, seeded=True, ground="patches", walk=walk)
        for slope in slopes:
            start = (f"terrain.slope_start={QUICK_START if quick else START}",) if slope else ()
            own = (*common, feedforward, f"terrain.slope={slope}", *start)
            found += grid(*own, seeded=walk == CMAC, ground="slopes", walk=walk)
    return found


def runs(quick: bool) -> list[Request]:
    """Changes, patches and slopes."""
    return _changes(quick) + _grounds(quick)


def _decide(topic: str, yes: str, no: str, *criteria: Criterion) -> Finding:
    """A finding whether ``topic`` is so."""
    return Finding(criteria, yes, no, f"The runs do not decide whether {topic} (measured: {{value}}).")


def _ratio(change: str, metric: str, other: str, holds: Any) -> Criterion:
    """An error at the end of the walk with a CMAC over that of another walk; the force error is called ``force``."""

    def sample(results: Results) -> Array:
        return end_ratio(results, force_metric(results) if metric == "force" else metric, other)

    words = {"force": "force error", "transfer_rmse_y": "transfer error in y"}[metric]
    return Criterion(f"{WORDS[change]}: {words} over that of “{other}”", sample, holds, of={"change": change})


def _comes_back(change: str, metric: str, words: str) -> Finding:
    return _decide(
        f"learning brings the {words} back",
        f"Learning brings the {words} back: at the end it is {{value}} times that without the change.",
        f"Learning does not bring the {words} back: at the end it is {{value}} times that without the change.",
        _ratio(change, metric, UNCHANGED, at_most(WITHIN)),
    )


def _informed(change: str) -> Finding:
    return _decide(
        "the plan has to know the new value",
        "Give the plan the new value: if it does not know it, the force error is {value} times as large.",
        "The plan need not know the new value: if it does not, the force error is {value} times as large.",
        _ratio(change, "force", INFORMED, at_least(WITHIN)),
    )


def _level(slope: float, way: str) -> Finding:
    text, of = f"{100 * abs(slope):g} % {way}", {"ground": "slopes", "terrain.slope": slope, "walk": CMAC}
    tilt = Criterion(f"tilt, {text}", lambda r: r.end("tilt_max"), at_most(TILT), unit="mrad", scale=1e3, of=of)
    return _decide(
        f"a CMAC keeps the body level at {text}",
        f"With a CMAC and a plan for flat ground the body stays level at {text}: it tilts by {{value}}.",
        f"With a CMAC and a plan for flat ground the body does not stay level at {text}: it tilts by {{value}}.",
        tilt,
    )


def _ends_early(slope: float, way: str) -> Finding:
    text, of = f"{100 * abs(slope):g} % {way}", {"ground": "slopes", "terrain.slope": slope}
    shares = [
        Criterion(
            f"planned time walked, {walk}", lambda r: r.measure("walked"), holds, unit="%", scale=100.0,
            of={**of, "walk": walk},
        )
        for walk, holds in ((CMAC, at_most(WHOLE)), (FEEDBACK, at_least(WHOLE)))
    ]  # fmt: skip
    return _decide(
        f"learning ends a walk at {text} that feedback alone completes",
        f"At {text} learning ends a walk that feedback alone completes: it lasts {{value}} of the planned time.",
        f"At {text} learning does not end a walk that feedback alone completes: {{value}} of the planned time is "
        "walked with a CMAC, {values[1]} with feedback alone.",
        *shares,
    )


def _over_even(results: Results) -> Array:
    """(seeds,): force error on the widest patches over that on even ground."""
    wide, even = (results.select({"terrain.patch_spread": spread}) for spread in (SPREADS[-1], 0.0))
    ratio: Array = wide.end("force_rmse_cycle") / even.end("force_rmse_cycle")
    return ratio


def _over_feedback(results: Results) -> Array:
    """(seeds,): force error on the widest patches over that of feedback alone on the same ground."""
    return end_ratio(results.select({"terrain.patch_spread": SPREADS[-1]}), "force_rmse_cycle", FEEDBACK)


WIDEST, ON_PATCHES = f"patches with a spread of {SPREADS[-1]:g}", {"ground": "patches"}
FINDINGS = {
    **{f"{name}_force": _comes_back(name, "force", "force error") for name in CHANGES},
    **{f"{name}_path": _comes_back(name, "transfer_rmse_y", "path error") for name in CHANGES},
    **{f"{name}_informed": _informed(name) for name, change in CHANGES.items() if change.known},
    "feedback": _decide(
        "learning leaves a smaller force error than feedback alone after each of these changes",
        "After each of these changes learning leaves a smaller force error than feedback alone.",
        "Learning does not leave a smaller force error than feedback alone after each of these changes.",
        *(_ratio(name, "force", FEEDBACK, at_most(1.0)) for name in CHANGES),
    ),
    "patches_feedback": _decide(
        f"learning lowers the force error on {WIDEST}",
        f"On {WIDEST}, which the plan does not know, learning lowers the force error: it is {{value}} times that of "
        "feedback alone.",
        f"On {WIDEST}, which the plan does not know, learning does not lower the force error: it is {{value}} times "
        "that of feedback alone.",
        Criterion("force error over that of feedback alone", _over_feedback, at_most(1.0), of=ON_PATCHES),
    ),
    "patches_even": _decide(
        f"{WIDEST} cost learning accuracy",
        f"With learning, {WIDEST} cost little accuracy: the force error is {{value}} times that on even ground.",
        f"With learning, {WIDEST} cost accuracy: the force error is {{value}} times that on even ground.",
        Criterion(
            "force error over that on even ground", _over_even, at_most(WITHIN), of={**ON_PATCHES, "walk": CMAC}
        ),
    ),
    "uphill_level": _level(0.05, "uphill"),
    "downhill_level": _level(-0.05, "downhill"),
    "uphill_end": _ends_early(0.2, "uphill"),
    "downhill_end": _ends_early(-0.2, "downhill"),
}


def values(results: Results) -> dict[str, Any]:
    """Settings that the page names."""
    changed, slopes = results.select(change="stiff"), results.select(ground="slopes")
    return {
        "change": views.change_cycle(changed.select(walk=CMAC)),
        "cycles": changed.value("cycles"),
        "factor": FACTOR,
        "payload": PAYLOAD,
        "ahead": AHEAD,
        "within": WITHIN,
        "leg_settings": ", ".join(f"`{text}`" for text in LEG[1:]),
        "lasting": ", ".join(f"`{text}`" for text in LASTING),
        "patch": results.select(ground="patches").value("terrain.patch_size"),
        "start": max(slopes.values("terrain.slope_start")),
        "ground_cycles": slopes.value("cycles"),
        "tilt": 1e3 * TILT,
    }


STUDY = Study(
    title="Ground and load that change",
    question="How does learning cope with a step of the ground's stiffness, a payload, patches and slopes that "
    "neither planner nor controller knows?",
    runs=runs,
    measures={"walked": walked},
    findings=FINDINGS,
    figures={
        "leg": views.draw_leg,
        "walk": lambda r: views.draw_walk(r, {name: words for name, words in WORDS.items() if name != "leg"}),
        "patches": lambda r: views.draw_ground(r, "patches", "terrain.patch_spread", "spread of the patches"),
        "slopes": lambda r: views.draw_ground(r, "slopes", "terrain.slope", "slope, m/m", TILT),
    },
    tables={
        "changes": lambda r: views.table_changes(r, WORDS),
        "patches": lambda r: views.table_ground(r, "patches", "terrain.patch_spread", "spread"),
        "slopes": lambda r: views.table_ground(r, "slopes", "terrain.slope", "slope"),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
