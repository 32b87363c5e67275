"""The guard of learning: whether a run that learns can end worse than with feedback only.

``python -m pipelines.guard`` (needs the extra ``robots``; its quick form goes without) draws worlds and settings of
one leg, of the quadruped and of two robots by chance, and runs each with feedback only, with guarded and with
unguarded learning. One leg learns on for long with random settings.
"""

from typing import Any

from cmacexp.models.robot_file import package_models
from cmacexp.study import Finding, Request, Results, Study, at_least, grid
from pipelines.common_results import percent
from pipelines.guard_measures import (
    ALONE,
    ENOUGH,
    ERROR,
    GUARDED,
    KINDS,
    LEVEL,
    QUICK,
    QUICK_NUMBER,
    count_worlds,
    draw_errors,
    measure_error,
    measure_level,
    never_worse,
    request_worlds,
    table_worlds,
)
from pipelines.worlds import ALIENGO, GO1, HARD, ONE_LEG, QUADRUPED, draw_long

NUMBER = {ONE_LEG: 240, QUADRUPED: 480, GO1: 45, ALIENGO: 45}
"""Worlds that are drawn: in some feedback only does not complete."""
CYCLES = {ONE_LEG: 100, QUADRUPED: 100, GO1: 40, ALIENGO: 40}
LASTING, LONG_NUMBER, LONG = "long", 110, 10_000
"""The part of the study in which one leg learns for long; its settings, with some of which feedback only fails, and
their cycles."""
ALONE_CYCLES = 20
"""Cycles for which feedback only has to walk with these settings."""
STEADY = 1.2
"""Level over that of the best cycle that counts as kept."""


def runs(quick: bool) -> list[Request]:
    """Every world with feedback only, guarded and unguarded; the long runs.

    Raises:
        BadInput: the models of the robots are not installed; says how to install them.
    """
    requests = []
    for machine, number in NUMBER.items():
        if not quick:
            requests += request_worlds(machine, number, CYCLES[machine])
        elif machine != ALIENGO and (machine != GO1 or package_models()):
            requests += request_worlds(machine, QUICK_NUMBER, QUICK)
    cycles = 3 * QUICK if quick else LONG
    for number in range(QUICK_NUMBER if quick else LONG_NUMBER):
        common = (*HARD[ONE_LEG], *draw_long(number), "warn=false")
        of: dict[str, Any] = {"part": LASTING, "machine": ONE_LEG, "world": number}
        for kind, count in {GUARDED: cycles, ALONE: ALONE_CYCLES}.items():
            lasts = (f"cycles={count}", f"record.cycles=[{count}]")
            requests += grid(*common, *KINDS[kind], *lasts, kind=kind, **of)
    return requests


def find_long(results: Results) -> Results:
    """The long runs with settings with which feedback only walks."""
    alone, guarded = (results.select(part=LASTING, kind=kind).rows for kind in (ALONE, GUARDED))
    walks = {row.settings["world"] for row in alone if row.run.completed}
    return Results([row for row in guarded if row.settings["world"] in walks], results.computed)


FINDINGS = {
    **{f"guarded_{machine}": never_worse(machine) for machine in NUMBER},
    "lasts": Finding(
        [
            percent("long runs that complete", lambda results: find_long(results).completed, at_least(ENOUGH)),
            percent(
                f"long runs whose feedback ends at most {STEADY:g} times as high as in the best cycle",
                lambda results: find_long(results).measure(LEVEL) <= STEADY, at_least(ENOUGH),
            ),
        ],
        says="Guarded learning of one leg lasts with random settings: long runs complete and keep "
            "their feedback low",
    ),
}  # fmt: skip


def values(results: Results) -> dict[str, Any]:
    """Counts that the page names."""
    lasting = find_long(results)
    return {
        **count_worlds(results),
        "long": lasting.value("cycles"),
        "settings": len(lasting),
        "acted": sum(bool(run.manifest["guard"]) for run in lasting.runs),
    }


STUDY = Study(
    title="The guard of learning",
    question="Can a run that learns end worse than with feedback only, when its learning is guarded?",
    runs=runs,
    measures={ERROR: measure_error, LEVEL: measure_level},
    findings=FINDINGS,
    figures={"errors": draw_errors},
    tables={"worlds": table_worlds},
    values=values,
)
