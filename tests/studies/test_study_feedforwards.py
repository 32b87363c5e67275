"""The measures of the study of feedforwards: learning counted by hand, samples on made runs, bytes of weights."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cmacexp.data.stored_run import StoredRun
from cmacexp.experiment.run import run_scenario
from cmacexp.report.run_summary import RunSummary
from cmacexp.study import Results
from cmacexp.study.interval import UNPAIRED
from cmacexp.study.results import Row
from pipelines.common_worlds import TESTED, TUNED
from pipelines.feedforwards import against_fastest, cycles_to_tenth, left_at_first, runs, training_time
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
from pipelines.feedforwards_worlds import ANEW, CARRIED, EARLY, KEPT, at_best_rate, compare, mean_early

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
    assert against_fastest(never) == [UNPAIRED]  # with nothing to compare it with
    assert against_fastest(Results([*ROWS, *never.rows[1:2]])).tolist() == pytest.approx([2 / 3, inf])


def test_what_is_carried_over_is_compared_with_feedback_alone():
    assert left_at_first(Results([*ROWS[:1], run(CMAC, 10.0, *[4.0] * 5)])) == pytest.approx([0.2])


def in_world(world: int, row: Row, **settings) -> Row:
    """The same run in a world, whose number is the seed."""
    return replace(row, settings={**row.settings, "world": world, "seed": world, **settings})


def test_worlds_are_compared_each_with_itself_and_a_run_that_ended_is_infinitely_worse():
    errors = {ANEW: (10.0, 100.0, 10.0), CARRIED: (5.0, 80.0, 5.0)}
    rows = [in_world(w, run(CMAC, *[e] * 6, start=start)) for start, own in errors.items() for w, e in enumerate(own)]
    rows[-1] = in_world(2, run(CMAC, 5.0, 5.0, start=CARRIED))
    sample = compare({"start": CARRIED}, {"start": ANEW}, mean_early)
    assert sample(Results(rows[::-1])).tolist() == [inf, 0.8, 0.5]


def test_a_rate_is_chosen_in_worlds_that_it_is_not_tested_in():
    """The rate 2 is best in the worlds of the tests, but 1 is in those it is chosen in."""
    found = {(CMAC, 1): (4.0, 9.0), (CMAC, 2): (5.0, 1.0), (RBF, 1): (3.0, 6.0), (MLP, 1): (3.0, 90.0)}
    rows = [
        in_world(worlds[0], run(kind, *[error] * 6), **{"learning.rate": rate})
        for (kind, rate), errors in {**found, (ILC, 1): (3.0, 12.0)}.items()
        for worlds, error in zip((TUNED, TESTED), errors, strict=True)
    ]
    assert at_best_rate(Results(rows), EARLY) == pytest.approx([9.0 / 6.0])


@pytest.mark.parametrize("quick", [True, False])
def test_runs_after_a_change_start_from_runs_of_the_study_with_weights(quick):
    found = runs(quick)
    kept = [request for request in found if "record.weights=true" in request.overrides]
    carried = [request for request in found if request.labels.get("start") == CARRIED]
    assert {request.labels["kind"] for request in carried} == set(KEPT)
    assert all(request.starts_from in kept for request in found if request.starts_from)
    assert all(request.starts_from.labels["world"] == request.labels["world"] for request in carried)


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
