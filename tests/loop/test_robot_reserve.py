"""What a planned walk needs, compared with what the robot has."""

import numpy as np

from cmacexp.loop.margin import Walk


def test_torques_beyond_the_limits_are_named():
    walk = Walk(np.ones(3), share=np.array([1.1, 0.9, 2.0]), widths=np.ones(2), margin=np.nan, roll_stiffness=np.nan)
    assert walk.list_warnings() == ["hip and calf need more torque than the model has: it may fall"]
