"""Hashing: from 64 words to a row for every visited cell (left open by Lin & Song 1997, section 4).

``python -m pipelines.hashing`` gives the CMACs of one leg and of the quadruped less and less memory, for short runs
of the paper's rule and for long ones of a rule that lasts.
"""

from typing import TYPE_CHECKING, Any

from cmacexp.commands.study import main
from cmacexp.study import Criterion, Finding, Request, Results, Study, at_least, at_most, draw, grid
from cmacexp.study.curves import over_setting
from cmacexp.study.statements import percent
from cmacexp.study.tables import completed, tabulate
from cmacexp.typing import Array
from pipelines.common_memory import colliding, hashed, rows_per_cell, where_hashed, worsening

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LEG, WALK = "one leg", "quadruped"
MEMORY = "cmac.memory_bytes"
MEMORIES = {LEG: (*(2**n for n in range(9, 17)), 2**18, 2**20), WALK: (*(2**n for n in range(9, 17)), 2**18)}
"""Bytes of one leg; the last is the paper's, the first the least that 32 layers of two outputs allow."""
PAPER, LASTING = "paper's rule", "leakage, lead 1"
RULES = {
    PAPER: ("learning.rule=paper", "learning.lead=0"),
    LASTING: ("learning.rule=leakage", "learning.lead=1"),
}
CYCLES, QUICK_CYCLES = {PAPER: 20, LASTING: 1000}, 4
CROWDED = 0.5
"""Share of the visited cells that collide from which memory counts as crowded."""


def runs(quick: bool) -> list[Request]:
    """Every memory and seed, and a row for every visited cell, by machine and rule."""
    found = []
    for machine, scenario in ((LEG, "one_leg"), (WALK, "quadruped")):
        memories = MEMORIES[machine][2::7] if quick else MEMORIES[machine]
        for rule, overrides in RULES.items():
            # under a body, errors of force at touch-down would hide what collisions cost
            ramp = ["gait.load_ramp=0.12"] if (machine, rule) == (WALK, LASTING) else []
            cycles = f"cycles={QUICK_CYCLES if quick else CYCLES[rule]}"
            common = (f"scenario={scenario}", cycles, "record.cycles=[1]", *overrides, *ramp)
            labels: dict[str, Any] = {"machine": machine, "rule": rule}
            found += grid(*common, over={MEMORY: memories}, seeded=True, **labels)
            found += grid(*common, "cmac.addressing=visited", **labels)
    return found


FINDINGS = {
    f"accurate_{machine}_{LASTING}": Finding(
        [
            Criterion(
                "errors at the end where at least half of the visited cells collide, over those without collisions",
                where_hashed("colliding", CROWDED),
                at_most(1.25),
                of={"machine": machine, "rule": LASTING},
            )
        ],
        yes=f"With {LASTING}, crowded memory costs little accuracy: errors end at {{value}} times those without "
        "collisions.",
        no=f"With {LASTING}, crowded memory costs accuracy: errors end at {{value}} times those without collisions.",
    )
    for machine in (LEG, WALK)
} | {
    f"stable_{machine}": Finding(
        [
            percent(
                f"runs that complete where at least half of the visited cells collide, {rule}",
                where_hashed("colliding", CROWDED, lambda results: hashed(results).completed),
                at_least(0.8),
                of={"machine": machine, "rule": rule},
            )
            for rule in RULES
        ],
        yes=f"Runs with crowded memory complete: {{value}} with the {PAPER}, {{values[1]}} with {LASTING}.",
        no=f"Many runs with crowded memory end early: {{value}} complete with the {PAPER}, {{values[1]}} with "
        f"{LASTING}.",
    )
    for machine in (LEG, WALK)
}


def _cost_against(results: Results) -> Any:
    """A sample of hashed runs with one rule: their errors over that of the run without collisions."""
    free = results.select({"cmac.addressing": "visited"}).by("rule")
    return lambda own: worsening(own, free[own.value("rule")])


def draw_memory(results: Results) -> "Figure":
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


def table(results: Results) -> "pd.DataFrame":
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
    paper, lasting = (results.select(machine=WALK, rule=rule) for rule in RULES)
    return {
        "cycles": {"paper": paper.value("cycles"), "lasting": lasting.value("cycles")},
        "ramp": lasting.value("gait.load_ramp"), "crowded": 100.0 * CROWDED,
    }  # fmt: skip


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

if __name__ == "__main__":
    main(__file__)
