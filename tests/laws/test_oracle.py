"""The closed loop against a second implementation that shares no line with it."""

import pytest
from numpy.testing import assert_allclose
from support.doors import make_scenario, roll_out
from support.oracle import simulate

COLUMNS = (
    "q1", "q2", "dq1", "dq2", "force", "tau_feedback_1", "tau_feedback_2", "tau_feedforward_1", "tau_feedforward_2"
)  # fmt: skip
CASES = {
    "learning from the first step": (["learning.start_cycle=1"], {}),
    "learning from the second cycle": ([], {"start_cycle": 2}),
    "another lead on stiffer ground than assumed": (
        ["learning.start_cycle=1", "learning.lead=1", "terrain.stiffness=20", "terrain.assumed_stiffness=10"],
        {"lead": 1, "stiffness": 20.0},
    ),
    "another form of G, a network over the angles": (
        ["plant.gravity_factors=[0,-1,-1,1]", "cmac.inputs=[angle]"],
        {"gravity": (0, -1, -1, 1), "inputs": 2, "start_cycle": 2},
    ),
}


@pytest.mark.parametrize("cycle_time", [0.5, pytest.param(3.0, marks=pytest.mark.ci)])
@pytest.mark.parametrize("case", CASES)
def test_one_leg_goes_as_the_oracle_says(make_config, case, cycle_time):
    overrides, changes = CASES[case]
    own = ("scenario=one_leg", "cmac.addressing=visited", "cycles=2", f"gait.cycle_time={cycle_time}", *overrides)
    columns = roll_out(make_scenario(make_config(*own))).columns()
    told = simulate(cycle_time, **changes).T
    assert abs(told[7:]).max() > 1.0
    for name, expected in zip(COLUMNS, told, strict=True):
        assert_allclose(columns[name][:, 0], expected, rtol=0.0, atol=1e-9, err_msg=name)
