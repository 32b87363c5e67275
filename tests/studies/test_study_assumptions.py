"""The study of assumed values: all of them are tried, and what counts as a change of a conclusion."""

import ast
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.command import ROOT

from cmacexp.config import to_plain
from cmacexp.report.run_summary import RunSummary
from cmacexp.study import Results, at_most
from cmacexp.study.results import Row
from pipelines.assumptions import (
    MACHINES,
    TAKEN,
    Conclusion,
    against,
    completing,
    count_changes,
    ended_early,
    number_table,
    ratio,
)

SMALL = Conclusion("x error", ratio("transfer_rmse_x", None), at_most(0.1))


def run(variant: str, seed: int, last: float, status: str = "completed", **more) -> Row:
    """A run of three cycles whose error goes from 2 to ``last``; one that fell has one cycle, or none."""
    errors = {"completed": np.array([2.0, 1.0, last]), "fell": np.array([2.0]), "fell at once": np.array([])}[status]
    settings = {"variant": variant, "seed": seed, "cycles": 3, **more}
    return Row(RunSummary(Path("run"), status, "", {}, len(errors), {"transfer_rmse_x": errors}), settings, {}, {})


def results(*lasts: tuple[str, float, float]) -> Results:
    return Results([run(name, seed, last) for name, *both in lasts for seed, last in enumerate(both)])


def test_a_conclusion_changes_if_it_differs_from_that_with_the_values_taken_and_the_same_seed():
    given = results((TAKEN, 0.1, 0.3), ("stroke 1", 0.1, 0.3), ("lift 1", 0.3, 0.1), ("lift 2", 0.3, 0.3))
    np.testing.assert_array_equal(count_changes(SMALL, given), [2, 1])
    table = number_table(given, {"x error": SMALL}).set_index("value")["x error"]
    assert [cell.partition(" ")[2] for cell in table] == ["", "", "≠", "(≠)"]


@pytest.mark.parametrize("status", ["fell", "fell at once"])
def test_values_with_which_runs_end_early_are_counted_by_themselves(status):
    fallen = [run("knee", seed, 0.0, status) for seed in (0, 1)]
    given = Results([*results((TAKEN, 0.1, 0.1), ("lift", 0.1, 0.1)).rows, *fallen])
    np.testing.assert_array_equal(ended_early(given), [1, 1])
    np.testing.assert_array_equal(count_changes(SMALL, given), [0, 0])
    assert completing(given).values("variant") == [TAKEN, "lift"]
    assert not SMALL.holds(given.select(variant="knee")).any()


def test_a_method_that_never_settles_is_infinitely_slow():
    def mass(method: str, time: float) -> Row:
        settings = {"force_control": method}
        return Row(
            RunSummary(Path("run"), "completed", "", {}, 1, {"force_settling_time": np.array([time])}),
            settings,
            {},
            {},
        )

    never = Results([mass("combined", 0.4), mass("damping", np.nan)])
    assert against("force_settling_time", "damping")(never) == 0.0
    assert against("force_settling_time", "damping")(Results([mass("combined", 0.4), mass("damping", 1.6)])) == 0.25


def test_every_field_that_is_marked_assumed_is_tried():
    sources = [path.read_text() for path in sorted((ROOT / "cmacexp").rglob("*.py"))]
    bodies = [node.body for text in sources for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef)]
    marked = {
        field.target.id
        for body in bodies
        for field, described in pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(described, ast.Expr)
        and "(assumed" in described.value.value
    }
    keys = {key.rsplit(".", 1)[-1] for _, tried in MACHINES.values() for each in tried for key in each.keys}
    assert len(marked) >= 8
    assert marked <= keys


def test_no_assumption_is_tried_with_the_value_that_is_taken(make_config):
    for scenario, assumptions in MACHINES.values():
        base = to_plain(make_config(f"scenario={scenario}"))
        for each in assumptions:
            for value in each.values:
                assert to_plain(make_config(f"scenario={scenario}", *each.overrides(value))) != base, (
                    each.name,
                    value,
                )
