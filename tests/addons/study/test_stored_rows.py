"""Statements are judged again from stored runs: what they give is compared, and a changed statement is noticed."""

import json
from dataclasses import replace

import numpy as np
from support.made_studies import made_row

from cmacexp.addons.study.stored_rows import MOST, judge_again, store_rows
from cmacexp.study import Criterion, Finding, Results, at_most


def make_results(cycles=6):
    """Five seeds of two laws; the second one falls with seed 1."""
    return Results(
        [
            made_row(
                {name: np.linspace(1.0, 0.1 + 0.01 * seed, cycles if seed != 1 or law == "a" else 2)
                 for name in ("force_rmse", "transfer_rmse_x")},
                cycles, {"mass": 2.0 + seed / 3.0}, seeded=True, law=law, seed=seed, cycles=cycles,
            )
            for seed in range(5) for law in "ab"
        ]
    )  # fmt: skip


def declare(sample, **more):
    return Finding([Criterion("force error", sample, at_most(0.5), **more)], says="It is small")


STATEMENTS = {
    "force": declare(lambda runs: runs.end("force_rmse", 1), of={"law": "a"}),
    "ratio": declare(lambda runs: runs.at(2, "force_rmse"), of={"law": "b"}, over={"law": "a"}),
    "walks": declare(lambda runs: runs.completed),
    "mass": declare(lambda runs: runs.measure("mass")),
    "trace": declare(lambda runs: [run.trace["x"].iloc[-1] for run in runs.runs]),
}


def test_statements_are_judged_again_from_runs_of_two_seeds(tmp_path):
    path = tmp_path / "rows.json"
    path.write_text(store_rows(STATEMENTS, make_results()))
    content = json.loads(path.read_text())
    assert {row["settings"]["seed"] for row in content["rows"]} == {0, 1}
    assert {name for row in content["rows"] for name in row["metrics"]} == {"force_rmse"}  # no other is used
    assert set(content["statements"]) == set(STATEMENTS) - {"trace"}  # which no stored run has
    assert content["statements"]["walks"]["counts"] == ["3 of 4"]
    assert not judge_again(path, STATEMENTS)


def test_a_fault_of_a_statement_is_noticed(tmp_path):
    path = tmp_path / "rows.json"
    path.write_text(store_rows(STATEMENTS, make_results()))
    (force,) = STATEMENTS["force"].criteria
    for wrong in (
        replace(force, of={"law": "b"}),
        replace(force, sample=lambda runs: runs.end("force_rmse", 5)),
        replace(force, sample=lambda runs: runs.end("transfer_rmse_x", 1)),  # was not stored
        replace(force, holds=at_most(0.01)),
        replace(force, scale=1e3),
    ):
        (line,) = judge_again(path, {**STATEMENTS, "force": replace(STATEMENTS["force"], criteria=[wrong])})
        assert line.startswith("force: was ")
    (line,) = judge_again(path, {name: STATEMENTS[name] for name in STATEMENTS if name != "ratio"})
    assert line.startswith("ratio: was ")


def test_statements_that_need_too_many_values_are_left_out(tmp_path):
    text = store_rows(STATEMENTS, make_results(cycles=MOST))
    assert set(json.loads(text)["statements"]) == {"walks", "mass"}
    assert len(text) < 10_000
