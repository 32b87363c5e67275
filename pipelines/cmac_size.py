"""How large a CMAC must be: layers, width of a cell, inputs, memory (Lin & Song 1997, section 4).

``python -m pipelines.cmac_size`` changes the memory of the paper's CMACs in the paper's own world, where its claims
are judged, and one thing of them at a time in randomised runs (worlds), unknown to planner and controller.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cmacexp.report.figures import Panel, draw
from cmacexp.study import (
    Claim,
    Criterion,
    DataFrame,
    Figure,
    Finding,
    Request,
    Results,
    Study,
    at_least,
    at_most,
    grid,
)
from cmacexp.study.curves import over_setting
from cmacexp.study.samples import quotients
from cmacexp.study.statements import Limit
from cmacexp.study.tables import tabulate
from cmacexp.typing import Array
from pipelines.common_memory import (
    SIDES,
    colliding,
    hashed,
    rows_per_cell,
    where_hashed,
    worsening,
    worsening_in_worlds,
    worst_in_worlds,
)
from pipelines.common_results import percent
from pipelines.worlds import TESTED, in_worlds

LAYERS, ELEMENTS, INPUTS, MEMORY = "cmac.layers", "cmac.resolution_elements", "cmac.inputs", "cmac.memory_bytes"
SIZE, FREE = "layers and memory", "no collisions"
"""What is varied besides one config key."""
LEG, WALK = "one leg", "quadruped"
PUBLISHED = {LEG: ("scenario=one_leg",), WALK: ("scenario=quadruped", "reference=literal")}
"""What the paper walks, with its references as printed."""
PAPER: dict[str, dict[str, Any]] = {
    LEG: {LAYERS: 32, ELEMENTS: 33, INPUTS: "[angle, velocity, acceleration]", MEMORY: 2**20},
    WALK: {LAYERS: 32, ELEMENTS: 33, MEMORY: 2**18},
}
"""The sizes of the paper, or taken where it is silent."""
IN_WORLDS = {LEG: "one leg in worlds", WALK: "quadruped in worlds"}
LASTING = {LEG: ("one_leg", ("learning=lasting", "reference=aware")), WALK: ("quadruped_lasting", ())}
"""Scenario and further overrides in worlds."""
MEMORIES = tuple(2**n for n in range(9, 17))
"""Bytes of one leg; the first is the least that 32 layers of two outputs allow."""
SMALLER = {LEG: (*MEMORIES, 2**18), WALK: MEMORIES}
"""Memories tried besides the paper's."""
OTHERS: dict[str, dict[str, tuple[Any, ...]]] = {
    LEG: {LAYERS: (8, 128), ELEMENTS: (9, 17, 65), INPUTS: ("[angle]", "[angle, velocity]"), MEMORY: SMALLER[LEG]},
    WALK: {ELEMENTS: (9,)},
}
"""What is tried in worlds besides the paper's; the quick form takes the first alone."""
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
    """Every memory and seed in the paper's world, every size in worlds; and, in both, one without collisions."""

    def tried(others: tuple[Any, ...], paper: Any) -> tuple[Any, ...]:
        return (*(others[:1] if quick else others), paper)

    found = []
    kept = (f"cycles={QUICK_CYCLES if quick else CYCLES}", "record.cycles=[1]")
    for machine, published in PUBLISHED.items():
        common, memories = (*published, *kept), tried(SMALLER[machine], PAPER[machine][MEMORY])
        found += grid(*common, over={MEMORY: memories}, seeded=True, machine=machine, varied=MEMORY)
        found += grid(*common, "cmac.addressing=visited", machine=machine, varied=FREE)
    for machine, (scenario, overrides) in LASTING.items():
        part = partial(
            in_worlds, scenario, TESTED[:1] if quick else TESTED, *overrides, *kept, machine=IN_WORLDS[machine]
        )
        for key, others in OTHERS[machine].items():
            found += part(over={key: tried(others, PAPER[machine][key])}, varied=key)
        for layers, sizes in WITH_LAYERS.items() if machine == LEG else ():
            found += part(over={LAYERS: [layers], MEMORY: sizes[:1] if quick else sizes}, varied=SIZE)
        free = {LAYERS: (PAPER[LEG][LAYERS], FEW, MANY)}
        found += part("cmac.addressing=visited", over=free, varied=FREE) if machine == LEG else []
    return found


def _compared(machine: str, key: str, value: Any, cycle: int | None, holds: Limit) -> Criterion:
    """Errors in worlds with one value over those with the paper's."""
    paper, when = PAPER[machine][key], "at the end" if cycle is None else f"in cycle {cycle}"
    return Criterion(
        f"error with {key}={value} over that with {paper}",
        lambda results: worsening_in_worlds(results.select({key: value}), results.select({key: paper}), cycle),
        holds,
        of={"machine": IN_WORLDS[machine], "varied": key},
        case=f"{machine}, {when}",
    )


def _sixteenth(machine: str) -> Criterion:
    """Errors in the paper's world with a sixteenth of the paper's memory over those with all of it."""
    paper = PAPER[machine][MEMORY]
    return Criterion(
        "error at the end with a sixteenth of the paper's memory, over that with all of it",
        lambda results: worsening(results.select({MEMORY: paper // 16}), results.select({MEMORY: paper})),
        at_most(AS_GOOD),
        at_least(MUCH_WORSE),
        of={"machine": machine, "varied": MEMORY},
        case=f"{machine}, {paper // 16} bytes",
    )


def cost_of_crowding(results: Results, layers: int) -> Array:
    """(worlds,): errors at the end in crowded memory over those without collisions, with as many layers."""
    own = results.select({LAYERS: layers})
    crowded = hashed(own).select({MEMORY: WITH_LAYERS[layers][0]})
    return worsening_in_worlds(crowded, own.select({"cmac.addressing": "visited"}))


def weigh(results: Results) -> Array:
    """(worlds,): what collisions in crowded memory cost few layers, over what they cost many."""
    return quotients(*(cost_of_crowding(results, layers) for layers in (FEW, MANY)))


def cost_with_room(results: Results) -> Array:
    """(worlds,): largest errors at the end in roomy memory over those without collisions, with as many layers."""
    by_layers = results.by(LAYERS).values()
    return np.max([worst_in_worlds(own, "rows_per_cell", ROOMY) for own in by_layers], axis=0)


def _paper_size(machine: str) -> dict[str, Any]:
    return {"machine": machine, "varied": MEMORY, MEMORY: PAPER[machine][MEMORY]}


WORLDS = "In randomised runs,"
WIDER = f"cells {(PAPER[LEG][ELEMENTS] - 1) / (WIDE - 1):g} times as wide as the paper's"
CLAIMS = {
    "rate": Claim(
        "by choosing proper generalisation size and memory the rate of collision stays below a noticeable level",
        "section 4",
        [
            percent(
                "visited cells that collide, with the paper's size",
                lambda results: results.measure("colliding"),
                at_most(0.05),
                at_least(CROWDED),
                of=_paper_size(machine),
                case=machine,
            )
            for machine in PUBLISHED
        ],
    ),
    "robust": Claim(
        "CMAC learning is robust to collisions",
        "section 4",
        [
            Criterion(
                "error at the end where at least half of the visited cells collide, over that without collisions",
                where_hashed("colliding", CROWDED),
                at_most(AS_GOOD),
                at_least(MUCH_WORSE),
                of={"machine": machine, "varied": [MEMORY, FREE]},
                case=machine,
            )
            for machine in PUBLISHED
        ],
    ),
    "little": Claim(
        "a complex system is handled with little hardware (a board with 1 MB)",
        "sections 5, 6.3",
        [_sixteenth(machine) for machine in PUBLISHED],
    ),
}
FINDINGS = {
    "width_early": Finding(
        [_compared(machine, ELEMENTS, WIDE, EARLY, at_most(FASTER)) for machine in PUBLISHED],
        says=f"{WORLDS} {WIDER} learn faster on one leg and on four",
    ),
    "width_end": Finding(
        [_compared(machine, ELEMENTS, WIDE, None, at_most(AS_GOOD)) for machine in PUBLISHED],
        says=f"{WORLDS} CMACs with {WIDER} end at least as accurate as the paper's",
    ),
    "layers": Finding(
        [_compared(LEG, LAYERS, n, cycle, at_most(AS_GOOD)) for n in (FEW, MANY) for cycle in (EARLY, None)],
        says=f"{WORLDS} {FEW} and {MANY} layers are about as accurate on one leg as the paper's "
        f"{PAPER[LEG][LAYERS]}, or more accurate",
    ),
    "inputs": Finding(
        [_compared(LEG, INPUTS, "[angle]", EARLY, at_most(FASTER))],
        says=f"{WORLDS} on this one path of one leg, a CMAC of the angles alone learns faster than one of all inputs",
    ),
    "inputs_end": Finding(
        [_compared(LEG, INPUTS, "[angle]", None, at_most(AS_GOOD))],
        says=f"{WORLDS} a CMAC of the angles alone ends about as accurate on this path as one of all "
        "inputs, or more accurate",
    ),
    "room": Finding(
        [
            Criterion(
                f"largest error at the end with at least {ROOMY:g} rows for each visited cell, over that without "
                "collisions",
                cost_with_room,
                at_most(AS_GOOD),
                of={"machine": IN_WORLDS[LEG], "varied": [MEMORY, SIZE, FREE]},
                case="one leg, any number of layers",
            )
        ],
        says=f"{WORLDS} with {ROOMY:g} rows of memory for each visited cell or more, collisions cost "
        "one leg little accuracy",
    ),
    "weight": Finding(
        [
            Criterion(
                f"what collisions cost {FEW} layers in crowded memory, over what they cost {MANY} (error at the end "
                "over that without collisions)",
                weigh,
                at_least(AS_GOOD),
                of={"machine": IN_WORLDS[LEG], "varied": [SIZE, FREE]},
            )
        ],
        says=f"{WORLDS} in equally crowded memory, collisions cost {FEW} layers more than {MANY}",
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


def draw_sizes(results: Results) -> Figure:
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


def size_table(every: Results, machine: str) -> DataFrame:
    """Every size: errors early and at the end, use of memory; means over seeds or worlds."""
    results = every.select(machine=machine)
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
    found: dict[str, Any] = {"cycles": results.value("cycles"), "worlds": len(TESTED)}
    for name, machine in (("leg", LEG), ("walk", WALK)):
        base, size = results.select(_paper_size(machine)), PAPER[machine]
        found[name] = {
            "layers": size[LAYERS], "elements": size[ELEMENTS], "memory": size[MEMORY] // 1024,
            "width": _width(base),
            "room": size[MEMORY] / 1024 / float(base.measure("rows_per_cell").mean()),
        }  # fmt: skip
    return found


TABLES = {"leg": LEG, "walk": WALK, "leg_worlds": IN_WORLDS[LEG], "walk_worlds": IN_WORLDS[WALK]}
"""Machines by table."""
STUDY = Study(
    title="How large a CMAC must be",
    question="How do layers, width of a cell, inputs, memory and collisions affect what a CMAC achieves?",
    runs=runs,
    measures={"colliding": colliding, "rows_per_cell": rows_per_cell},
    claims=CLAIMS,
    findings=FINDINGS,
    figures={
        "sizes": lambda results: draw_sizes(results.select(machine=IN_WORLDS[LEG])),
    },
    tables={name: partial(size_table, machine=machine) for name, machine in TABLES.items()},
    values=values,
)
