"""The study of feedforwards: what it concludes follows the data, and its quick form leaves a whole report."""

from pathlib import Path

import numpy as np
import pytest
from pipelines.shared.runs import Runs
from support.command import ROOT, python

from cmacexp.data.integrity import faults
from cmacexp.data.stored_run import StoredRun
from cmacexp.experiment import run_scenario
from pipelines.analysis.feedforward_change import left_at_first, verdict_of
from pipelines.analysis.feedforward_kinds import (
    ALONE,
    CMAC,
    EXACT,
    ILC,
    MLP,
    ONE_LEG,
    RBF,
    WRONG,
    Course,
    level,
    name_of,
    of_kind,
    spread,
)
from pipelines.analysis.feedforward_memory import bytes_of
from pipelines.analysis.feedforward_words import advice_one_leg, beaten, claims

nan, inf = float("nan"), float("inf")


def course(*errors, force=1.0):
    """A course for each seed with such errors in x, none in y."""
    x = np.array(errors, dtype=float)
    same = np.full_like(x, force)
    return Course(x, np.zeros_like(x), same, same, same, ["completed"] * len(x))


def found(**changes):
    fast, slow = [50.0, 50.0, 20.0, 4.0, 3.0, 2.0], [50.0, 50.0, 40.0, 30.0, 20.0, 4.0]
    taken = {
        ALONE: course([50.0] * 6),
        EXACT: course([5.0] * 6),
        **{name: course([8.0] * 6) for name in WRONG.values()},
        CMAC: course(fast, fast),
        RBF: course(slow),
        MLP: course(slow),
        ILC: course(slow),
    }
    return {**taken, **changes}


def test_learnt_is_the_first_cycle_from_which_errors_stay_small():
    bounds = course([9.0, 2.0, 9.0, 2.0, 1.0], [1.0] * 5, [9.0] * 5, [9.0, 1.0, 1.0, nan, nan])
    np.testing.assert_array_equal(bounds.cycles_to(2.0), [4.0, 1.0, inf, inf])
    assert level(found()[ALONE]) == 5.0


def test_best_is_the_cycle_of_the_least_error_of_each_seed():
    two = course([3.0, 1.0, 2.0], [3.0, 4.0, nan])
    np.testing.assert_array_equal(two.best, [1, 0])
    np.testing.assert_array_equal(two.at_best(two.x), [1.0, 3.0])
    assert np.isnan(two.at(two.x, 4)).all()


def test_spread_tells_mean_and_deviation():
    assert spread(np.array([1.0, 3.0])) == "2.00 ± 1.41"
    assert spread(np.array([2.0])) == "2.00"
    assert spread(np.array([0.01234, 0.01234])) == "0.012 ± 0"
    assert spread(np.array([2.0, nan])) == "-"
    assert spread(np.array([inf, inf])) == "never"
    assert spread(np.array([inf, 2.0])) == "not with 1 of 2 seeds"


def test_what_beats_cmac_is_said_and_what_does_not_is_not():
    assert "RBF" not in beaten(found())
    text = beaten(found(RBF=course([50.0, 4.0, 3.0, 2.0, 1.0, 1.0])))
    assert "cycles to a tenth of the error: RBF 2.00 against 4.00" in text
    assert "best transfer error, mm,: RBF 1.00 against 2.00" in text
    assert "force error, N, in cycle 5: none (1.00)" in text
    hardly = beaten(found(RBF=course([50.0, 50.0, 20.0, 4.0, 2.9, 1.9])))
    assert "RBF" not in hardly


def verdicts(courses, walk=None):
    kinds = (CMAC, RBF, MLP, ILC)
    runs = Runs({name_of(ONE_LEG, kind): StoredRun(Path(kind)) for kind in kinds}, Path())
    return [claim.verdict for claim in claims(runs, courses, walk or courses)]


def test_cmac_learns_rapidly_only_if_nothing_is_faster():
    assert verdicts(found())[0] == "reproduced"
    faster = found(RBF=course([50.0, 4.0, 3.0, 2.0, 1.0, 1.0]))
    assert verdicts(found(), faster)[0] == verdicts(faster, found())[0] == "reproduced in part"
    assert verdicts(faster)[0] == "contradicted"
    never = course([50.0] * 6)
    assert verdicts(found(CMAC=never, RBF=never, MLP=never, ILC=never))[0] == "contradicted"


def test_a_perceptron_trains_for_long_only_if_it_does():
    assert verdicts(found())[1] == "contradicted"  # 6 cycles against 4
    assert verdicts(found(MLP=course([50.0] * 6)))[1] == "reproduced"


def test_advice_names_the_fastest():
    assert "CMAC gets there soonest" in advice_one_leg(found())
    assert "RBF gets there soonest" in advice_one_leg(found(RBF=course([50.0, 4.0, 3.0, 2.0, 1.0, 1.0])))


def test_what_is_left_after_a_change_is_of_feedback_alone_in_the_same_cycle():
    fresh = {ALONE: course([40.0, 50.0]), EXACT: course([4.0, 5.0]), CMAC: course([40.0, 20.0])}
    left = left_at_first(fresh, {CMAC: course([10.0, 5.0])})
    assert {kind: float(values[0]) for kind, values in left.items()} == {ALONE: 1.0, EXACT: 0.1, CMAC: 0.25}


def test_cmac_generalises_if_little_of_the_error_is_left():
    assert [verdict_of(left) for left in (0.1, 0.5, 0.9)] == ["reproduced", "reproduced in part", "not reproduced"]


def test_seeds_of_a_kind_are_told_from_those_of_a_longer_name():
    names = ("one leg: CMAC, seed 0", "one leg: CMAC, seed 1", "one leg: CMAC of angles, seed 0", "one leg: RBF")
    runs = Runs({name: StoredRun(Path(name)) for name in names}, Path())
    assert list(of_kind(runs, ONE_LEG, CMAC)) == list(names[:2])
    assert list(of_kind(runs, ONE_LEG, RBF)) == ["one leg: RBF"]


@pytest.mark.parametrize(
    ("name", "held"),
    [("rbf", 8 * (200 + 8 + 400)), ("ilc", 8 * 1200), ("mlp", 8 * (4 * 32 + 32 + 2 * 32 + 2 + 9))],
)
def test_bytes_by_hand(make_config, tmp_path, name, held):
    config = make_config(f"feedforward={name}", "cycles=1", "record=trace", "record.weights=true")
    run_scenario(config, tmp_path)
    assert bytes_of(StoredRun(tmp_path)) == (held, held)


def test_bytes_that_a_cmac_uses_are_those_of_its_rows_on_the_path(make_config, tmp_path):
    run_scenario(make_config("cycles=1", "record=trace", "record.weights=true"), tmp_path)
    held, used = bytes_of(StoredRun(tmp_path))
    rest = 8 * (2 * 6 + 1)  # ranges and seed
    assert held == 2**20 + rest
    assert used == 16 * StoredRun(tmp_path).manifest["memory"][0]["rows_used"] + rest


def test_quick_form_leaves_a_whole_report(tmp_path):
    done = python("-m", "pipelines.feedforwards", "--quick", "--folder", str(tmp_path), folder=ROOT)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "feedforwards-quick"
    names = {path.name for path in (folder / "figures").glob("*.png")}
    assert names == {"learning_one_leg.png", "learning_four_legs.png", "after_a_change.png"}
    assert (folder / "cost.parquet").is_file()
    assert not faults(folder)
    assert any(run.name.endswith("-weights") for run in (tmp_path / "runs").iterdir())
