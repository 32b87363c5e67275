"""Robots with delayed feedback: gains, sampling period, lead and rate count delays and lags.

``python -m pipelines.late_robots`` (needs the extra ``robots``). Ten robots walk with encoders, with encoders and
torques that act a sample late, and with torques that lag, with feedback only and with a CMAC. Two of them walk for
long. Every walk starts from joints that are disturbed by its seed.
"""

from functools import partial
from typing import TYPE_CHECKING, Any

from cmacexp.commands.study import main
from cmacexp.metrics.registry import SHOWN
from cmacexp.study import Criterion, Finding, Request, Results, Study, at_least, at_most, draw
from cmacexp.study.curves import over_cycles
from cmacexp.study.samples import ratio
from cmacexp.study.tables import cross_tabulate, ends, tabulate
from pipelines.common_results import itself, percent
from pipelines.robots_findings import FORCE, POSITION, last
from pipelines.robots_runs import ALONE, BOTH, CMAC, FURTHER, QUICK, SETTLED, require_robots, walks
from pipelines.robots_runs import ROBOTS as FIRST

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

ROBOTS = FIRST | FURTHER
ENCODERS, LATE_TORQUE, LAG = "encoders", "encoders and late torque", "lag"
WORLDS = {
    ENCODERS: ("sensors=encoders",),
    LATE_TORQUE: ("sensors=encoders", "actuator.delay=1"),
    LAG: ("actuator.lag=0.005",),
}
ALL, LONG = "all", "long"
"""The parts of the study."""
LASTING = ("Go1", "Aliengo")
"""Robots that walk for long; they fell while learning before delays counted."""
LEARNT, LASTED = 50, 200
"""Cycles of the walks with a CMAC, and of the long ones."""
ACCURATE = 1.2e-3
"""Transfer error that counts as small, m."""


def runs(quick: bool) -> list[Request]:
    """All walks; the quick form is of one robot, two cycles each; raises as :func:`require_robots`."""
    require_robots()
    found = []
    for kind, feedforward in BOTH.items():
        over: dict[str, Any] = {"robot": {"Go1": ROBOTS["Go1"]} if quick else ROBOTS, "world": WORLDS}
        cycles = QUICK if quick else LEARNT if kind == CMAC else SETTLED
        found += walks(cycles, *feedforward, over=over, part=ALL, kind=kind)
    over = {"robot": {name: ROBOTS[name] for name in (LASTING[:1] if quick else LASTING)}}
    return found + walks(QUICK if quick else LASTED, *WORLDS[ENCODERS], over=over, part=LONG)


def _errors(world: str, kind: str, words: str, limit: float) -> Finding:
    shown = SHOWN[POSITION]
    return Finding(
        [
            Criterion(
                f"{shown.title} with {words}", partial(last, name=POSITION), at_most(limit), unit=shown.unit,
                scale=shown.factor, of={"part": ALL, "world": world, "kind": kind, "robot": robot}, case=robot,
            )
            for robot in ROBOTS
        ],
        says=f"With {world} and {words} the transfer error of every robot is at most "
            f"{1000.0 * limit:g} mm",
    )  # fmt: skip


def _forces(world: str) -> Finding:
    force = partial(last, name=FORCE)
    return Finding(
        [
            percent("force error over that with feedback only", ratio(force, {"kind": CMAC}, {"kind": ALONE}),
                    at_most(1.0), case=robot, part=ALL, world=world, robot=robot)
            for robot in ROBOTS
        ] + [
            itself("force error", FORCE, force, f"{robot}, {kind}",
                   {"part": ALL, "world": world, "robot": robot, "kind": kind})
            for robot in ROBOTS for kind in BOTH
        ],
        says=f"With {world}, learning lowers the force error of every robot",
    )  # fmt: skip


def _completed(results: Results) -> list[bool]:
    return results.completed


FINDINGS = {
    "walks": Finding(
        [percent("walks completed", _completed, at_least(0.9), part=ALL)],
        says="With delayed feedback the robots walk to the end, with a CMAC and with feedback only",
    ),
    "lasts": Finding(
        [
            percent("walks completed", _completed, at_least(0.5), case=robot, part=LONG, robot=robot)
            for robot in LASTING
        ],
        says="With encoders Go1 and Aliengo complete long walks",
    ),
    "accurate": Finding(
        [
            Criterion(
                "transfer error at the end", partial(last, name=POSITION), at_most(ACCURATE), unit="mm", scale=1e3,
                of={"part": LONG, "robot": robot}, case=robot,
            )
            for robot in LASTING
        ],
        says="Go1 and Aliengo stay accurate in long walks",
    ),
    **{f"alone_{world}": _errors(world, ALONE, ALONE, 0.03) for world in WORLDS},
    **{f"position_{world}": _errors(world, CMAC, "a CMAC", ACCURATE) for world in WORLDS},
    **{f"force_{world}": _forces(world) for world in WORLDS},
}  # fmt: skip


def table_periods(results: Results) -> "pd.DataFrame":
    """Sampling period by rule of every robot, ms."""
    learning = results.select(part=ALL, kind=CMAC)
    return cross_tabulate(
        learning, ("robot", "robot"), ("world", ""), lambda walks: 1e3 * walks.run.config["sampling_period"]
    )


def table_errors(results: Results) -> "pd.DataFrame":
    """Errors of the last cycle of every walk."""
    columns = {"robot": "robot", "world": "delay", "kind": "feedforward"}
    return tabulate(results.select(part=ALL), columns, ends((POSITION, FORCE), cycles=1))


def draw_long(results: Results) -> "Figure":
    """Transfer error of the long walks over their cycles."""
    return draw([over_cycles(results.select(part=LONG), POSITION, "robot", log="y")], columns=1)


def values(results: Results) -> dict[str, Any]:
    """Counts and settings that the page names."""
    learning = results.select(part=ALL, kind=CMAC)
    return {
        "cycles": max(learning.values("cycles")),
        "lasting": results.select(part=LONG).value("cycles"),
        "robots": len(learning.values("robot")),
        "starts": len(learning.values("seed")),
        "spread": learning.run.config["plant"]["start_spread"],
        "lag": 1e3 * results.select(part=ALL, world=LAG, kind=CMAC).run.config["actuator"]["lag"],
    }


STUDY = Study(
    title="Robots with delayed feedback",
    question="Do robots walk and learn when encoders and actuators delay their feedback, with gains, sampling "
    "period, lead and rate by rule?",
    runs=runs,
    findings=FINDINGS,
    figures={"long": draw_long},
    tables={"periods": table_periods, "errors": table_errors},
    values=values,
)

if __name__ == "__main__":
    main(__file__)
