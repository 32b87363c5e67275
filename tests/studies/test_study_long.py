"""What the study of long learning measures, on made runs."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cmacexp.report.run_summary import RunSummary
from cmacexp.study.results import Results, Row
from cmacexp.study.samples import ended_in
from pipelines import long_learning_measures as measures
from pipelines.long_learning import best_of_others, over_best_rate


def run(*errors: float, asked: int = 4, seed: int = 0, detected: float = np.inf, **settings) -> Row:
    """A run with these errors of 3 : 4 in x and y; it diverged if it did fewer cycles than asked for."""
    status = "completed" if len(errors) == asked else "diverged"
    distance = np.array(errors)
    metrics = {"transfer_rmse_x": 0.6 * distance, "transfer_rmse_y": 0.8 * distance}
    summary = RunSummary(Path("run"), status, "", {}, len(errors), metrics)
    return Row(summary, {"cycles": asked, "seed": seed, **settings}, {}, {"detected": detected})


def test_an_error_at_the_end_is_a_distance_and_infinite_of_a_run_that_ended_before():
    results = Results([run(9.0, 3.0, 2.0, 2.0), run(9.0)])
    assert measures.final(results).tolist() == pytest.approx([2.5, np.inf])
    assert ended_in(results).tolist() == [np.inf, 2.0]


def test_errors_vary_over_the_second_half_alone_and_a_single_cycle_does_not_count():
    rises = [9.0] * 40 + [2.0] * 15 + [8.0] + [2.0] * 10 + [3.0] * 14
    assert measures.variation(Results([run(*rises, asked=80), run(9.0)])).tolist() == pytest.approx([1.5, np.inf])


def test_a_lead_is_too_short_by_what_auto_gave_in_the_same_world():
    def led(lead, known: float, world: int, *errors: float) -> Row:
        row = run(*errors, seed=world, **{"learning.lead": lead, "actuator.delay": 1})
        return replace(row, measures={"lead": known})

    rows = [led("auto", 3.0, 0, 1.0, 1.0, 1.0, 1.0), led("auto", 2.0, 1, 1.0, 1.0, 1.0, 1.0)]
    rows += [led(2, 2.0, world, *errors) for world, errors in enumerate([(1.0,), (1.0, 1.0, 1.0, 1.0)])]
    rows += [led(1, 1.0, world, 1.0, 1.0) for world in (0, 1)]
    assert measures.one_too_short(Results(rows)).tolist() == [0.25, 0.5]


def test_auto_is_compared_with_the_rate_that_is_best_in_the_same_world():
    errors = {("auto", 0): 2.0, ("auto", 1): 3.0, (0.05, 0): 4.0, (0.05, 1): 2.0, (0.8, 0): 8.0, (0.8, 1): 3.0}
    rows = [run(*[error] * 4, seed=world, **{"learning.rate": rate}) for (rate, world), error in errors.items()]
    rows[-2] = run(8.0, seed=0, **{"learning.rate": 0.8})
    assert over_best_rate(Results(rows)) == pytest.approx([0.5, 1.5])


def test_the_best_other_rule_is_chosen_in_other_worlds_than_the_one_it_is_judged_in():
    errors = {"paper": (1.0, 1.0, 1.0), "leakage": (0.1, 2.0, 2.0), "dead_zone": (3.0, 1.5, 1.5)}
    rows = [
        run(*[error] * 4, seed=world, **{"learning.rule": rule, "learning.lead": "auto"})
        for rule, own in errors.items()
        for world, error in enumerate(own)
    ]
    assert best_of_others(Results(rows), "auto", measures.TRANSFER).tolist() == pytest.approx([3.0, 2.0, 2.0])


def test_drift_is_judged_by_the_runs_that_ended_before():
    results = Results([run(4.0, 2.0, 3.0, detected=3.0), run(4.0), run(1.0, 1.0, 1.0, 1.0, detected=2.0)])
    assert measures.detected_if_ended(results) == [True, False]
    assert measures.error_when_detected(results) == pytest.approx([1.5])


def test_a_prediction_is_as_good_as_that_of_its_least_predicted_lead():
    table = pd.DataFrame(
        {
            "machine": ["one leg"] * 4 + ["quadruped"],
            "rule": ["paper"] * 3 + ["leakage", "paper"],
            "seed": [0, 0, 1, 0, 0],
            "predicted": [1.02, 0.98, 1.05, 2.0, 2.0],
            "measured": [1.03, 0.98, np.nan, 1.0, 1.0],
        }
    )
    miss = partial(measures.growth_miss, Results([], {"growth": table}))
    assert miss(machine="one leg") == pytest.approx([0.01])
    assert miss(machine="quadruped") == pytest.approx([1.0])


def test_growth_of_a_run_that_is_too_short_is_undefined():
    row = run(1.0, 1.0, **{"learning.start_cycle": 2})
    row.summary.metrics["feedback_change"] = np.array([np.nan, 1.0])
    assert np.isnan(measures.predict_and_measure(row)).all()
