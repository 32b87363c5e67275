"""The study of changing ground: what counts as recovered, advice that follows the data, a report of a quick run."""

import numpy as np
import pandas as pd
import pytest
from support.command import python

from cmacexp.config.compose import compose_config
from pipelines.analysis import terrain_recovery
from pipelines.analysis.terrain_measures import Walked, errors_of
from pipelines.analysis.terrain_recovery import LEG, Recovery, recoveries, recovery
from pipelines.analysis.terrain_shape import patches_advice, slope_advice, walked
from pipelines.shared.stats import Spread
from pipelines.terrain import jobs


class Run:
    """What is read of a stored run of one leg."""

    walks = False

    def __init__(self, force, status="completed"):
        self.status = status
        cycles = np.arange(1, len(force) + 1)
        self.metrics = pd.DataFrame({"cycle": cycles, **dict.fromkeys(LEG, np.array(force))})
        self.config = {"terrain": {"step_time": 15.0}, "payload": {"time": 0.0}}


@pytest.mark.parametrize(
    ("since", "expected"),
    [
        ([1.0] * 6, (1.0, 1.0, 0, 0)),
        ([9.0, 4.0, 1.1, 1.0, 1.0, 1.0, 1.0, 1.0], (9.0, 1.0, 2, 2)),
        ([9.0, 1.0, 4.0, 1.0, 1.0, 1.0, 1.0, 1.0], (9.0, 1.0, 3, 3)),  # it has to stay
        ([9.0, 4.0, 2.0, 2.0, 2.0, 2.0, 2.0], (9.0, 2.0, None, 2)),
        ([0.5] * 6, (0.5, 0.5, 0, 0)),
    ],
)
def test_an_error_has_recovered_once_it_stays_near_its_level(since, expected):
    found = recovery(np.array([7.0, 1.0, 1.0, 1.0, 1.0, 1.0, *since]), 6)
    assert found.before == 1.0
    assert (found.worst, pytest.approx(found.end), found.to_before, found.to_end) == expected


def test_errors_are_pooled_over_legs_and_in_their_units():
    run = Run([3.0, 4.0])
    run.metrics = pd.concat([run.metrics, run.metrics.assign(transfer_rmse_x=0.0)])
    assert errors_of(run, LEG)["transfer_rmse_x"].to_list() == pytest.approx([3e3 / 2**0.5, 4e3 / 2**0.5])
    assert errors_of(run, LEG)["force_rmse"].to_list() == [3.0, 4.0]


def test_a_run_that_fell_has_no_recovery():
    assert recoveries(Run([1.0] * 10, "fell"), LEG) == {}
    assert recoveries(Run([1.0] * 5 + [2.0] * 5), LEG)["force_rmse"] == Recovery(1.0, 2.0, 2.0, None, 0)


@pytest.mark.parametrize("quick", [True, False])
def test_every_run_can_be_composed_and_changes_while_it_runs(quick):
    asked = jobs(quick)
    for name, overrides in asked.items():
        config = compose_config([*overrides, "record=trace"])
        if name.split(",")[0] in terrain_recovery.CHANGES:
            time = config.terrain.step_time if config.payload.weight == 0.0 else config.payload.time
            assert 0.0 < time < config.cycles * 3.0
            assert time % 3.0 == 0.0
    assert len(asked) == (20 if quick else 68)


def on(ground, force, tilt=10.0, walked=1, runs=1):
    return Walked(ground, runs, walked, Spread(force, 0.1), Spread(tilt, 1.0))


def test_advice_on_patches_follows_the_data():
    alone = [on(0.0, 4.0), on(0.4, 4.0), on(0.8, 4.0)]
    good = patches_advice({"with CMAC": [on(0.0, 1.0), on(0.4, 2.0), on(0.8, 5.0)], "feedback alone": alone})
    assert "up to a spread of 0.4 learning presses better" in good
    assert "end early" not in good
    falls = patches_advice(
        {"with CMAC": [on(0.0, 1.0), on(0.4, 2.0), on(0.8, 3.0, walked=3, runs=5)], "feedback alone": alone}
    )
    assert "from a spread of 0.8 on some walks end early" in falls
    bad = patches_advice({"with CMAC": [on(0.0, 5.0), on(0.4, 5.0), on(0.8, 5.0)], "feedback alone": alone})
    assert "leave the CMAC off" in bad


def test_advice_on_slopes_is_the_steepest_that_is_walked_level():
    learned = [on(-0.2, 1.0, 90.0), on(-0.1, 1.0), on(0.0, 1.0), on(0.1, 1.0, walked=0), on(0.2, 1.0)]
    alone = [on(slope, 4.0, 78.0) for slope in (-0.2, -0.1, 0.0, 0.1, 0.2)]
    said = slope_advice({"with CMAC": learned, "feedback alone": alone})
    assert said.endswith("At 10% learning falls where feedback alone walks on.")
    assert "up to 0% uphill and 10% downhill" in said
    assert "leans by 78 mrad on flat ground already" in said
    same = slope_advice({"with CMAC": learned, "feedback alone": learned})
    assert "feedback alone keeps that up to 0% and 10%" in same
    assert "walks on" not in same


def test_walks_that_end_early_count_but_have_no_error():
    class Walk(Run):
        def __init__(self, status):
            super().__init__([1.0] * 6, status)
            self.metrics = self.metrics.assign(force_rmse_cycle=2.0, transfer_rmse_y=0.0)
            self.body_metrics = pd.DataFrame({"cycle": range(1, 7), "tilt_max": 0.01})

    found = walked(0.4, [Walk("completed"), Walk("fell"), Walk("completed")])
    assert (found.runs, found.walked) == (3, 2)
    assert (found.force.mean, found.tilt.mean) == pytest.approx((2.0, 10.0))


def test_the_command_leaves_a_report_whose_sections_end_in_advice(tmp_path):
    done = python("-m", "pipelines.terrain", "--quick", "--folder", str(tmp_path), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "terrain-quick" / "report.html").read_text()
    for sentence in ("Leave learning on", "Patches need no map", "With CMAC a plan for flat ground does"):
        assert sentence in page
