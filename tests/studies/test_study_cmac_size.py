"""The measures of the study of CMAC sizes, on runs made by hand."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cmacexp.report.run_summary import RunSummary
from cmacexp.study import Results
from cmacexp.study.results import Row
from pipelines.cmac_size import FEW, LAYERS, MANY, MEMORY, OTHERS, PAPER, SMALLER, WITH_LAYERS, weigh
from pipelines.common_memory import SIDES, colliding, rows_per_cell, where_hashed, worsening, worst_in_worlds


def run(x: float, y: float, status: str = "completed", crowd: float = 0.0, **settings) -> Row:
    """A run of six cycles with these errors from the second one on; one that fell has two."""
    count = 6 if status == "completed" else 2
    metrics = {side: np.array([1.0, *[error] * (count - 1)]) for side, error in zip(SIDES, (x, y), strict=True)}
    return Row(RunSummary(Path("run"), status, "", {}, count, metrics), settings, settings, {"colliding": crowd})


def test_rows_and_collisions_are_those_of_all_legs():
    legs = [
        {"rows": 64, "cells_visited": 20, "cells_colliding": 3},
        {"rows": 64, "cells_visited": 12, "cells_colliding": 5},
    ]
    machine = SimpleNamespace(manifest={"memory": legs})
    assert rows_per_cell(machine) == 4.0
    assert colliding(machine) == 0.25


def test_a_size_is_as_much_worse_as_in_its_worse_direction():
    results = Results([run(0.1, 0.2, size=1), run(0.3, 0.2, size=1), run(0.1, 0.6, size=2), run(0.6, 0.1, size=2)])
    assert worsening(results.select(size=2), results.select(size=1)) == pytest.approx([3.0, 3.0])
    assert worsening(results.select(size=2), results.select(size=1), 1) == pytest.approx([1.0, 1.0])


def test_a_run_that_ended_is_infinitely_worse():
    results = Results([run(0.1, 0.1, size=1), run(0.1, 0.1, "fell", size=2)])
    assert np.isinf(worsening(results.select(size=2), results.select(size=1))).all()


def test_runs_are_taken_by_their_measure_and_compared_with_the_one_without_collisions():
    hashed = {"cmac.addressing": "hashed"}
    rows = [
        run(0.1, 0.1, **{"cmac.addressing": "visited"}),
        run(0.2, 0.1, crowd=0.9, **hashed),
        run(0.9, 0.9, crowd=0.1, **hashed),
    ]
    assert where_hashed("colliding", 0.5)(Results(rows)) == pytest.approx([2.0])


def test_collisions_cost_a_world_as_much_as_in_its_worst_run_and_each_world_counts_once():
    free, hashed = {"cmac.addressing": "visited"}, {"cmac.addressing": "hashed"}
    rows = [
        *(run(error, error, seed=world, **free) for world, error in ((0, 0.1), (1, 1.0))),
        run(0.2, 0.1, crowd=0.9, seed=1, **hashed),
        run(0.9, 2.0, crowd=0.8, seed=1, **hashed),
        run(0.3, 0.2, crowd=0.9, seed=0, **hashed),
        run(9.0, 9.0, crowd=0.1, seed=0, **hashed),
    ]
    assert sorted(worst_in_worlds(Results(rows), "colliding", 0.5)) == pytest.approx([2.0, 3.0])


def test_no_size_is_tried_twice():
    for machine, others in OTHERS.items():
        for key, tried in {**others, "cmac.memory_bytes": SMALLER[machine]}.items():
            assert len({*tried, PAPER[machine][key]}) == len(tried) + 1


def test_collisions_are_weighed_against_as_many_layers_without_them():
    """Few layers are worse with and without collisions; these cost them twice as much as many layers."""
    rows = []
    for layers, (free, crowded) in {FEW: (0.2, 0.8), MANY: (0.1, 0.2)}.items():
        hashed = {"cmac.addressing": "hashed", MEMORY: WITH_LAYERS[layers][0]}
        for error, memory in ((free, {"cmac.addressing": "visited"}), (crowded, hashed)):
            rows.append(run(error, error, seed=3, **{LAYERS: layers, **memory}))
    assert weigh(Results(rows)) == pytest.approx([2.0])
