"""Robots that move: gaits, sensors, ground, unknown loads, and a robot that differs from its model.

``python -m pipelines.moving_robots`` (needs the extra ``robots``). Every walk starts from joints that are
disturbed by its seed, and is compared with feedback only from the same start in the same world.
"""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.commands.study import main
from cmacexp.data.run import Run
from cmacexp.data.tables import BODY_FILE
from cmacexp.study import ANY, Criterion, Finding, Results, Study, at_least, at_most, draw
from cmacexp.study.curves import over_cycles
from cmacexp.study.samples import quotients
from cmacexp.study.statements import Limit
from cmacexp.study.tables import completed, ends, tabulate
from cmacexp.typing import Array
from pipelines.common_results import itself, percent
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
from pipelines.robots_findings import FORCE, LEFT, POSITION, WORDS, last
from pipelines.robots_runs import ALONE, CMAC

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


def if_completed(measure: Callable[[Run], float]) -> Callable[[Run], float]:
    """The measure of a run; inf if it ended before."""
    return lambda run: measure(run) if run.status == "completed" else np.inf


@if_completed
def off_course(run: Run) -> float:
    """Relative error of the body's way in the last cycle."""
    gait, body = run.config["gait"], run.cycles([run.config["cycles"]], BODY_FILE)
    speed = gait["stroke"] / (gait["duty_factor"] * gait["cycle_time"])
    planned = speed * run.config["sampling_period"] * (len(body) - 1)
    return float(abs((body["cog_x"].iloc[-1] - body["cog_x"].iloc[0]) / planned - 1.0))


@if_completed
def drift(run: Run) -> float:
    """Largest distance of the body from its course in the last cycle, m."""
    return float(np.abs(run.cycles([run.config["cycles"]], BODY_FILE)["cog_y"]).max())


def over_alone(results: Results, name: str, kind: str = CMAC) -> Array:
    """(runs,): a metric of the last cycle over that with feedback only, start by start."""
    return quotients(*(last(results.select(kind=each), name) for each in (kind, ALONE)))


def _soon(results: Results) -> Array:
    """(runs,): force error soon after a load was put on, over that without it."""
    return quotients(*(results.select(world=world, kind=CMAC).at(SOON, FORCE) for world in (PAYLOAD, AS_MODELLED)))


def _first_cycle(results: Results) -> Array:
    """(runs,): transfer error of the first cycle with weights of another speed, over that without."""
    return quotients(*(results.select(part=part).at(1, POSITION) for part in (CARRIED, ANEW)))


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
    """What a feedforward leaves of an error of feedback only, on each ground."""
    sample, words = partial(over_alone, name=name, kind=kind), f"{WORDS[name]} error over that with feedback only"
    return [percent(words, sample, limit, case=f"{ground} ground", ground=ground, **of) for ground in grounds]


def _beside(name: str, *kinds: str, grounds: Iterable[str] = GROUNDS, **of: Any) -> list[Criterion]:
    """What such ratios are made of: an error itself with each feedforward, on each ground."""
    return [
        itself(f"{WORDS[name]} error", name, partial(last, name=name), f"{ground} ground, {kind}",
               of | {"ground": ground, "kind": kind})
        for ground in grounds
        for kind in kinds
    ]  # fmt: skip


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
    error, first = "transfer error of the first cycle", partial(Results.at, cycle=1, name=POSITION)
    return Finding(
        [
            percent(f"{error} over that of learning anew", _first_cycle, at_most(0.5), case=f"{ground} ground",
                    ground=ground, **of)
            for ground in GROUNDS
        ] + [
            itself(error, POSITION, first, f"{ground} ground, {part}", of | {"ground": ground, "part": part})
            for ground in GROUNDS for part in (ANEW, CARRIED)
        ],
        says=f"With a network addressed by {network}, what was learnt at one speed helps at another "
            f"when feet start {start}",
    )  # fmt: skip


BUILT = {"part": WORLD, "world": GO2}


def _over_feedback(kind: str, limits: Mapping[str, Limit]) -> list[Criterion]:
    """Errors of the Go2 as built with a feedforward over those with feedback only, and these errors."""
    ratios = [each for name, limit in limits.items() for each in _left(name, limit, kind, **BUILT)]
    return ratios + [each for name in limits for each in _beside(name, ALONE, kind, **BUILT)]


FINDINGS = {
    "walks": Finding(
        [
            percent("walks completed", _completed, at_least(0.9), case=gait, part=GAIT, gait=gait) for gait in GAITS
        ],
        says="Every gait walks to the end, with feedback only and while a CMAC learns, with perfect "
            "sensors and encoders",
    ),
    "trot": Finding(
        _within(0.7e-3, part=GAIT, gait=TROT, sensors=PERFECT),
        says="In a trot of 0.4 m/s the transfer error ends at 0.7 mm or less",
    ),
    "course": Finding(
        [
            *_on_course("off_course", "relative error of the speed", 0.01, unit="%", scale=100.0),
            *_on_course("drift", "largest distance from the course", 0.1, unit="mm", scale=1e3),
        ],
        says="The trot of 0.4 m/s keeps its speed and its course",
    ),
    "fast": Finding(
        _within(1.5e-3, part=GAIT, gait=FAST, sensors=PERFECT),
        says="In a trot of 0.8 m/s the transfer error ends at 1.5 mm or less",
    ),
    "trot_force": Finding(
        [
            *_left(FORCE, at_most(0.8), part=GAIT, gait=TROT, sensors=PERFECT),
            *_beside(FORCE, ALONE, CMAC, part=GAIT, gait=TROT, sensors=PERFECT),
        ],
        says="Learning lowers the force error of the trot by at least a fifth",
    ),
    "encoders": Finding(
        [
            *_left(POSITION, at_most(1.0), part=GAIT, gait=TROT, sensors="encoders"),
            *_within(2e-3, part=GAIT, gait=TROT, sensors="encoders"),
            *_beside(POSITION, ALONE, part=GAIT, gait=TROT, sensors="encoders"),
        ],
        says="With encoders, too, learning lowers the transfer error of the trot, to 2 mm or less",
    ),
    "worlds": Finding(
        [
            percent("walks completed", _completed, at_least(0.5), case=world, part=WORLD, world=world, kind=CMAC)
            for world in WORLDS
        ],
        says="In every world at least half of the walks with a CMAC complete",
    ),
    "late": Finding(
        _within(1e-3, part=WORLD, world=LATE),
        says="Where torques act a sample late, the transfer error ends at 1 mm or less",
    ),
    "payload": Finding(
        [
            percent(f"force error of cycle {SOON} with the payload over that without", _soon, at_most(1.3),
                    case=f"{ground} ground", part=WORLD, ground=ground)
            for ground in GROUNDS
        ] + [
            itself(f"force error of cycle {SOON}", FORCE, partial(Results.at, cycle=SOON, name=FORCE),
                   f"{ground} ground, {world}", {"part": WORLD, "world": world, "kind": CMAC, "ground": ground})
            for ground in GROUNDS for world in (AS_MODELLED, PAYLOAD)
        ],
        says=f"With an unknown payload the force error of cycle {SOON} is at most 1.3 times that "
            "without",
    ),
    "push": Finding(
        [
            percent("walks completed", _completed, at_least(0.5), case=f"{each} ground", part=WORLD, world=PUSH,
                    ground=each)
            for each in GROUNDS
        ],
        says="Of the robots that are pushed aside, with feedback only or while a CMAC learns, at "
            "least half walk on",
    ),
    "slope": Finding(
        [
            *_left(FORCE, at_most(1.0), grounds=["elastic"], part=WORLD, world=SLOPE),
            *_beside(FORCE, ALONE, CMAC, grounds=["elastic"], part=WORLD, world=SLOPE),
        ],
        says="On a slope learning lowers the force error",
    ),
    "built_walks": Finding(
        [
            percent("walks completed", _completed, limit, case=f"{ground} ground, {kind}", ground=ground, kind=kind,
                    of=BUILT)
            for kind, limit in ((CMAC, at_least(0.5)), (ALONE, ANY), (MODEL, ANY))
            for ground in GROUNDS
        ],
        says="A Go2 as built completes at least half of its walks with the CMAC",
    ),
    "as_built": Finding(
        _over_feedback(CMAC, {name: at_most(left) for name, left in LEFT.items()}),
        says="On a Go2 as built the transfer error with the CMAC is at most 5 %, the force error at "
            "most 25 % of that with feedback only",
    ),
    "by_model": Finding(
        _over_feedback(MODEL, dict.fromkeys((POSITION, FORCE), at_least(0.2))),
        says="On a Go2 as built both errors with the nominal model are at least 20 % of those with "
            "feedback only",
    ),
    "fixed": Finding(
        _over_feedback(FIXED, {FORCE: at_least(0.5)}),
        says="On a Go2 as built the force error with a CMAC and the load of the model is at least "
            "half of that with feedback only",
    ),
    **{f"carries_{network}_{start}": _carries(network, start) for network in NETWORKS for start in STARTS},
    "lag": Finding(
        _within(0.5e-3, part=WORLD, world=LAG),
        says="On a Go2 as built with the lag of its drives the transfer error ends at 0.5 mm or less",
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
    built, gaits = results.select(part=WORLD, world=GO2, kind=CMAC), results.select(part=GAIT, kind=CMAC)
    return {
        "built": built.run.config["plant"],
        "cycles": sorted(learning.values("cycles")),
        "seeds": len(gaits.values("seed")),
        "built_seeds": len(built.values("seed")),
    }


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
