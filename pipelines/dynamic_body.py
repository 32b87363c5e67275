"""The paper's walk with a body that has mass: the quadruped in MuJoCo, with friction under its feet.

``python -m pipelines.dynamic_body`` (needs the extra ``mujoco``). Lin & Song 1997 balance the body in every instant;
here it floats. The study walks with the paper's constants, then makes the changes of
``conf/for_plant/mujoco_quadruped.yaml`` one after the other, leaves out one at a time, and walks for long from
disturbed starts.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.commands.study import main
from cmacexp.data.run import Run
from cmacexp.data.tables import BODY_FILE
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.models.robot import load_mujoco
from cmacexp.study import ANY, Criterion, Finding, Request, Results, Study, at_least, at_most, draw, grid
from cmacexp.study.curves import over_setting
from cmacexp.study.samples import quotients, ratio
from cmacexp.study.statements import Limit
from cmacexp.study.study import Values
from cmacexp.study.tables import completed, tabulate
from cmacexp.typing import Array
from pipelines.common_results import draw_cycles, growth, percent, share_of_time

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

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
PAPERS_RATE, DAMPED = "learning.rate=0.1953125", "terrain.damping=50"
CMAC, FEEDBACK = "CMAC", "feedback only"
EXACT, SAMPLING, COMPENSATOR = "exact inverse dynamics", "sampled faster", "weaker LEAD"
FIXED: dict[str, tuple[str, ...]] = {
    FEEDBACK: ("feedforward=none",),
    "feedback only, finer steps": ("feedforward=none", "plant.substeps=20"),
    EXACT: ("feedforward=inverse_dynamics",),
}
"""Walks with the paper's constants in which a seed decides nothing."""
LEARNING: dict[str, tuple[str, ...]] = {
    "as published": (),
    "lead of one sample": ("learning.lead=1",),
    "lower learning rate": ("learning.rate=0.05",),
    "damped ground": (DAMPED,),
}
"""Such walks with a CMAC."""
OTHER_LOOP: dict[str, tuple[str, ...]] = {
    SAMPLING: ("sampling_period=0.002",), COMPENSATOR: ("controller.lead_alpha=3",)
}  # fmt: skip
"""Walks with a CMAC and all but one of the paper's constants of the loop."""
NONE, ALL = "none of the changes", "all changes"
COMPARED, SETTLED = 20, 3
"""Cycles of a walk that learns, and of feedback only, which repeats itself from its second cycle on."""
WITH, WITHOUT = "with lead", "without lead"
LEADLESS = [0, 1, 2, 3, 4]
"""Starts that also walk without lead."""
CUT_OFF = 10.0
"""Force errors below this frequency are measured separately, Hz."""
FELT = 1.1
"""Factor of the force error by which a difference counts."""
FORCE = "force_rmse_cycle"
QUANTITIES = {
    FORCE: MetricDisplay("force error", "N"),
    "slow_force": MetricDisplay(f"force error below {CUT_OFF:g} Hz", "N"),
    "transfer_rmse_x": MetricDisplay("transfer error in x", "mm", 1e3),
    "transfer_rmse_y": MetricDisplay("transfer error in y", "mm", 1e3),
    "tilt_max": MetricDisplay("tilt", "mrad", 1e3),
    "off_course": MetricDisplay("error of the distance walked", "%", 100.0),
}
"""Metrics and measures of the last cycle."""


def without(name: str) -> str:
    """The walk with all changes but one."""
    return f"without {name}"


def _taken_back(names: list[str]) -> tuple[str, ...]:
    return tuple(text for name in names for text in CHANGES[name])


def _pair(part: str, walk: str, off: list[str], cycles: int) -> list[Request]:
    """A walk in which the changes ``off`` are taken back, with a CMAC, and feedback only on the same plan."""
    texts = _taken_back(off)
    learning = (*WALK, *texts, f"cycles={cycles}", f"record.cycles=[{cycles}]")
    plan = [text for text in texts if not text.startswith("learning.")]
    alone = (*WALK, *plan, "feedforward=none", f"cycles={SETTLED}", f"record.cycles=[{SETTLED}]")
    learnt = grid(*learning, seeded=True, part=part, walk=walk, feedforward=CMAC)
    return learnt + grid(*alone, part=part, walk=walk, feedforward=FEEDBACK)


def _published(cycles: int, quick: bool) -> list[Request]:
    paper = (*_taken_back(NAMES), "sampling_period=0.005", "controller.lead_alpha=10", PAPERS_RATE)
    common = (*WALK, *paper, f"cycles={cycles}", f"record.cycles=[{cycles}]")
    found = []
    for variants, seeded in ((FIXED, False), (LEARNING | OTHER_LOOP, True)):
        chosen = dict(list(variants.items())[:1]) if quick else variants
        over: Values = {"reference": ["aware"] if quick else ["literal", "aware"], "variant": chosen}
        found += grid(*common, over=over, seeded=seeded, part="published")
    return found


def _ladder(cycles: int, quick: bool) -> list[Request]:
    """The changes made one after the other, and left out one at a time; and ways to learn faster without them."""
    names = NAMES[:1] if quick else NAMES
    found = _pair("made", NONE, NAMES, cycles)
    for count, name in enumerate(names, 1):
        found += _pair("made", f"+ {name}", NAMES[count:], cycles)
    found += _pair("left out", ALL, [], cycles)
    for name in names:
        found += _pair("left out", without(name), [name], cycles)
    common = (*WALK, *_taken_back(NAMES), f"cycles={cycles}", f"record.cycles=[{cycles}]")
    faster = {"the paper's rate": (PAPERS_RATE,), "the paper's rate, damped ground": (PAPERS_RATE, DAMPED)}
    return found + grid(*common, over={"walk": faster}, seeded=True, part="faster", feedforward=CMAC)


def _starts(cycles: int, quick: bool) -> list[Request]:
    """Disturbed starts, each with a hash of its own; some of them without lead too."""
    common = (*WALK, "plant.start_spread=0.02", f"cycles={cycles}", f"record.cycles=[{cycles}]")
    found = []
    for walk, texts, numbers in ((WITH, (), range(10)), (WITHOUT, CHANGES["lead"], LEADLESS)):
        starts = {str(n): (f"plant.start_seed={n}", f"seed={n}") for n in (numbers[:1] if quick else numbers)}
        found += grid(*common, *texts, over={"start": starts}, part="starts", walk=walk)
    return found


def runs(quick: bool) -> list[Request]:
    """The paper's constants; the changes; the disturbed starts."""
    load_mujoco()
    cycles = 6 if quick else COMPARED
    return _published(cycles, quick) + _ladder(cycles, quick) + _starts(8 if quick else 100, quick)


def low_passed(error: Array, period: float) -> Array:
    """The part of ``error`` (steps, L), sampled every ``period`` s, below CUT_OFF, without delay.

    A second-order Butterworth filter, forth and back.
    """
    from scipy.signal import butter, sosfiltfilt

    return sosfiltfilt(butter(2, CUT_OFF, fs=1.0 / period, output="sos"), error, axis=0)


def if_completed(measure: Callable[[Run], float]) -> Callable[[Run], float]:
    """The measure of a run; inf if it ended before."""
    return lambda run: measure(run) if run.status == "completed" else np.inf


@if_completed
def slow_force(run: Run) -> float:
    """RMS force error below CUT_OFF, all legs, in the last cycle, N."""
    rows = run.cycles([run.config["cycles"]])
    error = (rows["force"] - rows["force_desired"]).to_numpy().reshape(-1, rows["leg"].max())
    return float(np.sqrt((low_passed(error, run.config["sampling_period"]) ** 2).mean()))


@if_completed
def off_course(run: Run) -> float:
    """Relative error of the body's way in the last cycle."""
    gait, body = run.config["gait"], run.cycles([run.config["cycles"]], BODY_FILE)
    speed = gait["stroke"] / (gait["duty_factor"] * gait["cycle_time"])
    planned = speed * run.config["sampling_period"] * (len(body) - 1)
    return float(abs((body["cog_x"].iloc[-1] - body["cog_x"].iloc[0]) / planned - 1.0))


@if_completed
def yaw(run: Run) -> float:
    """How far the body has turned from the plan at the end, rad."""
    return float(abs(run.cycles([run.config["cycles"]], BODY_FILE)["yaw"].iloc[-1]))


def last(results: Results, name: str) -> Array:
    """(runs,): a metric or measure of the last planned cycle; inf if a run ended before."""
    return results.end(name, cycles=1) if name in ALL_METRICS else results.measure(name)


def _walks(words: str, **of: Any) -> Finding:
    """Whether walks last."""
    return Finding(
        [percent("planned time walked", lambda r: r.measure("walked"), at_least(0.9), of=of)],
        yes=f"The machine walks to the end {words}.",
        no=f"The machine falls before the end {words}: it walks for {{value}} of the planned time.",
    )


def _itself(name: str, limit: Limit, case: str = "", **of: Any) -> Criterion:
    """A metric or measure of the last cycle itself."""
    title, unit, factor, *_ = QUANTITIES[name]
    return Criterion(title, partial(last, name=name), limit, unit=unit, scale=factor, of=of, case=case)


def _over_feedback(limits: Mapping[str, Limit], **of: Any) -> list[Criterion]:
    """Metrics or measures of the last cycle over those with feedback only on the same plan; and what both are."""
    sample = partial(ratio, chosen={"feedforward": CMAC}, reference={"feedforward": FEEDBACK})
    over = f"over that with {FEEDBACK}"
    return [
        *(Criterion(f"{QUANTITIES[name].title} {over}", sample(partial(last, name=name)), limit, of=of)
          for name, limit in limits.items()),
        *(_itself(name, ANY, kind, feedforward=kind, **of) for name in limits for kind in (FEEDBACK, CMAC)),
    ]  # fmt: skip


def _felt(name: str) -> Finding:
    words = f"force error of cycle {COMPARED} without it, over that with all changes"
    sample = ratio(partial(last, name=FORCE), {"walk": without(name)}, {"walk": ALL})
    return Finding(
        [Criterion(words, sample, at_least(FELT), of={"part": "left out", "feedforward": CMAC})],
        yes=f"The change “{name}” lowers the force error of cycle {COMPARED}.",
        no=f"The change “{name}” hardly changes the force error of cycle {COMPARED}, or raises it.",
    )


def _growth(results: Results) -> Array:
    """(starts,): force error of the last cycle over that of the cycle in which the changes are compared."""
    return growth(last(results, FORCE), results.at(COMPARED, FORCE))


def _difference(results: Results) -> Array:
    """(starts,): how far the force error in the last cycle is from the median of all starts, over that median."""
    errors = last(results, FORCE)
    return abs(quotients(errors, float(np.median(errors))) - 1.0)


WITHOUT_CHANGES = {"part": "made", "walk": NONE}
WITH_ALL = {"part": "left out", "walk": ALL}
STARTS = {"part": "starts", "walk": WITH}
OFF_COURSE = 0.05
"""Largest error of the distance walked that counts as good."""
FINDINGS = {
    "published_feedforward": _walks(
        "with a feedforward and the paper's sampling and LEAD compensator", part="published",
        variant=[EXACT, *LEARNING],
    ),
    "published_feedback": _walks("with the paper's constants and feedback only", part="published", variant=FEEDBACK),
    "sampling": _walks("sampled faster, all other constants as published", part="published", variant=SAMPLING),
    "compensator": _walks(
        "with a weaker LEAD compensator, all other constants as published", part="published", variant=COMPENSATOR
    ),
    "none_path": Finding(
        _over_feedback({f"transfer_rmse_{axis}": at_most(1.0) for axis in "xy"}, **WITHOUT_CHANGES),
        yes="Without the changes learning improves foot positions.",
        no="Without the changes learning makes foot positions worse or ends the walk.",
    ),
    "none_force": Finding(
        _over_feedback({FORCE: at_most(1.0)}, **WITHOUT_CHANGES),
        yes="Without the changes learning improves contact forces.",
        no="Without the changes learning makes contact forces worse or ends the walk.",
    ),
    "faster": _walks("at the paper's learning rate without the changes", part="faster"),
    "all_force": Finding(
        _over_feedback({FORCE: at_most(0.45), "slow_force": at_most(0.35)}, **WITH_ALL),
        yes="With all changes learning more than halves the force error.",
        no="Even with all changes learning lowers the force error by less than is asked for.",
    ),
    "all_path": Finding(
        [
            _itself(name, at_most(limit), **WITH_ALL, feedforward=CMAC)
            for name, limit in {
                "transfer_rmse_x": 3e-3, "transfer_rmse_y": 1.5e-3, "tilt_max": 0.01, "off_course": OFF_COURSE
            }.items()
        ],
        yes="With all changes foot positions, tilt and course are all good.",
        no="Even with all changes, one of foot positions, tilt and course is poor.",
    ),
    **{f"felt_{name}": _felt(name) for name in NAMES},
    "starts_last": Finding(
        [
            percent("walks that complete", lambda r: r.completed, at_least(0.7), of=STARTS),
            Criterion(f"force error at the end over that of cycle {COMPARED}", _growth, at_most(FELT), of=STARTS),
            _itself("off_course", at_most(OFF_COURSE), **STARTS),
        ],
        yes="From disturbed starts, walks complete, and the force error stays bounded.",
        no="From disturbed starts, walks end early, or the force error grows again.",
    ),
    "starts_alike": Finding(
        [percent("difference of the force error from the median start", _difference, at_most(0.05), of=STARTS)],
        yes="The start makes little difference to the force error at the end.",
        no="The start makes a difference to the force error at the end.",
    ),
    "starts_lead": Finding(
        [
            Criterion("force error without lead over that with it",
                      ratio(partial(last, name=FORCE), {"walk": WITHOUT}, {"walk": WITH}), at_least(FELT),
                      of={"part": "starts", "start": LEADLESS})
        ],
        yes="Lead lowers the force error of a long walk.",
        no="Lead hardly changes the force error of a long walk, or raises it.",
    ),
}  # fmt: skip


def draw_ladder(results: Results) -> "Figure":
    """Force error of each walk, beside that of feedback only on the same plan."""
    titles = {"made": "changes made one after the other", "left out": "all changes but one"}
    panels = [
        over_setting(results.select(part=part), "walk", "force error, N", partial(last, name=FORCE), "feedforward",
                     title=title, kind="bars")
        for part, title in titles.items()
    ]  # fmt: skip
    return draw(panels, columns=1, height=3.0)


def table_published(results: Results) -> "pd.DataFrame":
    """How walks with the paper's constants, or all but one of them, end."""
    return tabulate(
        results.select(part="published"),
        {"reference": "reference", "variant": "walk"},
        {
            "planned time walked, %": lambda r: 100.0 * r.measure("walked").mean(),
            "first ends": lambda r: r.rows[0].run.outcome.cause or r.rows[0].run.outcome.status,
        },
    )


def table_walks(results: Results) -> "pd.DataFrame":
    """The last cycle of every walk on the ladder."""
    errors = {
        f"{each.title}, {each.unit}": lambda r, name=name, factor=each.factor: factor * last(r, name).mean()
        for name, each in QUANTITIES.items()
    }
    return tabulate(
        results.select(part=["made", "left out", "faster"]),
        {"part": "changes", "walk": "walk", "feedforward": "with"},
        {"completed": completed, **errors},
    )


def values(results: Results) -> dict[str, Any]:
    """Configs and counts that the page names."""
    every, starts = results.select(WITH_ALL), results.select(STARTS)
    return {
        "paper": results.select(part="published").run.config,
        "learning": every.select(feedforward=CMAC).run.config,
        "alone": every.select(feedforward=FEEDBACK).run.config,
        "disturbed": starts.run.config,
        "starts": len(starts),
        "leadless": len(results.select(part="starts", walk=WITHOUT)),
        "yaw": float(starts.measure("yaw").max()),
    }


STUDY = Study(
    title="A body with mass",
    question="Does the quadruped walk when its body floats, and which settings let learning improve contact forces "
    "as well as positions?",
    runs=runs,
    measures={"walked": share_of_time, "slow_force": slow_force, "off_course": off_course, "yaw": yaw},
    findings=FINDINGS,
    figures={
        "ladder": draw_ladder,
        "learning": lambda r: draw_cycles(
            r.select(feedforward=CMAC, walk=[NONE, without(NAMES[0]), ALL]),
            (FORCE, "transfer_rmse_x", "transfer_rmse_y", "tilt_max"), by="walk",
        ),
        "starts": lambda r: draw_cycles(r.select(part="starts"), (FORCE, "tilt_max"), by="walk"),
    },
    tables={"published": table_published, "walks": table_walks},
    values=values,
)  # fmt: skip

if __name__ == "__main__":
    main(__file__)
