"""Ground and load that change during a run, patches and slopes, all unknown to the planner.

``python -m pipelines.terrain`` makes the ground stiffer or loads the body in the middle of a run, and lets machines
walk over patches and slopes, each with a CMAC whose learning lasts and with feedback only.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from cmacexp.commands.study import main
from cmacexp.study import Criterion, Finding, Request, Results, Study, at_least, at_most, draw, grid
from cmacexp.study.curves import over_cycles, over_setting
from cmacexp.study.samples import ratio
from cmacexp.study.statements import Limit
from pipelines.common_results import percent, share_of_time

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEG = ("scenario=one_leg", "reference=aware", "learning.lead=1")
LASTING = ("learning.lead=1", "gait.load_ramp=0.12", "force_control.elasticity=1e-3", "force_control.admittance=1e-3")
"""Settings with which the quadruped learns for hundreds of cycles without drift."""
WALK = ("scenario=quadruped", *LASTING)
CYCLE_TIME = 3.0
"""T of both scenarios, s."""
FACTOR, PAYLOAD, AHEAD = 3, 10, 0.1
"""Step of the ground's stiffness, weight of the payload, N, and how far ahead of the centre it may lie, m."""
STEP = (f"terrain.step_factor={FACTOR}", "terrain.step_time={}")
LOAD = (f"payload.weight={PAYLOAD}", "payload.time={}")
CMAC, FEEDBACK = "CMAC", "feedback only"
UNCHANGED, INFORMED = "CMAC, no change", "CMAC, plan knows"
"""The walks of a change, by the label ``walk``."""
FORCE, PATH = "force error", "path error"


class Change(NamedTuple):
    """Something that happens to a machine."""

    words: str
    machine: tuple[str, ...]
    happens: tuple[str, ...]
    """With ``{}`` in the place of its time, s."""
    known: tuple[str, ...] = ()
    """What makes it so from the start, and known to the plan."""
    force: str = "force_rmse_cycle"
    """The force error: of one leg that in support."""

    @property
    def title(self) -> str:
        """At the beginning of a sentence."""
        words = self.words if self.machine == LEG else f"quadruped, {self.words}"
        return words[0].upper() + words[1:]


STIFFER = f"ground {FACTOR} times as stiff"
CHANGES: Mapping[str, Change] = {
    "leg": Change(f"one leg, {STIFFER}", LEG, STEP, (f"terrain.stiffness={FACTOR * 10}",), "force_rmse"),
    "stiff": Change(STIFFER, WALK, STEP, (f"terrain.stiffness={FACTOR * 1e4}",)),
    "payload": Change(f"{PAYLOAD} N on the centre", WALK, LOAD, (f"machine.weight={PAYLOAD + 40}",)),
    "ahead": Change(f"{PAYLOAD} N {AHEAD:g} m ahead", WALK, (*LOAD, f"payload.x={AHEAD}")),
}
SPREADS, SLOPES = (0.0, 0.2, 0.4, 0.6, 0.8), (-0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2)
PATCHES = ("terrain.patch_size=0.15", "terrain.patch_seed=${seed}")
WITHIN = 1.2
"""An error that ends within this factor of a level has come back to it."""
TILT, WHOLE = 0.05, 0.9
"""Largest tilt of a level body, rad; share of the planned time from which a walk counts as completed."""


def _changes(quick: bool) -> list[Request]:
    """Each change with a CMAC and with feedback only; without it; and with a plan that knows of it."""
    before, cycles = (12, 24) if quick else (40, 100)
    found = []
    for name, change in CHANGES.items():
        happens = tuple(text.format(before * CYCLE_TIME) for text in change.happens)
        learning = {CMAC: happens, UNCHANGED: ()} | ({INFORMED: change.known} if change.known else {})
        common = (*change.machine, f"cycles={cycles}", "record.cycles=[1]")
        found += grid(*common, over={"walk": learning}, seeded=True, change=name, before=before)
        found += grid(*common, *happens, "feedforward=none", change=name, before=before, walk=FEEDBACK)
    return found


def _grounds(quick: bool) -> list[Request]:
    """Patches, which every seed draws anew, and slopes up and down."""
    spreads, slopes = (SPREADS[::2], SLOPES[2:7:2]) if quick else (SPREADS, SLOPES)
    common = (*WALK, f"cycles={15 if quick else 60}", "record.cycles=[1]")
    found = []
    for walk, feedforward in {CMAC: "feedforward=cmac", FEEDBACK: "feedforward=none"}.items():
        over = {"terrain.patch_spread": spreads}
        found += grid(*common, *PATCHES, feedforward, over=over, seeded=True, ground="patches", walk=walk)
        for slope in slopes:
            start = (f"terrain.slope_start={2.0 if quick else 10.0}",) if slope else ()
            own = (*common, feedforward, f"terrain.slope={slope}", *start)
            found += grid(*own, seeded=walk == CMAC, ground="slopes", walk=walk)
    return found


def _metric(change: str, error: str) -> str:
    return CHANGES[change].force if error == FORCE else "transfer_rmse_y"


def _over(change: str, error: str, walk: str, holds: Limit) -> Criterion:
    """An error at the end of the walk with a CMAC over that of another walk."""
    sample = ratio(partial(Results.end, name=_metric(change, error)), {"walk": CMAC}, {"walk": walk})
    words = f"{error} at the end over that of “{walk}”"
    return Criterion(words, sample, holds, of={"change": change}, case=CHANGES[change].words)


def _comes_back(change: str, error: str) -> Finding:
    end = f"the {error} ends at {{value}} times that without the change"
    return Finding(
        [_over(change, error, UNCHANGED, at_most(WITHIN))],
        yes=f"{CHANGES[change].title}: learning brings the {error} back; {end}.",
        no=f"{CHANGES[change].title}: {end}; learning does not bring it back.",
    )


def _level(slope: float, where: str) -> Finding:
    of = {"ground": "slopes", "terrain.slope": slope, "walk": CMAC}
    return Finding(
        [Criterion(f"tilt, {where}", lambda r: r.end("tilt_max"), at_most(TILT), unit="mrad", scale=1e3, of=of)],
        yes=f"With a CMAC and a plan for flat ground the body stays level at {where}: it tilts by {{value}}.",
        no=f"With a CMAC and a plan for flat ground the body leans at {where}: it tilts by {{value}}.",
    )


def _ends_early(slope: float, where: str) -> Finding:
    shares = [
        percent("planned time walked", lambda r: r.measure("walked"), holds, case=walk,
                of={"ground": "slopes", "terrain.slope": slope, "walk": walk})
        for walk, holds in ((CMAC, at_most(WHOLE)), (FEEDBACK, at_least(WHOLE)))
    ]  # fmt: skip
    return Finding(
        shares,
        yes=f"At {where} learning ends a walk that feedback only completes.",
        no=f"At {where} either learning completes the walk, or feedback only does not.",
    )


def _on_widest(quantity: str, reference: dict[str, Any], holds: Limit) -> Criterion:
    sample = ratio(partial(Results.end, name="force_rmse_cycle"), WIDEST, reference)
    return Criterion(quantity, sample, holds, of={"ground": "patches", "walk": [CMAC, reference["walk"]]})


WIDEST = {"terrain.patch_spread": SPREADS[-1], "walk": CMAC}
WIDE = f"patches with a spread of {SPREADS[-1]:g}"
FINDINGS = {
    **{f"{change}_force": _comes_back(change, FORCE) for change in CHANGES},
    **{f"{change}_path": _comes_back(change, PATH) for change in CHANGES},
    **{
        f"{name}_informed": Finding(
            [_over(name, FORCE, INFORMED, at_least(WITHIN))],
            yes=f"{change.title}: the plan needs the new value; without it the force error is {{value}} times as "
            "large.",
            no=f"{change.title}: the plan can do without the new value; the force error is then {{value}} times as "
            "large.",
        )
        for name, change in CHANGES.items()
        if change.known
    },
    "feedback": Finding(
        [_over(change, FORCE, FEEDBACK, at_most(1.0)) for change in CHANGES],
        yes="After each of the changes the force error with learning is below that with feedback only.",
        no="After some of the changes the force error with learning is not below that with feedback only.",
    ),
    "patches_feedback": Finding(
        [_on_widest("force error over that with feedback only", {**WIDEST, "walk": FEEDBACK}, at_most(1.0))],
        yes=f"On {WIDE}, which the plan does not know, learning lowers the force error.",
        no=f"On {WIDE}, which the plan does not know, learning leaves the force error as it is, or raises it.",
    ),
    "patches_even": Finding(
        [
            _on_widest(
                "force error over that on even ground", {**WIDEST, "terrain.patch_spread": 0.0}, at_most(WITHIN)
            )
        ],
        yes=f"With learning, {WIDE} cost little accuracy.",
        no=f"With learning, {WIDE} cost accuracy.",
    ),
    "uphill_level": _level(0.05, "5 % uphill"),
    "downhill_level": _level(-0.05, "5 % downhill"),
    "uphill_end": _ends_early(0.2, "20 % uphill"),
    "downhill_end": _ends_early(-0.2, "20 % downhill"),
}


def draw_changes(results: Results) -> "Figure":
    """A row for each change, at the dotted line: force and path error over the cycles."""
    panels = []
    for change in CHANGES:
        own = results.select(change=change)
        for error in (FORCE, PATH):
            panel = over_cycles(own, _metric(change, error), "walk", log="y", title=error)
            title = f"{CHANGES[change].words}: {error}"
            panels.append(replace(panel, title=title, x_limits=[own.value("before") + 0.5]))
    return draw(panels, height=1.9)


def draw_ground(results: Results, ground: str, key: str) -> "Figure":
    """Force error and tilt at the end, and the time walked, over what the ground is like."""
    samples = {
        "force error, N": lambda r: r.end("force_rmse_cycle"),
        "tilt, mrad": lambda r: 1e3 * r.end("tilt_max"),
        "planned time walked, %": lambda r: 100.0 * r.measure("walked"),
    }
    own = results.select(ground=ground)
    return draw([over_setting(own, key, name, sample, by="walk") for name, sample in samples.items()], columns=3)


def values(results: Results) -> dict[str, Any]:
    """Settings that the page names."""
    changed, slopes = results.select(change="stiff"), results.select(ground="slopes")
    return {
        "change": changed.value("before"), "cycles": changed.value("cycles"), "factor": FACTOR, "payload": PAYLOAD,
        "ahead": AHEAD, "within": WITHIN, "leg_settings": ", ".join(f"`{text}`" for text in LEG[1:]),
        "lasting": ", ".join(f"`{text}`" for text in LASTING),
        "patch": results.select(ground="patches").value("terrain.patch_size"),
        "start": max(slopes.values("terrain.slope_start")), "ground_cycles": slopes.value("cycles"),
        "tilt": 1e3 * TILT,
    }  # fmt: skip


STUDY = Study(
    title="Ground and load that change",
    question="How does learning cope with a step of the ground's stiffness, a payload, patches and slopes that "
    "neither planner nor controller knows?",
    runs=lambda quick: _changes(quick) + _grounds(quick),
    measures={"walked": share_of_time},
    findings=FINDINGS,
    figures={
        "changes": draw_changes,
        "patches": lambda r: draw_ground(r, "patches", "terrain.patch_spread"),
        "slopes": lambda r: draw_ground(r, "slopes", "terrain.slope"),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
