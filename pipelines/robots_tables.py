"""Figures and tables of the study of robots."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from cmacexp.metrics.registry import SHOWN
from cmacexp.metrics.text import format_number
from cmacexp.study import Results, draw
from cmacexp.study.curves import over_cycles, over_setting
from cmacexp.study.interval import estimate
from cmacexp.study.tables import completed, cross_tabulate, ends, tabulate
from cmacexp.typing import Array
from pipelines.robots_findings import FEEDBACK, FORCE, JOINTS, POSITION, SHARE, TILT, judged, last
from pipelines.robots_runs import FEEDFORWARDS, GROUND, LEAD, LEARNERS, LEFT_OUT, LONG, OTHERS, STARTS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SHOWN_OF_ROBOTS = (POSITION, FORCE, JOINTS, TILT, SHARE)


def draw_learning(results: Results, name: str) -> "Figure":
    """A metric over the cycles, a panel for each robot, a line for each feedforward that learns."""
    learning = results.select(part=FEEDFORWARDS, kind=list(LEARNERS))
    panels = {robot: over_cycles(own, name, "kind", log="y") for robot, own in learning.by("robot").items()}
    return draw([replace(panel, title=robot) for robot, panel in panels.items()])


def draw_left_out(results: Results) -> "Figure":
    """Force error of the last cycle without each part; no bar where the robot falls."""
    own = results.select(part=LEFT_OUT)
    return draw(
        [over_setting(own, "without", "force error, N", partial(last, name=FORCE), title="left out", kind="bars")],
        columns=1,
        height=3.0,
    )


def draw_lead(results: Results) -> "Figure":
    """Feedback torque over the cycles with and without lead."""
    return draw([over_cycles(results.select(part=LEAD), FEEDBACK, "lead", log="y")], columns=1)


def _pair(measure: Callable[[str], Array]) -> str:
    """Transfer and force error, estimated from the measured values of a metric; and of how many, if walks fell."""
    found = {name: estimate(measure(name)) for name in (POSITION, FORCE)}
    errors = " / ".join(format_number(SHOWN[name].factor * each.value) for name, each in found.items())
    return f"{errors} ({found[FORCE].size})" if found[FORCE].failed else errors


def table_feedforwards(results: Results) -> "pd.DataFrame":
    """Errors of every robot with every feedforward, when learners are compared."""
    own = results.select(part=FEEDFORWARDS)
    cycle = min(results.select(kind=list(LEARNERS), part=FEEDFORWARDS).values("cycles"))

    def cell(walks: Results) -> str:
        return _pair(lambda name: judged(walks, name, walks.value("kind"), cycle))

    return cross_tabulate(own, ("kind", "feedforward"), ("robot", ""), cell)


def table_learning(results: Results) -> "pd.DataFrame":
    """Errors of every robot with a CMAC from disturbed starts as it learns."""
    own = results.select(part=STARTS)
    columns: dict[str, Any] = {
        f"cycle {cycle}, mm / N": lambda walks, cycle=cycle: _pair(partial(walks.at, cycle))
        for cycle in (1, 2, 5, 10, 20, 50, LONG)
        if cycle <= own.value("cycles")
    }
    return tabulate(own, {"robot": "robot", "period": "sampled with"}, columns | {"completed": completed})


def _table(results: Results, by: dict[str, str]) -> "pd.DataFrame":
    return tabulate(results, by, {"completed": completed} | ends(SHOWN_OF_ROBOTS, cycles=1))


TABLES = {
    "feedforwards": table_feedforwards,
    "learning": table_learning,
    "last": lambda results: _table(results.select(part=FEEDFORWARDS), {"robot": "robot", "kind": "feedforward"}),
    "left_out": lambda results: _table(results.select(part=LEFT_OUT), {"without": "without"}),
    "further": lambda results: _table(results.select(part=OTHERS), {"robot": "robot", "kind": "feedforward"}),
    "ground": lambda results: _table(results.select(part=GROUND), {"robot": "robot", "kind": "feedforward"}),
}
FIGURES: "dict[str, Callable[[Results], Figure]]" = {
    "position": partial(draw_learning, name=POSITION),
    "force": partial(draw_learning, name=FORCE),
    "left_out": draw_left_out,
    "lead": draw_lead,
}
