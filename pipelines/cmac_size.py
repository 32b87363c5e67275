"""How large a CMAC must be: layers, width of a cell, inputs, memory (Lin & Song 1997, section 4).

``python -m pipelines.cmac_size`` changes one thing of the paper's CMAC at a time, for one leg and for the quadruped.
"""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from cmacexp.commands.study import main
from cmacexp.report.figures import Panel, draw
from cmacexp.study import Claim, Criterion, Finding, Request, Results, Study, at_least, at_most, grid
from cmacexp.study.curves import over_setting
from cmacexp.study.statements import Limit, percent
from cmacexp.study.tables import tabulate
from cmacexp.typing import Array
from pipelines.common_memory import SIDES, colliding, rows_per_cell, where_hashed, worsening

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LAYERS, ELEMENTS, INPUTS, MEMORY = "cmac.layers", "cmac.resolution_elements", "cmac.inputs", "cmac.memory_bytes"
SIZE, FREE = "layers and memory", "no collisions"
"""What is varied besides one config key."""
LEG, WALK = "one leg", "quadruped"
SCENARIOS = {LEG: "one_leg", WALK: "quadruped"}
PAPER: dict[str, dict[str, Any]] = {
    LEG: {LAYERS: 32, ELEMENTS: 33, INPUTS: "[angle, velocity, acceleration]", MEMORY: 2**20},
    WALK: {LAYERS: 32, ELEMENTS: 33, MEMORY: 2**18},
}
"""The sizes of the paper, or taken where it is silent."""
MEMORIES = tuple(2**n for n in range(9, 17))
"""Bytes of one leg; the first is the least that 32 layers of two outputs allow."""
OTHERS: dict[str, dict[str, tuple[Any, ...]]] = {
    LEG: {
        LAYERS: (8, 2, 128),
        ELEMENTS: (9, 5, 17, 65, 129),
        INPUTS: ("[angle]", "[angle, velocity]"),
        MEMORY: (*MEMORIES, 2**18),
    },
    WALK: {LAYERS: (8, 128), ELEMENTS: (9, 65), MEMORY: MEMORIES},
}
"""What is tried besides; the quick form takes the first alone."""
FEW, MANY = 8, 128
WITH_LAYERS = {FEW: (2**12, 2**10, 2**14, 2**16), MANY: (2**16, 2**12, 2**14, 2**18)}
"""Memories tried with other numbers of layers; with the first ones a visited cell has as many rows in both."""
EARLY, CYCLES, QUICK_CYCLES = 5, 20, 6
WIDE = 9
"""Resolution elements of cells that are wider than the paper's."""
AS_GOOD, MUCH_WORSE, FASTER = 1.25, 2.0, 0.8
"""Errors over others: the largest that count as good, the least as much worse, the largest early on as faster."""
CROWDED, ROOMY = 0.5, 2.0
"""Share of the visited cells that collide in crowded memory; rows for each cell from which memory is roomy."""


def runs(quick: bool) -> list[Request]:
    """Every size and seed by machine and by what is varied, the paper's size in each; and one without collisions."""
    found = []
    for machine, scenario in SCENARIOS.items():
        common = (f"scenario={scenario}", f"cycles={QUICK_CYCLES if quick else CYCLES}", "record.cycles=[1]")
        for key, others in OTHERS[machine].items():
            values = (*(others[:1] if quick else others), PAPER[machine][key])
            found += grid(*common, over={key: values}, seeded=True, machine=machine, varied=key)
        found += grid(*common, "cmac.addressing=visited", machine=machine, varied=FREE)
        for layers, memories in WITH_LAYERS.items() if machine == LEG else ():
            sizes = {LAYERS: [layers], MEMORY: memories[:1] if quick else memories}
            found += grid(*common, over=sizes, seeded=True, machine=machine, varied=SIZE)
    return found


def _against(own: dict[str, Any], base: dict[str, Any], cycle: int | None = None) -> Any:
    return lambda results: worsening(results.select(own), results.select(base), cycle)


def _compared(
    machine: str, key: str, value: Any, cycle: int | None, holds: Limit, fails: Limit | None = None
) -> Criterion:
    """Errors with one value over those with the paper's."""
    paper, when = PAPER[machine][key], "at the end" if cycle is None else f"in cycle {cycle}"
    quantity = f"{machine}: errors {when} with {key}={value}, over those with {paper}"
    of = {"machine": machine, "varied": key}
    return Criterion(quantity, _against({key: value}, {key: paper}, cycle), holds, fails, of=of)


def _paper_size(machine: str) -> dict[str, Any]:
    return {"machine": machine, "varied": MEMORY, MEMORY: PAPER[machine][MEMORY]}


WIDER = f"Cells {(PAPER[LEG][ELEMENTS] - 1) / (WIDE - 1):g} times as wide as the paper's"
CLAIMS = {
    "rate": Claim(
        "by choosing proper generalisation size and memory the rate of collision stays below a noticeable level",
        "section 4",
        [
            percent(
                f"visited cells that collide, {machine}, the paper's size",
                lambda results: results.measure("colliding"),
                at_most(0.05),
                at_least(CROWDED),
                of=_paper_size(machine),
            )
            for machine in SCENARIOS
        ],
    ),
    "robust": Claim(
        "CMAC learning is robust to collisions",
        "section 4",
        [
            Criterion(
                f"{machine}: errors at the end where at least half of the visited cells collide, over those without",
                where_hashed("colliding", CROWDED),
                at_most(AS_GOOD),
                at_least(MUCH_WORSE),
                of={"machine": machine, "varied": [MEMORY, FREE]},
            )
            for machine in SCENARIOS
        ],
    ),
    "little": Claim(
        "a complex system is handled with little hardware (a board with 1 MB)",
        "sections 5, 6.3",
        [
            _compared(machine, MEMORY, PAPER[machine][MEMORY] // 16, None, at_most(AS_GOOD), at_least(MUCH_WORSE))
            for machine in SCENARIOS
        ],
    ),
}
FINDINGS = {
    "width_early": Finding(
        [_compared(machine, ELEMENTS, WIDE, EARLY, at_most(FASTER)) for machine in SCENARIOS],
        yes=f"{WIDER} learn faster on one leg and on four.",
        no=f"{WIDER} do not learn faster on both machines.",
    ),
    "width_end": Finding(
        [_compared(machine, ELEMENTS, WIDE, None, at_most(AS_GOOD)) for machine in SCENARIOS],
        yes="At the end of the runs CMACs with such cells are about as accurate as the paper's, or more.",
        no="At the end of the runs CMACs with such cells are not as accurate as the paper's on both machines.",
    ),
    "layers": Finding(
        [_compared(LEG, LAYERS, n, cycle, at_most(AS_GOOD)) for n in (FEW, MANY) for cycle in (EARLY, None)],
        yes=f"On one leg {FEW} and {MANY} layers are about as accurate as the paper's number, or more.",
        no=f"On one leg {FEW} or {MANY} layers are clearly less accurate than the paper's number.",
    ),
    "inputs": Finding(
        [_compared(LEG, INPUTS, "[angle]", EARLY, at_most(FASTER))],
        yes="On this one path of one leg, a CMAC of the angles alone learns faster than one of all inputs.",
        no="On this one path of one leg, a CMAC of the angles alone does not learn faster than one of all inputs.",
    ),
    "room": Finding(
        [
            Criterion(
                f"one leg, any layers: errors at the end with at least {ROOMY:g} rows for each visited cell, over "
                "those without collisions",
                where_hashed("rows_per_cell", ROOMY),
                at_most(AS_GOOD),
                of={"machine": LEG, "varied": [MEMORY, SIZE, FREE]},
            )
        ],
        yes=f"With {ROOMY:g} rows of memory for each visited cell or more, collisions cost one leg little accuracy.",
        no=f"Collisions cost one leg accuracy even with {ROOMY:g} rows of memory for each visited cell or more.",
    ),
    "weight": Finding(
        [
            Criterion(
                f"one leg, crowded memory with as many rows for each visited cell: errors at the end with {FEW} "
                f"layers over those with {MANY}",
                _against({LAYERS: FEW, MEMORY: WITH_LAYERS[FEW][0]}, {LAYERS: MANY, MEMORY: WITH_LAYERS[MANY][0]}),
                at_least(AS_GOOD),
                of={"machine": LEG, "varied": SIZE},
            )
        ],
        yes=f"In equally crowded memory {FEW} layers are less accurate than {MANY}.",
        no=f"In equally crowded memory {FEW} layers are not clearly less accurate than {MANY}.",
    ),
}


def _cycle(side: str, cycle: int, results: Results) -> Array:
    return 1e3 * results.at(cycle, side)


def _end(name: str, results: Results) -> Array:
    return 1e3 * results.end(name)


def _kilobytes(results: Results) -> float:
    return results.value(MEMORY) / 1024


def _width(results: Results) -> float:
    return float(results.value("cmac.range_factor") / (results.value(ELEMENTS) - 1))


def draw_sizes(results: Results) -> "Figure":
    """Errors in x and y over layers, width of a cell and memory; a line for each cycle."""
    axes: dict[str, tuple[str, Any]] = {
        LAYERS: ("layers", lambda own: own.value(LAYERS)),
        ELEMENTS: ("width of a cell / planned span", _width),
        MEMORY: ("memory of a leg, KB", _kilobytes),
    }
    panels = []
    for side in SIDES:
        for key, (axis, place) in axes.items():
            varied, series = results.select(varied=key), []
            for cycle in [cycle for cycle in (5, 10, 20) if cycle <= results.value("cycles")]:
                line = over_setting(varied, key, "", partial(_cycle, side, cycle), place=place).series[0]
                series.append(replace(line, name=f"cycle {cycle}"))
            limits = [place(varied.select({key: PAPER[LEG][key]}))]
            panels.append(
                Panel(f"error in {side[-1]}", axis, "transfer error, mm", series, log="xy", x_limits=limits)
            )
    return draw(panels, columns=3, height=2.2)


def size_table(results: Results) -> "pd.DataFrame":
    """Every size: errors early and at the end, use of memory; means over seeds."""
    samples: dict[str, Any] = {
        **{f"{side[-1]}, cycle {EARLY}, mm": partial(_cycle, side, EARLY) for side in SIDES},
        **{f"{side[-1]}, end, mm": partial(_end, side) for side in SIDES},
        "rows per visited cell": lambda own: own.measure("rows_per_cell"),
        "colliding, %": lambda own: 100.0 * own.measure("colliding"),
    }
    means = {title: lambda own, sample=sample: sample(own).mean() for title, sample in samples.items()}
    keys = (LAYERS, ELEMENTS, INPUTS, MEMORY, "cmac.addressing")
    by = {key: key.removeprefix("cmac.").replace("_", " ") for key in keys if len(results.values(key)) > 1}
    return tabulate(results, by, means).replace(PAPER[LEG][INPUTS], "all")


def values(results: Results) -> dict[str, Any]:
    """The paper's sizes, and the memory that a row for each visited cell would take, KB."""
    found: dict[str, Any] = {"cycles": results.value("cycles")}
    for name, machine in (("leg", LEG), ("walk", WALK)):
        base, size = results.select(_paper_size(machine)), PAPER[machine]
        found[name] = {
            "layers": size[LAYERS], "elements": size[ELEMENTS], "memory": size[MEMORY] // 1024,
            "width": _width(base),
            "room": size[MEMORY] / 1024 / float(base.measure("rows_per_cell").mean()),
        }  # fmt: skip
    return found


STUDY = Study(
    title="How large a CMAC must be",
    question="How do layers, width of a cell, inputs, memory and collisions affect what a CMAC achieves?",
    runs=runs,
    measures={"colliding": colliding, "rows_per_cell": rows_per_cell},
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "sizes": lambda results: draw_sizes(results.select(machine=LEG)),
    },
    tables={
        "leg": lambda results: size_table(results.select(machine=LEG)),
        "walk": lambda results: size_table(results.select(machine=WALK)),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
