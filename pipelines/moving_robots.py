"""Robots that move: gaits, sensors, ground, unknown loads, and a robot that differs from its model.

``python -m pipelines.moving_robots`` (needs the extra ``robots``). Every walk starts from joints that are
disturbed by its seed, and has feedback alone in the same world beside it.
"""

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.commands.study import main
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY
from cmacexp.metrics.registry import SHOWN
from cmacexp.study import (
    Criterion,
    Finding,
    Results,
    Study,
    at_least,
    at_most,
    draw,
)
from cmacexp.study.curves import over_cycles
from cmacexp.study.statements import Limit, percent
from cmacexp.study.tables import completed, ends, tabulate
from cmacexp.typing import Array
from pipelines.dynamic_body import if_completed, off_course
from pipelines.moving_robots_runs import (
    ANEW,
    AS_MODELLED,
    CARRIED,
    FAST,
    FIXED,
    GAIT,
    GAITS,
    GO2,
    GROUNDS,
    LAG,
    LATE,
    MODEL,
    NETWORKS,
    PAYLOAD,
    PERFECT,
    PUSH,
    SLOPE,
    SOON,
    STARTS,
    TROT,
    WORLD,
    WORLDS,
    runs,
)
from pipelines.robots_findings import FORCE, POSITION, last, over
from pipelines.robots_runs import ALONE, CMAC

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@if_completed
def drift(run: StoredRun) -> float:
    """Largest distance of the body from its course in the last cycle, m."""
    return float(np.abs(run.cycles([run.config["cycles"]], BODY)["cog_y"]).max())


def over_alone(results: Results, name: str, kind: str = CMAC) -> Array:
    """(runs,): a metric of the last cycle over that of feedback alone, of seeds with which that reaches the end."""
    learnt, alone = (last(results.select(kind=each), name) for each in (kind, ALONE))
    return over(learnt, alone)[np.isfinite(alone)]


def _soon(results: Results) -> Array:
    """(runs,): force error soon after a load was put on, over that without it."""
    return over(*(results.select(world=world, kind=CMAC).at(SOON, FORCE) for world in (PAYLOAD, AS_MODELLED)))


def _first_cycle(results: Results) -> Array:
    """(runs,): transfer error of the first cycle with weights of another speed, over that without."""
    return over(*(results.select(part=part).at(1, POSITION) for part in (CARRIED, ANEW)))


def _completed(results: Results) -> list[bool]:
    return results.completed


def _within(limit: float, **of: Any) -> list[Criterion]:
    """Transfer errors of the CMAC of at most ``limit``, m, on each ground."""
    sample, words = partial(last, name=POSITION), "transfer error of the last cycle, {} ground"
    return [
        Criterion(words.format(ground), sample, at_most(limit), unit="mm", scale=1e3,
                  of={"kind": CMAC, "ground": ground} | of)
        for ground in GROUNDS
    ]  # fmt: skip


def _left(name: str, limit: Limit, kind: str = CMAC, grounds: Iterable[str] = GROUNDS, **of: Any) -> list[Criterion]:
    """What a feedforward leaves of an error of feedback alone, on each ground."""
    sample, words = partial(over_alone, name=name, kind=kind), f"{SHOWN[name].title} over that of feedback alone"
    return [percent(f"{words}, {ground} ground", sample, limit, ground=ground, **of) for ground in grounds]


def _on_course(sample: str, words: str, limit: float, **shown: Any) -> list[Criterion]:
    """A measure of the long trot of at most ``limit``, on each ground."""
    of = {"part": GAIT, "gait": TROT, "sensors": PERFECT, "kind": CMAC}
    return [
        Criterion(f"{words}, {ground} ground", partial(Results.measure, name=sample), at_most(limit),
                  of=of | {"ground": ground}, **shown)
        for ground in GROUNDS
    ]  # fmt: skip


def _carries(network: str, start: str) -> Finding:
    of: dict[str, Any] = {"part": [ANEW, CARRIED], "network": network, "start": start}
    words = "transfer error of the first cycle over that of learning anew"
    return Finding(
        [percent(f"{words}, {each} ground", _first_cycle, at_most(0.5), ground=each, **of) for each in GROUNDS],
        yes=f"Addressed by {network}, what was learnt carries over to feet that start {start}.",
        no=f"Addressed by {network}, what was learnt does not carry over to feet that start {start}.",
    )


FINDINGS = {
    "walks": Finding(
        [percent(f"walks completed, {gait}", _completed, at_least(0.9), part=GAIT, gait=gait) for gait in GAITS],
        yes="Every gait walks to the end, alone and while a CMAC learns, with perfect sensors and encoders.",
        no="Not every gait walks to the end with feedback alone and with a CMAC: see the table.",
    ),
    "trot": Finding(
        _within(0.7e-3, part=GAIT, gait=TROT, sensors=PERFECT),
        yes="In a trot of 0.4 m/s the feet follow their paths within 0.7 mm to the end.",
        no="In a trot of 0.4 m/s the feet do not follow their paths within 0.7 mm on both grounds.",
    ),
    "course": Finding(
        [
            *_on_course("off_course", "relative error of the speed", 0.01, unit="%", scale=100.0),
            *_on_course("drift", "largest distance from the course", 0.1, unit="mm", scale=1e3),
        ],
        yes="It keeps its speed and its course.",
        no="It does not keep its speed and its course on both grounds.",
    ),
    "fast": Finding(
        _within(1.5e-3, part=GAIT, gait=FAST, sensors=PERFECT),
        yes="At 0.8 m/s they do within 1.5 mm.",
        no="At 0.8 m/s they do not follow them within 1.5 mm on both grounds.",
    ),
    "trot_force": Finding(
        _left(FORCE, at_most(0.8), part=GAIT, gait=TROT, sensors=PERFECT),
        yes="Learning lowers the force error of the trot.",
        no="Learning does not lower the force error of the trot as far as asked on both grounds.",
    ),
    "encoders": Finding(
        [
            *_left(POSITION, at_most(1.0), part=GAIT, gait=TROT, sensors="encoders"),
            *_within(2e-3, part=GAIT, gait=TROT, sensors="encoders"),
        ],
        yes="With encoders the trot is learnt, too.",
        no="With encoders the trot is not learnt within these limits.",
    ),
    "worlds": Finding(
        [
            percent(f"walks completed, {world}", _completed, at_least(0.5), part=WORLD, world=world, kind=CMAC)
            for world in WORLDS
        ],
        yes="Most walks with a CMAC reach their end in every world.",
        no="Not in every world do most walks with a CMAC reach their end for certain.",
    ),
    "late": Finding(
        _within(1e-3, part=WORLD, world=LATE),
        yes="Torques that act a sample late are learnt and stay learnt.",
        no="Torques that act a sample late are not learnt, or do not stay learnt.",
    ),
    "payload": Finding(
        [
            percent(f"force error of cycle {SOON} with the payload over that without, {ground} ground", _soon,
                    at_most(1.3), part=WORLD, ground=ground)
            for ground in GROUNDS
        ],
        yes="The forces of the feet show an unknown payload within a few cycles.",
        no="An unknown payload is not made up for within a few cycles on both grounds.",
    ),
    "push": Finding(
        [
            percent(f"walks completed, {each} ground", _completed, at_least(0.5), part=WORLD, world=PUSH, ground=each)
            for each in GROUNDS
        ],
        yes="Feet catch a body that is pushed aside, with feedback alone and while a CMAC learns.",
        no="Feet do not catch a body that is pushed aside on both grounds for certain.",
    ),
    "slope": Finding(
        _left(FORCE, at_most(1.0), grounds=["elastic"], part=WORLD, world=SLOPE),
        yes="On a slope learning lowers the force error.",
        no="On a slope learning does not lower the force error.",
    ),
    "as_built": Finding(
        [
            *_left(POSITION, at_most(0.02), part=WORLD, world=GO2),
            *_left(FORCE, at_most(0.3), part=WORLD, world=GO2),
        ],
        yes="On a robot that differs from its model as a fitted Go2 does, learning leaves little of either error.",
        no="On a robot that differs from its model as a fitted Go2 does, learning leaves more of an error.",
    ),
    "by_model": Finding(
        [
            *_left(POSITION, at_least(0.2), MODEL, part=WORLD, world=GO2),
            *_left(FORCE, at_least(0.2), MODEL, part=WORLD, world=GO2),
        ],
        yes="Its maker's model leaves much of both.",
        no="Its maker's model does not leave much of both on both grounds.",
    ),
    "fixed": Finding(
        _left(FORCE, at_least(0.5), FIXED, part=WORLD, world=GO2),
        yes="Without the load that the feet show, learning leaves most of the force error.",
        no="Without the load that the feet show, learning does not leave most of the force error on both grounds.",
    ),
    **{f"carries_{network}_{start}": _carries(network, start) for network in NETWORKS for start in STARTS},
    "lag": Finding(
        _within(0.5e-3, part=WORLD, world=LAG),
        yes="With the lag of its drives, too, the feet follow their paths to the end.",
        no="With the lag of its drives the feet do not follow their paths within the limit to the end.",
    ),
}  # fmt: skip


def _columns() -> dict[str, Any]:
    return {
        "completed": completed,
        **ends((POSITION, FORCE), cycles=1),
        "error of the speed, %": lambda own: 100.0 * float(own.measure("off_course").mean()),
        "off course, mm": lambda own: 1e3 * float(own.measure("drift").mean()),
    }


def table_gaits(results: Results) -> "pd.DataFrame":
    """Errors of the last cycle of every gait."""
    columns = {"gait": "gait", "ground": "ground", "sensors": "sensors", "kind": "feedforward"}
    return tabulate(results.select(part=GAIT), columns, _columns())


def table_worlds(results: Results) -> "pd.DataFrame":
    """Errors of the last cycle in every world."""
    columns = {"world": "world", "ground": "ground", "kind": "feedforward"}
    return tabulate(results.select(part=WORLD), columns, _columns())


def draw_worlds(results: Results) -> "Figure":
    """Both errors of the Go2 as built over the cycles."""
    own = results.select(part=WORLD, world=GO2, ground="elastic")
    return draw([over_cycles(own, name, "kind", log="y") for name in (POSITION, FORCE)])


def values(results: Results) -> dict[str, Any]:
    """Counts and settings that the page names."""
    learning = results.select(kind=CMAC)
    built = results.select(part=WORLD, world=GO2, kind=CMAC).run.config["plant"]
    return {"built": built, "cycles": sorted(learning.values("cycles")), "seeds": len(learning.values("seed"))}


STUDY = Study(
    title="Robots that move",
    question="What does learned feedforward gain in gaits that no static equilibrium holds, with unknown loads, "
    "and on a robot that differs from its model?",
    runs=runs,
    measures={"off_course": off_course, "drift": drift},
    findings=FINDINGS,
    figures={"worlds": draw_worlds},
    tables={"gaits": table_gaits, "worlds": table_worlds},
    values=values,
)

if __name__ == "__main__":
    main(__file__)
