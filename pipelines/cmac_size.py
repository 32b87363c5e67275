"""How large a CMAC must be: layers, cells, memory and collisions against accuracy (Lin & Song 1997, section 4).

``python -m pipelines.cmac_size`` changes one thing of the paper's CMAC at a time, for one leg and for the quadruped.
What it shows: the width of a cell matters most, layers hardly, and a small part of the paper's memory is enough.
"""

from cmacexp.report.page import Drawing, Section
from pipelines.analysis.cmac_size_figures import draw_accuracy, draw_collisions, draw_walk
from pipelines.analysis.cmac_size_verdicts import ELEMENTS as RESOLUTION
from pipelines.analysis.cmac_size_verdicts import (
    INPUTS,
    LAYERS,
    MEMORY,
    RANGE,
    SHOWN,
    by_memory,
    enough_memory,
    measure,
    median_worsening,
    paper_size,
)
from pipelines.analysis.cmac_size_words import advice, captions, claims, shown_cycles, tables
from pipelines.analysis.measured import size_of
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs, Study, main

LEG, WALK = "one leg", "quadruped"
LAYER_COUNTS, GRID_LAYERS = (2, 4, 16, 64), (8, 128)
RESOLUTIONS, FACTORS = (5, 9, 17, 65, 129), (1, 2, 3, 10)
MEMORIES = tuple(2**n for n in (9, 10, 11, 12, 13, 14, 16, 18))
SEEDED, SEEDS = 2**14, (1, 2)
"""Memories up to this are hashed with other seeds too: there the seed decides which cells collide."""
LEAST_ROW = 16
"""Bytes of memory per layer below which a CMAC of two outputs cannot be."""
OTHER = ("cmac.displacement=odd_lattice", "cmac.displacement=parks_militzer")
OF_WALK = (
    *(f"{MEMORY}={2**n}" for n in (10, 12, 14, 16)),
    *(f"{LAYERS}=8", f"{LAYERS}=128", f"{RESOLUTION}=9", f"{RESOLUTION}=65"),
)


def grid(quick: bool) -> list[tuple[str, ...]]:
    """Overrides of every size of one leg besides the paper's."""
    memories = (2**10, 2**14) if quick else MEMORIES
    alone = [f"{LAYERS}={n}" for n in (GRID_LAYERS if quick else sorted(LAYER_COUNTS + GRID_LAYERS))]
    alone += [f"{RESOLUTION}={n}" for n in ((9,) if quick else RESOLUTIONS)]
    alone += [f"{RANGE}={n}" for n in ((10,) if quick else FACTORS)]
    alone += [f"{INPUTS}=[angle]", *(() if quick else (f"{INPUTS}=[angle,velocity]", *OTHER))]
    alone += [f"{MEMORY}={n}" for n in memories]
    both = [(f"{LAYERS}={c}", f"{MEMORY}={n}") for c in GRID_LAYERS for n in memories if n >= c * LEAST_ROW]
    seeds = [(f"{MEMORY}={n}", f"seed={s}") for n in memories if n <= SEEDED for s in SEEDS if not quick]
    return [(text,) for text in alone] + both + seeds


def jobs(quick: bool) -> Jobs:
    """Every size, by name."""
    sizes = {LEG: [(), *grid(quick)], WALK: [(), *((text,) for text in (OF_WALK[2:3] if quick else OF_WALK))]}
    cycles = f"cycles={SHOWN[0] if quick else SHOWN[-1]}"
    scenarios = {LEG: "scenario=one_leg", WALK: "scenario=quadruped"}
    return {
        " ".join((machine, *size)): [scenarios[machine], cycles, *size]
        for machine in sizes
        for size in sizes[machine]
    }


def summarise(runs: Runs) -> list[Section]:
    """One leg with figures and claims; the quadruped."""
    legs, walks = ([measure(n, run, runs[m]) for n, run in runs.items() if n.startswith(m)] for m in (LEG, WALK))
    accuracy, collisions = captions(legs)
    drawings = [
        Drawing("cmac_size_accuracy", draw_accuracy(legs, shown_cycles(legs)), accuracy),
        Drawing("cmac_size_collisions", draw_collisions(legs), collisions),
    ]
    full, small = paper_size(walks), min(by_memory(walks).items())
    walk = Drawing(
        "cmac_size_quadruped",
        draw_walk(walks),
        f"Four legs, cycle {max(full.x)}: {size_of(small[0])} a leg instead of {size_of(full.memory)} make the "
        f"errors {median_worsening(small[1], full):.1f} times as large; {size_of(enough_memory(walks))} do as "
        "well. Dotted: the paper's memory.",
    )
    return [
        Section("How large a CMAC: one leg", [*advice(legs), *drawings, *tables(legs)], claims(legs, runs)),
        Section("How large a CMAC: quadruped", [walk, *tables(walks)]),
    ]


PURPOSE = (
    "The paper's CMAC with one thing changed at a time: the width of a cell matters most, layers hardly, and a small "
    "part of its memory is enough."
)
STUDY = Study("cmac_size", "How large a CMAC must be", PURPOSE, jobs, summarise)

if __name__ == "__main__":
    main(STUDY)
