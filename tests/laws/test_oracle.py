"""The closed loop against a second implementation that shares no line with it."""

import pytest
from numpy.testing import assert_allclose
from support.oracle import simulate
from support.rollout import roll_out

from cmacexp.loop.scenario import make_scenario

COLUMNS = (
    "q1", "q2", "dq1", "dq2", "force", "tau_feedback_1", "tau_feedback_2", "tau_feedforward_1", "tau_feedforward_2"
)  # fmt: skip
LEG = ("scenario=one_leg", "cmac.addressing=visited", "cycles=2")
CASES = {
    "learning from the first step": (["learning.start_cycle=1"], {}),
    "learning from the second cycle": (["gait.cycle_time=1.5"], {"cycle_time": 1.5, "start_cycle": 2}),
    "another lead on stiffer ground than assumed": (
        [
            "gait.cycle_time=1.5",
            "learning.start_cycle=1",
            "learning.lead=1",
            "terrain.stiffness=20",
            "terrain.assumed_stiffness=10",
        ],
        {"cycle_time": 1.5, "lead": 1, "stiffness": 20.0},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_one_leg_goes_as_the_oracle_says(make_config, case):
    overrides, changes = CASES[case]
    columns = roll_out(make_scenario(make_config(*LEG, *overrides))).columns()
    told = simulate(**changes).T
    assert abs(told[7:]).max() > 1.0
    for name, expected in zip(COLUMNS, told, strict=True):
        assert_allclose(columns[name][:, 0], expected, rtol=0.0, atol=1e-9, err_msg=name)
