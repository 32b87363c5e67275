"""How large a CMAC must be: layers, width of a cell, inputs, memory (Lin & Song 1997, section 4).

``python -m pipelines.cmac_size`` changes one thing of the paper's CMAC at a time, for one leg and for the quadruped.
"""

from typing import Any

from cmacexp.cli.study import main
from cmacexp.study import Claim, Criterion, Finding, Request, Results, Study, at_least, at_most, grid
from cmacexp.study.statements import Limit
from pipelines.cmac_size_figures import draw_collisions, draw_sizes, draw_walk, size_table
from pipelines.cmac_size_measures import (
    ELEMENTS,
    FREE,
    INPUTS,
    LAYERS,
    MEMORY,
    SIZE,
    against,
    colliding,
    rows_per_cell,
    worsening_where,
)

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
WIDE, ANGLES = 9, "[angle]"
SMALL_PART = 16
"""The paper's memory over one that counts as little."""
AS_GOOD, MUCH_WORSE, FASTER = 1.25, 2.0, 0.8
"""Errors over others: the largest that count as good, the least as much worse, the largest early on as faster."""
NOTICEABLE, CROWDED, ROOMY = 0.05, 0.5, 2.0
"""Shares of the visited cells that collide: noticeable, crowded; rows for each cell from which memory is roomy."""


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


def _compared(
    machine: str, key: str, value: Any, cycle: int | None, holds: Limit, fails: Limit | None = None
) -> Criterion:
    """Errors with one value over those with the paper's."""
    paper = PAPER[machine][key]
    when = "at the end" if cycle is None else f"in cycle {cycle}"
    quantity = f"{machine}: errors {when} with {key}={value}, over those with {paper}"
    return Criterion(
        quantity, against({key: value}, {key: paper}, cycle), holds, fails, of={"machine": machine, "varied": key}
    )


def _paper_size(machine: str) -> dict[str, Any]:
    return {"machine": machine, "varied": MEMORY, MEMORY: PAPER[machine][MEMORY]}


RATE = [
    Criterion(
        f"visited cells that collide, {machine}, the paper's size", lambda results: results.measure("colliding"),
        at_most(NOTICEABLE), at_least(CROWDED), unit="%", scale=100.0, of=_paper_size(machine),
    )
    for machine in SCENARIOS
]  # fmt: skip
ROBUST = [
    Criterion(
        f"{machine}: errors at the end where at least half of the visited cells collide, over those without",
        worsening_where("colliding", CROWDED), at_most(AS_GOOD), at_least(MUCH_WORSE),
        of={"machine": machine, "varied": [MEMORY, FREE]},
    )
    for machine in SCENARIOS
]  # fmt: skip
LITTLE = [
    _compared(m, MEMORY, PAPER[m][MEMORY] // SMALL_PART, None, at_most(AS_GOOD), at_least(MUCH_WORSE))
    for m in SCENARIOS
]
ROOM = Criterion(
    f"one leg, any layers: errors at the end with at least {ROOMY:g} rows for each visited cell, over those without "
    "collisions",
    worsening_where("rows_per_cell", ROOMY), at_most(AS_GOOD), of={"machine": LEG, "varied": [MEMORY, SIZE, FREE]},
)  # fmt: skip
WEIGHT = Criterion(
    f"one leg, crowded memory with as many rows for each visited cell: errors at the end with {FEW} layers over "
    f"those with {MANY}",
    against({LAYERS: FEW, MEMORY: WITH_LAYERS[FEW][0]}, {LAYERS: MANY, MEMORY: WITH_LAYERS[MANY][0]}),
    at_least(AS_GOOD), of={"machine": LEG, "varied": SIZE},
)  # fmt: skip
WIDER = f"Cells {(PAPER[LEG][ELEMENTS] - 1) / (WIDE - 1):g} times as wide as the paper's"
RATE_WORDS = "by choosing proper generalisation size and memory the rate of collision stays below a noticeable level"
CLAIMS = {
    "rate": Claim(RATE_WORDS, "section 4", RATE),
    "robust": Claim("CMAC learning is robust to collisions", "section 4", ROBUST),
    "little": Claim(
        "a complex system is handled with little hardware (a board with 1 MB)", "sections 5, 6.3", LITTLE
    ),
}
FINDINGS = {
    "width_early": Finding(
        [_compared(machine, ELEMENTS, WIDE, EARLY, at_most(FASTER)) for machine in SCENARIOS],
        yes=f"{WIDER} learn faster on one leg and on four.",
        no=f"{WIDER} do not learn faster on both machines.",
        unclear=f"{WIDER}: whether they learn faster on both machines is unclear.",
    ),
    "width_end": Finding(
        [_compared(machine, ELEMENTS, WIDE, None, at_most(AS_GOOD)) for machine in SCENARIOS],
        yes="At the end of the runs CMACs with such cells are about as accurate as the paper's, or more.",
        no="At the end of the runs CMACs with such cells are not as accurate as the paper's on both machines.",
        unclear="Whether CMACs with such cells are as accurate as the paper's at the end of the runs is unclear.",
    ),
    "layers": Finding(
        [_compared(LEG, LAYERS, n, cycle, at_most(AS_GOOD)) for n in (FEW, MANY) for cycle in (EARLY, None)],
        yes=f"On one leg {FEW} and {MANY} layers are about as accurate as the paper's number, or more.",
        no=f"On one leg {FEW} or {MANY} layers are clearly less accurate than the paper's number.",
        unclear=f"Whether {FEW} and {MANY} layers are as accurate as the paper's number on one leg is unclear.",
    ),
    "inputs": Finding(
        [_compared(LEG, INPUTS, ANGLES, EARLY, at_most(FASTER))],
        yes="On this one path of one leg, a CMAC of the angles alone learns faster than one of all inputs.",
        no="On this one path of one leg, a CMAC of the angles alone does not learn faster than one of all inputs.",
        unclear="Whether a CMAC of the angles alone learns faster than one of all inputs is unclear.",
    ),
    "room": Finding(
        [ROOM],
        yes=f"With {ROOMY:g} rows of memory for each visited cell or more, collisions cost one leg little accuracy.",
        no=f"Collisions cost one leg accuracy even with {ROOMY:g} rows of memory for each visited cell or more.",
        unclear=f"Whether {ROOMY:g} rows of memory for each visited cell are enough for one leg is unclear.",
    ),
    "weight": Finding(
        [WEIGHT],
        yes=f"In equally crowded memory {FEW} layers are less accurate than {MANY}.",
        no=f"In equally crowded memory {FEW} layers are not clearly less accurate than {MANY}.",
        unclear=f"Whether {FEW} layers are less accurate than {MANY} in equally crowded memory is unclear.",
    ),
}


def values(results: Results) -> dict[str, Any]:
    """The paper's sizes, and the memory that a row for each visited cell would take, KB."""
    found: dict[str, Any] = {"cycles": results.value("cycles")}
    for name, machine in (("leg", LEG), ("walk", WALK)):
        base, size = results.select(_paper_size(machine)), PAPER[machine]
        found[name] = {
            "layers": size[LAYERS], "elements": size[ELEMENTS], "memory": size[MEMORY] // 1024,
            "width": base.value("cmac.range_factor") / (size[ELEMENTS] - 1),
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
        "sizes": lambda results: draw_sizes(results.select(machine=LEG), PAPER[LEG]),
        "collisions": lambda results: draw_collisions(results.select(machine=LEG)),
        "walk": lambda results: draw_walk(results.select(machine=WALK), PAPER[WALK]),
    },
    tables={
        "leg": lambda results: size_table(results.select(machine=LEG), EARLY),
        "walk": lambda results: size_table(results.select(machine=WALK), EARLY),
    },
    values=values,
)

if __name__ == "__main__":
    main(__file__)
