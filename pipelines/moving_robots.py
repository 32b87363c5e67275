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
from cmacexp.study.statements import Limit
from cmacexp.study.tables import completed, ends, tabulate
from cmacexp.typing import Array
from pipelines.common_results import percent
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
    sample, words = partial(last, name=POSITION), "transfer error of the last cycle"
    return [
        Criterion(words, sample, at_most(limit), unit="mm", scale=1e3, of={"kind": CMAC, "ground": ground} | of,
                  case=f"{ground} ground")
        for ground in GROUNDS
    ]  # fmt: skip


def _left(name: str, limit: Limit, kind: str = CMAC, grounds: Iterable[str] = GROUNDS, **of: Any) -> list[Criterion]:
    """What a feedforward leaves of an error of feedback alone, on each ground."""
    sample, what = partial(over_alone, name=name, kind=kind), "transfer" if name == POSITION else "force"
    words = f"{what} error over that of feedback alone"
    return [percent(words, sample, limit, case=f"{ground} ground", ground=ground, **of) for ground in grounds]


def _on_course(sample: str, words: str, limit: float, **shown: Any) -> list[Criterion]:
    """A measure of the long trot of at most ``limit``, on each ground."""
    of = {"part": GAIT, "gait": TROT, "sensors": PERFECT, "kind": CMAC}
    return [
        Criterion(words, partial(Results.measure, name=sample), at_most(limit), of=of | {"ground": ground},
                  case=f"{ground} ground", **shown)
        for ground in GROUNDS
    ]  # fmt: skip


def _carries(network: str, start: str) -> Finding:
    of: dict[str, Any] = {"part": [ANEW, CARRIED], "network": network, "start": start}
    words = "transfer error of the first cycle over that of learning anew"
    return Finding(
        [percent(words, _first_cycle, at_most(0.5), case=f"{each} ground", ground=each, **of) for each in GROUNDS],
        yes=f"With a network addressed by {network}, what was learnt at one speed helps at another when feet start "
        f"{start}.",
        no=f"With a network addressed by {network}, what was learnt at one speed is of little use at another when "
        f"feet start {start}.",
    )


FINDINGS = {
    "walks": Finding(
        [
            percent("walks completed", _completed, at_least(0.9), case=gait, part=GAIT, gait=gait) for gait in GAITS
        ],
        yes="Every gait walks to the end, by feedback alone and while a CMAC learns, with perfect sensors and "
        "encoders.",
        no="Some gaits fall before the end, by feedback alone or while a CMAC learns.",
    ),
    "trot": Finding(
        _within(0.7e-3, part=GAIT, gait=TROT, sensors=PERFECT),
        yes="In a trot of 0.4 m/s the feet follow their paths within 0.7 mm to the end.",
        no="In a trot of 0.4 m/s the feet leave their paths by more than 0.7 mm.",
    ),
    "course": Finding(
        [
            *_on_course("off_course", "relative error of the speed", 0.01, unit="%", scale=100.0),
            *_on_course("drift", "largest distance from the course", 0.1, unit="mm", scale=1e3),
        ],
        yes="The trot of 0.4 m/s keeps its speed and its course.",
        no="The trot of 0.4 m/s loses its speed or its course.",
    ),
    "fast": Finding(
        _within(1.5e-3, part=GAIT, gait=FAST, sensors=PERFECT),
        yes="In a trot of 0.8 m/s the feet follow their paths within 1.5 mm to the end.",
        no="In a trot of 0.8 m/s the feet leave their paths by more than 1.5 mm.",
    ),
    "trot_force": Finding(
        _left(FORCE, at_most(0.8), part=GAIT, gait=TROT, sensors=PERFECT),
        yes="Learning lowers the force error of the trot.",
        no="Learning leaves much of the force error of the trot.",
    ),
    "encoders": Finding(
        [
            *_left(POSITION, at_most(1.0), part=GAIT, gait=TROT, sensors="encoders"),
            *_within(2e-3, part=GAIT, gait=TROT, sensors="encoders"),
        ],
        yes="With encoders, too, learning lowers the transfer error of the trot, to 2 mm or less.",
        no="With encoders, learning leaves the trot a transfer error above 2 mm or above that of feedback alone.",
    ),
    "worlds": Finding(
        [
            percent("walks completed", _completed, at_least(0.5), case=world, part=WORLD, world=world, kind=CMAC)
            for world in WORLDS
        ],
        yes="Most walks with a CMAC reach their end in every world.",
        no="In some worlds half of the walks with a CMAC or more end early.",
    ),
    "late": Finding(
        _within(1e-3, part=WORLD, world=LATE),
        yes="Where torques act a sample late, the feet follow their paths within 1 mm to the end.",
        no="Where torques act a sample late, the feet leave their paths by more than 1 mm in the end.",
    ),
    "payload": Finding(
        [
            percent(f"force error of cycle {SOON} with the payload over that without", _soon, at_most(1.3),
                    case=f"{ground} ground", part=WORLD, ground=ground)
            for ground in GROUNDS
        ],
        yes=f"The force error with an unknown payload is small again by cycle {SOON}.",
        no=f"The force error with an unknown payload is still large in cycle {SOON}.",
    ),
    "push": Finding(
        [
            percent("walks completed", _completed, at_least(0.5), case=f"{each} ground", part=WORLD, world=PUSH,
                    ground=each)
            for each in GROUNDS
        ],
        yes="Feet catch a body that is pushed aside, with feedback alone and while a CMAC learns.",
        no="Half of the bodies that are pushed aside, or more, fall.",
    ),
    "slope": Finding(
        _left(FORCE, at_most(1.0), grounds=["elastic"], part=WORLD, world=SLOPE),
        yes="On a slope learning lowers the force error.",
        no="On a slope learning leaves the force error as it is, or raises it.",
    ),
    "as_built": Finding(
        [
            *_left(POSITION, at_most(0.02), part=WORLD, world=GO2),
            *_left(FORCE, at_most(0.3), part=WORLD, world=GO2),
        ],
        yes="On a Go2 as built, learning leaves at most 2 % of the transfer error and 30 % of the force error of "
        "feedback alone.",
        no="On a Go2 as built, learning leaves more than 2 % of the transfer error or 30 % of the force error of "
        "feedback alone.",
    ),
    "by_model": Finding(
        [
            *_left(POSITION, at_least(0.2), MODEL, part=WORLD, world=GO2),
            *_left(FORCE, at_least(0.2), MODEL, part=WORLD, world=GO2),
        ],
        yes="On a Go2 as built, the nominal model leaves at least 20 % of either error of feedback alone.",
        no="On a Go2 as built, the nominal model leaves less than 20 % of some error of feedback alone.",
    ),
    "fixed": Finding(
        _left(FORCE, at_least(0.5), FIXED, part=WORLD, world=GO2),
        yes="On a Go2 as built, learning with the load as modelled leaves at least half of the force error of "
        "feedback alone.",
        no="On a Go2 as built, learning with the load as modelled leaves less than half of the force error of "
        "feedback alone.",
    ),
    **{f"carries_{network}_{start}": _carries(network, start) for network in NETWORKS for start in STARTS},
    "lag": Finding(
        _within(0.5e-3, part=WORLD, world=LAG),
        yes="On a Go2 as built with the lag of its drives, the feet follow their paths within 0.5 mm to the end.",
        no="On a Go2 as built with the lag of its drives, the feet leave their paths by more than 0.5 mm in the end.",
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
