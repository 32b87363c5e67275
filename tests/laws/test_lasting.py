"""The settings that ship for lasting learning last."""

import numpy as np
import pytest

from cmacexp.experiment.run import run_scenario
from cmacexp.loop.scenario import make_scenario

THIN = ("record=trace", "record.every_nth_step=600")


def pooled(metrics, name):
    """RMS over the legs of each cycle."""
    return (metrics[name] ** 2).groupby(metrics["cycle"]).mean() ** 0.5


def test_lasting_is_the_paper_s_law_but_for_lead_and_a_rate_that_follows_from_it(make_config):
    lasting, paper = make_config("learning=lasting"), make_config("learning=paper")
    assert (lasting.learning.rule, lasting.learning.lead, lasting.learning.rate) == ("paper", "auto", "auto")
    on_time, late = (make_scenario(make_config("learning=lasting", f"actuator.delay={d}")) for d in (0, 2))
    assert on_time.feedforward.params.learning[:2] == (paper.learning.rate, 1)
    assert late.feedforward.params.learning[:2] == (paper.learning.rate / 5, 3)


def test_one_leg_stays_as_good_as_it_was(make_config, tmp_path):
    result = run_scenario(make_config("learning=lasting", "cycles=1500", *THIN), tmp_path)
    metrics = result.scores.legs.to_pandas()
    x, y = 1e3 * metrics["transfer_rmse_x"], 1e3 * metrics["transfer_rmse_y"]
    assert (result.status, result.manifest["drift"]) == ("completed", None)
    assert (x.iloc[-1] <= 0.05, y.iloc[-1] <= 0.5) == (True, True)
    assert max(v[-500:].max() / v[-500:].min() for v in (x, y)) <= 1.2
    assert metrics["feedforward_share"].iloc[-1] >= 0.95
    assert (np.diff(metrics["feedback_change"][200:]) < 0.0).mean() > 0.99


@pytest.mark.parametrize("late", ["actuator.delay=2", "actuator.lag=0.02"])
def test_a_late_actuator_does_not_end_it(make_config, tmp_path, late):
    result = run_scenario(make_config("learning=lasting", late, "cycles=300", *THIN), tmp_path / "auto")
    assert (result.status, result.manifest["drift"]) == ("completed", None)
    for lead in (0, 1):
        other = run_scenario(make_config(late, f"learning.lead={lead}", "cycles=300", *THIN), tmp_path / str(lead))
        assert other.status == "diverged"


def test_four_legs_press_as_they_are_to(make_config, tmp_path):
    result = run_scenario(make_config("scenario=quadruped_lasting", "cycles=150", *THIN), tmp_path)
    assert (result.status, result.manifest["drift"]) == ("completed", None)
    assert pooled(result.scores.legs.to_pandas(), "force_rmse_cycle").iloc[-1] <= 1.0
    assert 1e3 * result.scores.body.to_pandas()["tilt_max"].iloc[-1] <= 10.0
