"""Required size of a CMAC: layers, width of a cell, inputs, memory (Lin & Song 1997, section 4).

``python -m pipelines.cmac_size`` changes the memory of the paper's CMACs under the paper's conditions, where its
claims are judged, and one parameter at a time in worlds: randomised runs, unknown to planner and controller.
"""

from functools import partial

import numpy as np

from cmacexp.study import Array, Declared, Results, declare, of_completed, quotients
from pipelines.common_results import (
    MEMORY_MEASURES,
    SIDES,
    cost_of_collisions,
    worsening,
)
from pipelines.worlds import TESTED, draw_worlds

LAYERS, ELEMENTS, INPUTS, MEMORY = "cmac.layers", "cmac.resolution_elements", "cmac.inputs", "cmac.memory_bytes"
ADDRESSING = "cmac.addressing"
ALL = "[angle, velocity, acceleration]"
FREE = "no collisions"
PAPER: dict[str, Declared] = {
    "one leg": {LAYERS: 32, ELEMENTS: 33, INPUTS: ALL, MEMORY: 2**20},
    "quadruped": {LAYERS: 32, ELEMENTS: 33, MEMORY: 2**18},
}
"""The paper's sizes; assumed where it gives none."""
MEMORIES = [2**n for n in range(9, 17)]
"""CMAC memory of one leg, bytes; the first is the least that 32 layers of two outputs allow."""


def _published(machine: str, memories: list[int], *scenario: str) -> list[Declared]:
    """Return runs under the paper's conditions, with every memory and seed, and once without collisions."""
    common: Declared = {"set": [*scenario, "cycles=20", "record.cycles=[1]"], "quick": {"cycles": 6}}
    return [
        {**common, "over": {MEMORY: memories}, "seeds": True, "labels": {"machine": machine, "varied": MEMORY}},
        {**common, "set": [*common["set"], f"{ADDRESSING}=visited"], "labels": {"machine": machine, "varied": FREE}},
    ]


def _in_worlds(machine: str, varied: str, over: Declared, *scenario: str) -> Declared:
    """Return runs in worlds in which one parameter of the CMAC is varied."""
    return {
        "set": [*scenario, "cycles=20", "record.cycles=[1]"],
        "quick": {"cycles": 6},
        "over": {"world": draw_worlds(scenario[0].partition("=")[2], TESTED), **over},
        "labels": {"machine": f"{machine} in worlds", "varied": varied},
    }


LEG = ("scenario=one_leg", "learning=lasting", "reference=aware")


def _compare(machine: str, key: str, value: object, cycle: int | None, limit: str) -> Declared:
    """Return the criterion of a ratio of errors in worlds: with ``value`` of a parameter to the paper's value.

    The errors are those of ``cycle`` or, if None, of the end.
    """
    paper = PAPER[machine][key]
    return {
        "quantity": f"error with {key}={value} over that with {paper}",
        "value": lambda all: worsening(all.select({key: value}), all.select({key: paper}), cycle),
        "of": {"machine": f"{machine} in worlds", "varied": key},
        "case": f"{machine}, {f'in cycle {cycle}' if cycle else 'at the end'}",
        "limit": limit,
    }


def _use_sixteenth(results: Results) -> Array:
    """Return final errors with 1/16 of the paper's memory relative to their mean with all of it, (seeds,).

    Of the ratios in x and y the larger one counts.
    """
    paper = max(results.values(MEMORY))
    small, full = (results.select({MEMORY: memory}) for memory in (paper // 16, paper))
    return np.max([quotients(small.end(side), full.end(side).mean()) for side in SIDES], axis=0)


def _tabulate_sizes(machine: str, *keys: str) -> Declared:
    """Return the table of all sizes: errors early and at the end, use of memory."""
    return {
        "rows": {key: key.removeprefix("cmac.").replace("_", " ") for key in keys},
        "columns": of_completed(
            {
                "x, cycle 5, mm": lambda runs: 1e3 * runs.at(5, "transfer_rmse_x"),
                "y, cycle 5, mm": lambda runs: 1e3 * runs.at(5, "transfer_rmse_y"),
                "x, end, mm": lambda runs: 1e3 * runs.end("transfer_rmse_x"),
                "y, end, mm": lambda runs: 1e3 * runs.end("transfer_rmse_y"),
                "rows per visited cell": lambda runs: runs.measure("rows_per_cell"),
                "colliding, %": lambda runs: 100 * runs.measure("colliding"),
            }
        ),
        "of": {"machine": machine},
    }


def find_room(results: Results) -> Declared:
    """Return the cell width with the paper's sizes, and the memory that one row per visited cell takes, by machine.

    ``width`` is relative to the planned span of the input, ``room`` is in KB.
    """
    base = {
        machine: results.select({"machine": machine, "varied": MEMORY, MEMORY: size[MEMORY]})
        for machine, size in PAPER.items()
    }
    return {
        "width": {name: runs.value("cmac.range_factor") / (runs.value(ELEMENTS) - 1) for name, runs in base.items()},
        "room": {
            name: runs.value(MEMORY) / 1024 / runs.measure("rows_per_cell").mean() for name, runs in base.items()
        },
    }


WIDER = "cells 4 times as wide as the paper's"
STUDY = declare(
    title="How large a CMAC must be",
    question="How do layers, width of a cell, inputs, memory and collisions affect what a CMAC achieves?",
    runs=[
        *_published("one leg", [*MEMORIES, 2**18, 2**20], "scenario=one_leg"),
        *_published("quadruped", [*MEMORIES, 2**18], "scenario=quadruped", "reference=literal"),
        _in_worlds("one leg", LAYERS, {LAYERS: [8, 128, 32]}, *LEG),
        _in_worlds("one leg", ELEMENTS, {ELEMENTS: [9, 17, 65, 33]}, *LEG),
        _in_worlds("one leg", INPUTS, {INPUTS: ["[angle]", "[angle, velocity]", ALL]}, *LEG),
        _in_worlds("one leg", MEMORY, {MEMORY: [*MEMORIES, 2**18, 2**20]}, *LEG),
        _in_worlds("quadruped", ELEMENTS, {ELEMENTS: [9, 33]}, "scenario=quadruped_lasting"),
    ],
    measures=MEMORY_MEASURES,
    claims={
        "rate": {
            "words": "by choosing proper generalisation size and memory the rate of collision stays below a "
            "noticeable level",
            "where": "section 4",
            "criteria": [
                {
                    "quantity": "visited cells that collide, with the paper's size",
                    "value": lambda runs: runs.measure("colliding"),
                    "of": {"machine": machine, "varied": MEMORY, MEMORY: size[MEMORY]}, "case": machine,
                    "limit": "at most 5 %", "opposite": "at least 50 %",
                }
                for machine, size in PAPER.items()
            ],
        },
        "robust": {
            "words": "CMAC learning is robust to collisions",
            "where": "section 4",
            "quantity": "error at the end where 1 to 25 % of the visited cells collide, over that without collisions",
            "value": partial(cost_of_collisions, measure="colliding", least=0.01, most=0.25),
            "of": {"varied": [MEMORY, FREE]},
            "each": {"machine": [*PAPER]},
            "limit": "at most 1.25", "opposite": "at least 2",
        },
        "little": {
            "words": "a complex system is handled with little hardware (a board with 1 MB)",
            "where": "sections 5, 6.3",
            "criteria": [
                {
                    "quantity": "error at the end with a sixteenth of the paper's memory, over that with all of it",
                    "value": _use_sixteenth, "of": {"machine": machine, "varied": MEMORY},
                    "case": f"{machine}, {size[MEMORY] // 16} bytes", "limit": "at most 1.25",
                    "opposite": "at least 2",
                }
                for machine, size in PAPER.items()
            ],
        },
    },
    findings={
        "width_early": {
            "says": f"In randomised runs, {WIDER} learn faster on one leg and on four",
            "criteria": [_compare(machine, ELEMENTS, 9, 5, "at most 0.8") for machine in PAPER],
        },
        "width_end": {
            "says": f"In randomised runs, CMACs with {WIDER} end at least as accurate as the paper's",
            "criteria": [_compare(machine, ELEMENTS, 9, None, "at most 1.25") for machine in PAPER],
        },
        "layers": {
            "says": "In randomised runs, 8 and 128 layers are about as accurate on one leg as the paper's 32, or "
            "more accurate",
            "criteria": [
                _compare("one leg", LAYERS, layers, cycle, "at most 1.25")
                for layers in (8, 128) for cycle in (5, None)
            ],
        },
        "inputs": {
            "says": "In randomised runs, on this one path of one leg, a CMAC of the angles alone learns faster than "
            "one of all inputs",
            **_compare("one leg", INPUTS, "[angle]", 5, "at most 0.8"),
        },
        "inputs_end": {
            "says": "In randomised runs, a CMAC of the angles alone ends about as accurate on this path as one of "
            "all inputs, or more accurate",
            **_compare("one leg", INPUTS, "[angle]", None, "at most 1.25"),
        },
    },
    figures={
        f"sizes_{when}": [
            {"value": partial(read, side=side), "over": key, "of": {"machine": "one leg in worlds", "varied": key},
             "log": "xy", "title": f"error in {side[-1]}", "y": "transfer error, mm"}
            for side in SIDES
            for key in (LAYERS, ELEMENTS, MEMORY)
        ]
        for when, read in (
            ("early", lambda runs, side: 1e3 * runs.at(5, side)),
            ("end", lambda runs, side: 1e3 * runs.end(side)),
        )
    },
    tables={
        "leg": _tabulate_sizes("one leg", MEMORY, ADDRESSING),
        "walk": _tabulate_sizes("quadruped", MEMORY, ADDRESSING),
        "leg_worlds": _tabulate_sizes("one leg in worlds", LAYERS, ELEMENTS, INPUTS, MEMORY, ADDRESSING),
        "walk_worlds": _tabulate_sizes("quadruped in worlds", ELEMENTS),
    },
    values=find_room,
)  # fmt: skip
