"""The delay that the feedback of a robot bears as it stands."""

import pytest
from support.robots import read

from cmacexp.models.lead import discretise
from cmacexp.models.loop_delay import LoopDelay
from cmacexp.models.robot_gains import derive_basis, derive_gains, find_standing_margin

pytestmark = pytest.mark.ci
PERIOD = 0.001


@pytest.mark.parametrize("lag", [0.005, 0.015])
def test_a_declared_delay_uses_up_the_margin_and_stiffer_posture_lowers_it(lag):
    robot, lead = read(), discretise(10.0, 3.0, PERIOD)
    basis = derive_basis(robot)
    gains = derive_gains(basis, PERIOD, lead.b0, LoopDelay(0, (lag,)))

    def find(gains, latency=0.0):
        ground = (basis.stiffness, basis.damping)
        return find_standing_margin(robot, ground, gains, lead, PERIOD, LoopDelay(0, (lag,), latency)).delay

    margin = find(gains)
    assert find(gains, margin / 2.0) == pytest.approx(margin / 2.0, rel=0.05)
    assert find(gains._replace(posture_rate_gain=3.0 * gains.posture_rate_gain)) < 0.8 * margin
