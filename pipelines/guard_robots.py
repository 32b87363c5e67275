"""The guard of learning on robots, in random worlds.

``python -m pipelines.guard_robots`` (needs the extra ``robots``) runs each world by feedback alone, with guarded and
with unguarded learning.
"""

from cmacexp.commands.study import main
from cmacexp.models.robot import load_mujoco
from cmacexp.models.robot_file import find_model
from cmacexp.study import Request, Study
from pipelines.guard_measures import (
    ERROR,
    QUICK,
    QUICK_NUMBER,
    count_worlds,
    draw_errors,
    measure_error,
    never_worse,
    request_worlds,
    table_worlds,
)
from pipelines.guard_worlds import ALIENGO, GO1

NUMBER, CYCLES = {GO1: 45, ALIENGO: 45}, 40
"""Worlds that are drawn: in some feedback alone does not complete."""


def runs(quick: bool) -> list[Request]:
    """Every world by feedback alone, guarded and unguarded; the quick form is of one robot.

    Raises:
        BadInput: MuJoCo or the models are not installed; says how to install them.
    """
    load_mujoco()
    find_model("go1", None)
    if quick:
        return request_worlds(GO1, QUICK_NUMBER, QUICK)
    return [request for robot, number in NUMBER.items() for request in request_worlds(robot, number, CYCLES)]


STUDY = Study(
    title="The guard of learning on robots",
    question="Can a robot that learns walk less well than with feedback alone, when its learning is guarded?",
    runs=runs,
    measures={ERROR: measure_error},
    findings={f"guarded_{robot}": never_worse(robot) for robot in NUMBER},
    figures={"errors": draw_errors},
    tables={"worlds": table_worlds},
    values=count_worlds,
)

if __name__ == "__main__":
    main(__file__)
