"""The study of predictors: its confusion matrix, by hand."""

from pathlib import Path

import numpy as np
import pytest

from cmacexp.report.run_summary import RunSummary
from cmacexp.stability.transfer import Spectrum
from cmacexp.study.results import Results, Row
from pipelines.when_learning_holds import CRITERIA, FINDINGS, LEG, table_confusion
from pipelines.when_learning_holds_measures import _say_if_met

RIGHT = [(1.0, 1.0)] * 8 + [(-1.0, 0.0)] * 6
WRONG = [(1.0, 0.0)] + [(-1.0, 1.0)] * 2
OUTCOMES = [*RIGHT, *WRONG, (0.0, 1.0), (0.0, 1.0), (np.nan, 0.0)]
"""What a predictor says of 20 settings (1: bounded, 0: undecided, -1: grows), and whether they stayed bounded."""


@pytest.fixture(scope="module")
def results():
    rows = []
    for said, held in [*OUTCOMES, (1.0, np.nan)]:
        measures = {"learns": float(np.isfinite(held)), "held": held, **dict.fromkeys(CRITERIA, said)}
        rows.append(Row(RunSummary(Path("run"), "completed", "", {}, 3, {}), {"machine": LEG}, {}, measures))
    return Results(rows)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_the_matrix_counts_every_setting_that_learns_once(results, criterion):
    matrix = FINDINGS[f"matrix_{criterion}"].judge(results).measured
    assert [(round(20 * each.interval.value), each.interval.count) for each in matrix] == [
        (8, 20), (1, 20), (6, 20), (2, 20), (3, 20),
    ]  # fmt: skip
    (right,) = FINDINGS[criterion].judge(results).measured
    assert (right.interval.value, right.interval.count) == (14 / 17, 17)


def test_the_table_has_base_rate_matrix_share_undecided_and_interval(results):
    row = table_confusion(results).iloc[0]
    assert (row["n"], row["stay bounded, %"], row["undecided, %"]) == (20, 60.0, 15.0)
    counts = [row[f"{said}, {went}"] for said in ("said bounded", "said to grow", "undecided")
              for went in ("bounded", "grew")]  # fmt: skip
    assert counts == [8, 1, 2, 6, 2, 1]
    assert row["right where it decides, %"] == pytest.approx(1400 / 17)
    assert row["from, %"] < 1400 / 17 < row["to, %"]


def test_a_condition_is_met_where_it_is_at_every_place():
    places = [Spectrum(np.array([10.0]), 0.01, np.array([[[value + 0j]]])) for value in (1.0, 0.5)]
    assert [_say_if_met(places, 0, share) for share in (0.0, 0.9, 1.1)] == [1.0, 1.0, -1.0]
    assert np.isnan(_say_if_met([], 0, 0.0))
