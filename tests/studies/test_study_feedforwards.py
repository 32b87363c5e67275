"""The measures of the study of feedforwards: learning counted by hand, samples on made runs, bytes of weights."""

from pathlib import Path

import numpy as np
import pytest

from cmacexp.data.stored_run import StoredRun
from cmacexp.experiment.run import run_scenario
from cmacexp.report.run_summary import RunSummary
from cmacexp.study import Results
from cmacexp.study.results import Row
from pipelines.feedforwards import (
    ANEW,
    CARRIED,
    KEPT,
    against_fastest,
    carried_over,
    cycles_to_tenth,
    left_at_first,
    runs,
    training_time,
)
from pipelines.feedforwards_measures import (
    ALONE,
    CMAC,
    ILC,
    LEARNERS,
    MLP,
    RBF,
    bytes_held,
    bytes_used,
    cycles_to,
    errors,
)

inf = float("inf")
LEARNT_IN = {CMAC: 2, RBF: 4, MLP: 6, ILC: 3}


def run(kind: str, *errors: float, asked: int = 6, start: str = ANEW) -> Row:
    """A run of one leg with these errors in the plane, mm, at 3:4 in x and y."""
    settings = {"kind": kind, "start": start, "cycles": asked, "learning.start_cycle": 1 if start == CARRIED else 2}
    metrics = {f"transfer_rmse_{side}": 1e-3 * part * np.array(errors) for side, part in (("x", 0.6), ("y", 0.8))}
    status = "completed" if len(errors) == asked else "fell"
    return Row(RunSummary(Path("run"), status, "", {}, len(errors), metrics), settings, settings, {})


def learning(kind: str, cycles: int, start: str = ANEW) -> Row:
    """A run that is at a tenth of 50 mm from so many cycles on."""
    return run(kind, *[50.0] * (cycles - 1), *[4.0] * (7 - cycles), start=start)


ROWS = [run(ALONE, *[50.0] * 6), *(learning(kind, cycles) for kind, cycles in LEARNT_IN.items())]


def test_learnt_is_the_first_cycle_from_which_errors_stay_small():
    errors = np.array([[9.0, 2.0, 9.0, 2.0, 1.0], [1.0] * 5, [9.0] * 5, [9.0, 1.0, 1.0, inf, inf]])
    np.testing.assert_array_equal(cycles_to(errors, 2.0), [4.0, 1.0, inf, inf])


def test_a_run_that_ended_early_has_infinite_errors_from_there_on():
    results = Results([run(CMAC, 5.0, 10.0, asked=4)])
    np.testing.assert_allclose(errors(results), [[5.0, 10.0, inf, inf]])


def test_cmac_is_compared_with_the_fastest_of_the_others_and_the_perceptron_with_cmac():
    results = Results(ROWS)
    assert cycles_to_tenth(results, ILC) == [3.0]
    assert against_fastest(results) == pytest.approx([2 / 3])
    assert training_time(results) == [3.0]
    never = Results([*ROWS[:1], run(CMAC, *[50.0] * 6), *(run(kind, *[50.0] * 6) for kind in (RBF, MLP, ILC))])
    assert against_fastest(never) == [inf]


def test_what_is_carried_over_is_compared_with_feedback_alone_and_with_learning_from_nothing():
    results = Results([*ROWS, run(CMAC, 10.0, *[4.0] * 5, start=CARRIED)])
    assert left_at_first(results) == pytest.approx([0.2])
    assert carried_over(results) == pytest.approx([2.0])  # in its second cycle of learning, and in the first


@pytest.mark.parametrize("quick", [True, False])
def test_runs_after_a_change_start_from_runs_of_the_study_with_weights(quick):
    found = runs(quick)
    kept = [request for request in found if "record.weights=true" in request.overrides]
    carried = [request for request in found if request.labels.get("start") == CARRIED]
    assert {request.labels["kind"] for request in carried} == set(KEPT)
    assert all(request.starts_from in kept for request in carried)


@pytest.mark.parametrize(
    ("name", "held"),
    [(RBF, 8 * (200 + 8 + 400)), (ILC, 8 * 1200), (MLP, 8 * (4 * 32 + 32 + 2 * 32 + 2 + 9))],
)
def test_bytes_by_hand(make_config, tmp_path, name, held):
    run_scenario(make_config(*LEARNERS[name], "cycles=1", "record=trace", "record.weights=true"), tmp_path)
    assert bytes_held(StoredRun(tmp_path)) == bytes_used(StoredRun(tmp_path)) == held


def test_bytes_that_a_cmac_uses_are_those_of_its_rows_on_the_path(make_config, tmp_path):
    run_scenario(make_config("cycles=1", "record=trace", "record.weights=true"), tmp_path)
    rest = 8 * (2 * 6 + 1)  # ranges and seed
    assert bytes_held(StoredRun(tmp_path)) == 2**20 + rest
    assert bytes_used(StoredRun(tmp_path)) == 16 * StoredRun(tmp_path).manifest["memory"][0]["rows_used"] + rest
