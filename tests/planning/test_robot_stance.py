"""Legs of a robot in the frames of their hips, and stances that they cannot reach; these laws need no MuJoCo."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import BadInput

from cmacexp.planning.machine import _require_stance, make_chains


def test_a_stance_out_of_reach_names_the_height_or_the_leg():
    ranges = np.tile([-3.0, 3.0], (4, 3, 1))
    robot = SimpleNamespace(links=(0.2, 0.2), home=np.zeros((4, 3)), ranges=ranges)
    q = np.zeros((4, 3))
    _require_stance(robot, 0.3, q)
    q[2, 1] = np.nan
    for height, match in {0.5: "hip_height.*0.4 m long together", 0.3: "machine.home.*left.rear"}.items():
        with pytest.raises(BadInput, match=match):
            _require_stance(robot, height, q)


def test_chains_are_in_the_frame_of_the_hip_forward_down_and_left():
    hinges = np.zeros((4, 3, 6))
    hinges[..., :3], hinges[..., 3:] = [0.3, 0.1, -0.2], [0.0, 1.0, 0.0]
    robot = SimpleNamespace(hinges=hinges, feet_at_zero=np.tile([0.3, 0.1, -0.6], (4, 1)))
    chains = make_chains(robot, np.tile([0.2, 0.1, 0.0], (4, 1)))
    assert_allclose(chains, np.tile([*[0.1, 0.2, 0.0, 0.0, 0.0, 1.0] * 3, 0.1, 0.6, 0.0], (4, 1)))
