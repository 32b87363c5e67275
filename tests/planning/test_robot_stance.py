"""Stances that the legs of a robot cannot reach; these laws need no MuJoCo."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.doors import BadInput

from cmacexp.planning.machine import _require_stance


def test_a_stance_out_of_reach_names_the_height_or_the_leg():
    ranges = np.tile([-3.0, 3.0], (4, 3, 1))
    robot = SimpleNamespace(links=(0.2, 0.2), home=np.zeros((4, 3)), ranges=ranges)
    q = np.zeros((4, 3))
    _require_stance(robot, 0.3, None, q)
    q[2, 1] = np.nan
    for height, match in {0.5: "hip_height.*0.4 m long together", 0.3: "machine.home.*left.rear"}.items():
        with pytest.raises(BadInput, match=match):
            _require_stance(robot, height, None, q)
