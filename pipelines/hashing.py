"""Hashing: from 64 words to a row for every visited cell (left open by Lin & Song 1997, section 4).

``python -m pipelines.hashing`` gives the CMACs of one leg and of the quadruped less and less memory: in short runs
of the paper's rule under the paper's conditions, and in long, randomised runs with ``learning=lasting``.
"""

from functools import partial

from cmacexp.study import Declared, Figure, Results, declare, draw, over_setting
from pipelines.common_results import (
    MEMORY_MEASURES,
    hashed_where,
    worsening,
    worst_in_worlds,
)
from pipelines.worlds import FEWER, draw_worlds

MEMORY = "cmac.memory_bytes"
PAPER, LASTING = "paper's rule", "lasting, in worlds"
MACHINES: dict[str, tuple[str, str, list[str], list[int]]] = {
    "one leg": ("one_leg", "one_leg", ["reference=aware"], [2**18, 2**20]),
    "quadruped": ("quadruped", "quadruped_lasting", [], [2**18]),
}
"""Scenario for the paper's rule; scenario for lasting learning, and its overrides; largest memories, bytes.

The last memory is the paper's.
"""


def _runs(machine: str) -> list[Declared]:
    """Return runs with every memory, and with one row per visited cell, of the paper's rule and of lasting learning.

    The paper's rule runs with every seed, lasting learning in every world. The first memory is the least that 32
    layers of two outputs allow.
    """
    published, scenario, more, largest = MACHINES[machine]
    memories = {f"{n}": [f"{MEMORY}={n}"] for n in (*(2**n for n in range(9, 17)), *largest)}
    over = {"memory": {**memories, "visited": ["cmac.addressing=visited"]}}
    quick = {"cycles": 4}
    return [
        {"set": [f"scenario={published}", "cycles=20", "record.cycles=[1]"], "quick": quick, "over": over,
         "seeds": True, "labels": {"machine": machine, "rule": PAPER}},
        {"set": [f"scenario={scenario}", "learning=lasting", "learning.guard=none", *more, "cycles=300",
                 "record.cycles=[1]"],
         "quick": quick, "over": {"world": draw_worlds(scenario, FEWER), **over},
         "labels": {"machine": machine, "rule": LASTING}},
    ]  # fmt: skip


def draw_memory(results: Results) -> Figure:
    """Draw collisions, and final errors relative to those without collisions, over rows per visited cell."""
    hashed = results.select({"cmac.addressing": "hashed"})
    free = results.select({"cmac.addressing": "visited"}).by("rule")
    axes: Declared = {
        "by": "rule", "axis": "rows per visited cell",
        "place": lambda runs: float(runs.measure("rows_per_cell").mean()),
    }  # fmt: skip
    return draw(
        [
            over_setting(hashed, MEMORY, y, sample, title=title, log=log, **axes)
            for title, y, sample, log in (
                ("visited cells that collide", "share, %", lambda runs: 100.0 * runs.measure("colliding"), "x"),
                (
                    "error at the end, over that without collisions",
                    "ratio",
                    lambda runs: worsening(runs, free[runs.value("rule")]),
                    "xy",
                ),
            )
        ]
    )  # fmt: skip


STUDY = declare(
    title="Hashing: from 64 words to a row for every cell",
    question="What do collisions of hashed memory cost in accuracy and stability, and how much memory avoids them?",
    runs=[runs for machine in MACHINES for runs in _runs(machine)],
    measures=MEMORY_MEASURES,
    findings={
        f"{name}_{machine}": finding
        for machine, who in (("one leg", "one leg"), ("quadruped", "the quadruped"))
        for name, finding in {
            "accurate": {
                "says": f"Randomised runs, {who}: with at least half of the visited cells colliding, the final "
                "error is at most 1.25 times that without collisions",
                "quantity": "largest error at the end where at least half of the visited cells collide, over that "
                "without collisions",
                "value": partial(worst_in_worlds, measure="colliding", least=0.5),
                "of": {"machine": machine, "rule": LASTING}, "limit": "at most 1.25",
            },
            "room": {
                "says": f"Randomised runs, {who}: with 2 rows of memory for each visited cell or more the final "
                "error is at most 1.25 times that without collisions",
                "quantity": "largest error at the end with at least 2 rows for each visited cell, over that without "
                "collisions",
                "value": partial(worst_in_worlds, measure="rows_per_cell", least=2.0),
                "of": {"machine": machine, "rule": LASTING}, "limit": "at most 1.25",
            },
            "stable": {
                "says": f"Runs of {who} with crowded memory complete",
                "quantity": "runs that complete where at least half of the visited cells collide",
                "value": lambda results: hashed_where(results, "colliding", 0.5).completed,
                "of": {"machine": machine}, "each": {"rule": [PAPER, LASTING]}, "limit": "at least 80 %",
            },
        }.items()
    },
    figures={
        "leg": lambda results: draw_memory(results.select(machine="one leg")),
        "walk": lambda results: draw_memory(results.select(machine="quadruped")),
    },
)  # fmt: skip
