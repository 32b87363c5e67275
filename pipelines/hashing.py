"""Hashing: from 64 words to a row for every visited cell (left open by Lin & Song 1997, section 4).

``python -m pipelines.hashing`` gives the CMACs of one leg and of the quadruped less and less memory, for short runs
of the paper's rule and for long ones of a rule that lasts.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from cmacexp.cli.study import main
from cmacexp.data.stored_run import StoredRun
from cmacexp.report.figures import Panel, Series, draw
from cmacexp.study import Criterion, Finding, Request, Results, Study, at_least, at_most, grid
from cmacexp.study.interval import estimate
from cmacexp.typing import Array
from pipelines.hashing_cost import addressing_cost

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LEG, WALK = "one leg", "quadruped"
MEMORIES = {LEG: (*(2**n for n in range(9, 17)), 2**18, 2**20), WALK: (*(2**n for n in range(9, 17)), 2**18)}
"""Bytes of one leg; the last is the paper's, the first the least that 32 layers of two outputs allow."""
PAPER, LASTING = "paper's rule", "leakage, lead 1"
RULES = {
    PAPER: ("learning.rule=paper", "learning.lead=0"),
    LASTING: ("learning.rule=leakage", "learning.lead=1"),
}
CYCLES, QUICK_CYCLES = {PAPER: 20, LASTING: 1000}, 4
WITHOUT_BODY_FORCES = "gait.load_ramp=0.12"
"""Under a body, errors of force at touch-down would hide what collisions cost."""
SIDES = ("transfer_rmse_x", "transfer_rmse_y")
CROWDED = 0.5
"""Share of the visited cells that collide from which memory counts as crowded."""
AS_GOOD = 1.25
"""Errors over those without collisions up to which hashing costs little."""


def runs(quick: bool) -> list[Request]:
    """Every memory and seed, and a row for every visited cell, by machine and rule."""
    found = []
    for machine, scenario in ((LEG, "one_leg"), (WALK, "quadruped")):
        memories = MEMORIES[machine][2::7] if quick else MEMORIES[machine]
        for rule, overrides in RULES.items():
            ramp = [WITHOUT_BODY_FORCES] if (machine, rule) == (WALK, LASTING) else []
            cycles = f"cycles={QUICK_CYCLES if quick else CYCLES[rule]}"
            common = (f"scenario={scenario}", cycles, "record.cycles=[1]", *overrides, *ramp)
            labels: dict[str, Any] = {"machine": machine, "rule": rule}
            found += grid(*common, over={"cmac.memory_bytes": memories}, seeded=True, **labels)
            found += grid(*common, "cmac.addressing=visited", **labels)
    return found


def colliding(run: StoredRun) -> float:
    """Share of the visited cells of all legs that share a row with another one."""
    return _sum(run, "cells_colliding") / _sum(run, "cells_visited")


def rows_per_cell(run: StoredRun) -> float:
    """Rows of memory for each visited cell."""
    return _sum(run, "rows") / _sum(run, "cells_visited")


def _sum(run: StoredRun, key: str) -> int:
    return sum(int(leg[key]) for leg in run.manifest["memory"])


def worsening(results: Results) -> Array:
    """(hashed runs,): errors at the end over those without collisions, in x or y, the larger; inf if a run ended."""
    hashed, free = (results.select({"cmac.addressing": kind}) for kind in ("hashed", "visited"))
    ratios: Array = np.max([hashed.end(side) / free.end(side)[0] for side in SIDES], axis=0)
    return ratios


def worsening_where_crowded(results: Results) -> Array:
    """:func:`worsening` of the memories in which at least half of the visited cells collide."""
    hashed = results.select({"cmac.addressing": "hashed"})
    return worsening(results)[hashed.measure("colliding") >= CROWDED]


def completed_where_crowded(results: Results) -> list[bool]:
    """Whether each run with such a memory reached its end."""
    hashed = results.select({"cmac.addressing": "hashed"})
    return np.array(hashed.completed)[hashed.measure("colliding") >= CROWDED].tolist()


def _group(machine: str, rule: str) -> dict[str, Any]:
    return {"machine": machine, "rule": rule}


FINDINGS = {
    f"accurate_{machine}_{rule}": Finding(
        [
            Criterion(
                "errors at the end where at least half of the visited cells collide, over those without collisions",
                worsening_where_crowded,
                at_most(AS_GOOD),
                of=_group(machine, rule),
            )
        ],
        yes=f"With {name}, crowded memory costs little accuracy: errors end at {{value}} times those "
        "without collisions.",
        no=f"With {name}, crowded memory costs accuracy: errors end at {{value}} times those without collisions.",
        unclear=f"With {name}, the runs do not decide whether crowded memory costs accuracy: errors end at {{value}} "
        "times those without collisions.",
    )
    for machine in (LEG, WALK)
    for rule, name in ((PAPER, f"the {PAPER}"), (LASTING, LASTING))
} | {
    f"stable_{machine}": Finding(
        [
            Criterion(
                f"runs that complete where at least half of the visited cells collide, {rule}",
                completed_where_crowded,
                at_least(0.8),
                unit="%",
                scale=100.0,
                of=_group(machine, rule),
            )
            for rule in RULES
        ],
        yes=f"Runs with crowded memory complete: {{value}} with the {PAPER}, {{values[1]}} with {LASTING}.",
        no=f"Many runs with crowded memory end early: {{value}} complete with the {PAPER}, {{values[1]}} with "
        f"{LASTING}.",
        unclear="The runs do not decide whether crowded memory ends runs early: {value} complete with the "
        f"{PAPER}, {{values[1]}} with {LASTING}.",
    )
    for machine in (LEG, WALK)
}


def _panel(results: Results, title: str, y: str, sample: Any, log: str = "xy") -> Panel:
    """A value over rows per visited cell, a line for each rule; without collisions it is a line of its own."""
    series = []
    for rule, own in results.by("rule").items():
        groups = own.select({"cmac.addressing": "hashed"}).by("cmac.memory_bytes").values()
        found = [(float(g.measure("rows_per_cell").mean()), estimate(sample(g))) for g in groups]
        found = [(x, each) for x, each in sorted(found, key=lambda pair: pair[0]) if np.isfinite(each.value)]
        x, spread = [x for x, _ in found], [each for _, each in found]
        wide = [each.method != "guard band" for each in spread]
        low = [each.low if is_wide else each.value for each, is_wide in zip(spread, wide, strict=True)]
        high = [each.high if is_wide else each.value for each, is_wide in zip(spread, wide, strict=True)]
        series.append(Series(rule, x, [each.value for each in spread], low, high))
        free = sample(own.select({"cmac.addressing": "visited"}))
        series.append(Series(f"{rule}, no collision", x, np.full(len(x), free[0])))
    return Panel(title, "rows per visited cell", y, series, log=log)


def draw_memory(results: Results) -> "Figure":
    """Collisions and errors at the end over rows per visited cell."""
    panels = [
        _panel(results, "collisions", "visited cells that collide, %", lambda r: 100 * r.measure("colliding"), "x")
    ]
    for side in ("x", "y"):
        panels.append(
            _panel(
                results,
                f"error in {side}",
                "error at the end, mm",
                lambda r, s=side: 1e3 * r.end(f"transfer_rmse_{s}"),
            )
        )
    return draw(panels, columns=3)


def table(results: Results) -> "pd.DataFrame":
    """Every memory under every rule."""
    import pandas as pd

    rows = []
    for rule, own in results.by("rule").items():
        for (kind, memory), group in {
            (kind, memory): part
            for kind, kinds in own.by("cmac.addressing").items()
            for memory, part in kinds.by("cmac.memory_bytes").items()
        }.items():
            x, y = (estimate(1e3 * group.end(side)) for side in SIDES)
            rows.append(
                {
                    "rule": rule,
                    "words of a leg": "a row for each visited cell" if kind == "visited" else f"{memory // 8}",
                    "rows per cell": float(group.measure("rows_per_cell").mean()),
                    "colliding, %": 100.0 * float(group.measure("colliding").mean()),
                    "error in x, mm": x.value,
                    "error in y, mm": y.value,
                    "completed": f"{sum(group.completed)} of {len(group)}",
                }
            )
    return pd.DataFrame(rows)


def values(results: Results) -> dict[str, Any]:
    """Settings of the runs, and costs of addressing on the machine that wrote the page, ns per sample."""
    took = results.computed["addressing"].set_index("way")["time"]
    paper, lasting = (results.select(machine=WALK, rule=rule) for rule in RULES)
    return {
        "hash_cost": took["hashed"] - took["neither"],
        "visited_cost": took["visited"] - took["neither"],
        "cycles": {"paper": paper.value("cycles"), "lasting": lasting.value("cycles")},
        "ramp": lasting.value("gait.load_ramp"),
        "crowded": 100.0 * CROWDED,
    }


def _only(machine: str, work: Any) -> Any:
    return lambda results: work(results.select(machine=machine))


STUDY = Study(
    title="Hashing: from 64 words to a row for every cell",
    question="What do collisions of hashed memory cost in accuracy and stability, and how much memory avoids them?",
    runs=runs,
    measures={"colliding": colliding, "rows_per_cell": rows_per_cell},
    computed={"addressing": addressing_cost},
    findings=FINDINGS,
    figures={"leg": _only(LEG, draw_memory), "walk": _only(WALK, draw_memory)},
    tables={"leg": _only(LEG, table), "walk": _only(WALK, table)},
    values=values,
)

if __name__ == "__main__":
    main(__file__)
