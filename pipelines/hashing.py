"""Hashing: from 64 words to a row for every visited cell (left open by Lin & Song 1997, section 4).

``python -m pipelines.hashing`` gives the CMACs of one leg and of the quadruped less and less memory: for short runs
of the paper's rule under its own conditions, and for long, randomised ones of learning that lasts.
"""

from functools import partial
from typing import Any

from cmacexp.study import (
    Criterion,
    DataFrame,
    Figure,
    Finding,
    Request,
    Results,
    Study,
    at_least,
    at_most,
    draw,
    grid,
)
from cmacexp.study.curves import over_setting
from cmacexp.study.tables import completed, tabulate
from cmacexp.typing import Array
from pipelines.common_memory import (
    colliding,
    hashed,
    rows_per_cell,
    where_hashed,
    worsening_in_worlds,
    worst_in_worlds,
)
from pipelines.common_results import percent
from pipelines.worlds import FEWER, in_worlds

LEG, WALK = "one leg", "quadruped"
MEMORY = "cmac.memory_bytes"
MEMORIES = {LEG: (*(2**n for n in range(9, 17)), 2**18, 2**20), WALK: (*(2**n for n in range(9, 17)), 2**18)}
"""Bytes of one leg; the last is the paper's, the first the least that 32 layers of two outputs allow."""
PAPER, LASTING = "paper's rule", "lasting, in worlds"
SCENARIOS = {LEG: ("one_leg", "one_leg", ("reference=aware",)), WALK: ("quadruped", "quadruped_lasting", ())}
"""Scenario of the paper's rule; of learning that lasts, and further overrides."""
CYCLES, QUICK_CYCLES = {PAPER: 20, LASTING: 300}, 4
CROWDED, ROOMY, LITTLE = 0.5, 2.0, 1.25
"""Share of the visited cells that collide from which memory is crowded; rows for each from which it is roomy; and the
largest error over that without collisions that counts as little."""


def runs(quick: bool) -> list[Request]:
    """Every memory, and a row for every visited cell, by machine and rule, for every seed or in every world."""
    found = []
    for machine, (published, lasting, more) in SCENARIOS.items():
        memories = MEMORIES[machine][2::7] if quick else MEMORIES[machine]
        cycles = {rule: f"cycles={QUICK_CYCLES if quick else number}" for rule, number in CYCLES.items()}
        labels: dict[str, Any] = {"machine": machine, "rule": PAPER}
        common = (f"scenario={published}", cycles[PAPER], "record.cycles=[1]")
        found += grid(*common, over={MEMORY: memories}, seeded=True, **labels)
        found += grid(*common, "cmac.addressing=visited", seeded=True, **labels)
        labels["rule"] = LASTING
        words = ("learning=lasting", "learning.guard=none", *more, cycles[LASTING], "record.cycles=[1]")
        worlds = FEWER[:1] if quick else FEWER
        found += in_worlds(lasting, worlds, *words, over={MEMORY: memories}, **labels)
        found += in_worlds(lasting, worlds, *words, "cmac.addressing=visited", **labels)
    return found


def _costs(what: str, measure: str, least: float, machine: str) -> Criterion:
    return Criterion(
        f"largest error at the end {what}, over that without collisions",
        partial(worst_in_worlds, measure=measure, least=least),
        at_most(LITTLE),
        of={"machine": machine, "rule": LASTING},
    )


def _find(machine: str) -> dict[str, Finding]:
    """The findings of one machine."""
    who = machine if machine == LEG else f"the {machine}"
    rows = f"{ROOMY:g} rows of memory for each visited cell or more"
    complete = [
        percent(
            "runs that complete where at least half of the visited cells collide",
            where_hashed("colliding", CROWDED, lambda results: hashed(results).completed),
            at_least(0.8),
            of={"machine": machine, "rule": rule},
            case=rule,
        )
        for rule in CYCLES
    ]
    return {
        f"accurate_{machine}": Finding(
            [_costs("where at least half of the visited cells collide", "colliding", CROWDED, machine)],
            says=f"Randomised runs, {who}: with at least half of the visited cells colliding, the final "
            f"error is at most {LITTLE:g} times that without collisions",
        ),
        f"room_{machine}": Finding(
            [_costs(f"with at least {ROOMY:g} rows for each visited cell", "rows_per_cell", ROOMY, machine)],
            says=f"Randomised runs, {who}: with {rows} the final error is at most {LITTLE:g} times that "
            "without collisions",
        ),
        f"stable_{machine}": Finding(
            complete,
            says=f"Runs of {who} with crowded memory complete",
        ),
    }


FINDINGS = {**_find(LEG), **_find(WALK)}


def _cost_against(results: Results) -> Any:
    """A sample of hashed runs with one rule: errors over those of the run of the same world without collisions."""
    free = results.select({"cmac.addressing": "visited"}).by("rule")
    return lambda own: worsening_in_worlds(own, free[own.value("rule")])


def draw_memory(results: Results) -> Figure:
    """Collisions, and errors at the end over those without them, over rows per visited cell."""

    def place(own: Results) -> float:
        return float(own.measure("rows_per_cell").mean())

    def share(own: Results) -> Array:
        return 100.0 * own.measure("colliding")

    axes: dict[str, Any] = {"by": "rule", "axis": "rows per visited cell", "place": place}
    panels = {
        "visited cells that collide": ("share, %", share, "x"),
        "error at the end, over that without collisions": ("ratio", _cost_against(results), "xy"),
    }
    return draw(
        [
            over_setting(hashed(results), MEMORY, y, sample, title=title, log=log, **axes)
            for title, (y, sample, log) in panels.items()
        ]
    )


def table(results: Results) -> DataFrame:
    """Every memory under every rule."""
    cost = _cost_against(results)
    columns = {
        "rows per cell": lambda own: own.measure("rows_per_cell").mean(),
        "colliding, %": lambda own: 100.0 * own.measure("colliding").mean(),
        "error over that without collisions": lambda own: cost(own).mean(),
        "completed": completed,
    }
    return tabulate(hashed(results), {"rule": "rule", MEMORY: "bytes of a leg"}, columns)


def values(results: Results) -> dict[str, Any]:
    """Settings of the runs."""
    paper, lasting = (results.select(machine=WALK, rule=rule) for rule in CYCLES)
    return {
        "cycles": {"paper": paper.value("cycles"), "lasting": lasting.value("cycles")},
        "worlds": len(FEWER),
        "crowded": 100.0 * CROWDED,
    }


STUDY = Study(
    title="Hashing: from 64 words to a row for every cell",
    question="What do collisions of hashed memory cost in accuracy and stability, and how much memory avoids them?",
    runs=runs,
    measures={"colliding": colliding, "rows_per_cell": rows_per_cell},
    findings=FINDINGS,
    figures={
        "leg": lambda r: draw_memory(r.select(machine=LEG)),
        "walk": lambda r: draw_memory(r.select(machine=WALK)),
    },
    tables={"leg": lambda r: table(r.select(machine=LEG)), "walk": lambda r: table(r.select(machine=WALK))},
    values=values,
)
