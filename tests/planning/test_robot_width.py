"""Where the feet of a robot stand: by the hip angle of home, below the thigh joint, or at the width of the stance."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import compose_config, make_mechanism, make_scenario
from support.robots import OWN, read

from cmacexp.planning.machine import find_stance

pytestmark = pytest.mark.ci
HEIGHT = 0.28
OFFSET = 0.06


def read_with_knees_outside(folder, home=(0.0, 0.9, -1.8)):
    """The project's own robot with its knees OFFSET to the side of the thigh joints."""
    text = OWN.read_text()
    for leg, side in (("FL", 1), ("FR", -1), ("RL", 1), ("RR", -1)):
        assert f'name="{leg}_calf" pos="0 0' in text
        text = text.replace(f'name="{leg}_calf" pos="0 0', f'name="{leg}_calf" pos="0 {side * OFFSET}')
    path = folder / "knees.xml"
    path.write_text(text)
    return read(path, home=home)


def test_a_foot_beside_its_thigh_joint_stands_where_the_hip_angle_of_home_puts_it(tmp_path):
    sides = np.array([1.0, -1.0, 1.0, -1.0])
    below = find_stance(read(), HEIGHT).hips[:, 1]
    assert_allclose(
        find_stance(read_with_knees_outside(tmp_path), HEIGHT).hips[:, 1], below + OFFSET * sides, atol=1e-9
    )
    tilted = np.array([[0.2 * side, 0.9, -1.8] for side in sides])
    wide = find_stance(read(home=tilted), HEIGHT)
    # The thigh joint is 0.08 m beside the axis of the hip, which turns it by 0.2 rad.
    beside = 0.08 * (np.cos(0.2) - 1.0) + (HEIGHT + 0.08 * np.sin(0.2)) * np.tan(0.2)
    assert_allclose(wide.hips[:, 1], below + beside * sides, atol=1e-6)


def test_a_foot_that_is_nearly_below_its_thigh_joint_stands_below_it():
    assert (find_stance(read(home=(0.005, 0.9, -1.8)), HEIGHT).hips == find_stance(read(), HEIGHT).hips).all()


def test_the_width_of_the_stance_counts_before_home():
    machine = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}")
    for width in (0.2, 0.31):
        config = compose_config([*machine, f"gait.width={width}", "machine.home=[0.2,0.9,-1.8]"])
        left = make_mechanism(config.machine).hips[:, 1]
        assert_allclose(left[::2] - left[1::2], width, atol=1e-12)


@pytest.mark.parametrize(("width", "is_narrow"), [(0.1, True), (0.25, False)])
def test_a_run_says_that_its_stance_is_narrow_unless_warnings_are_off(width, is_narrow):
    machine = ("scenario=robot", "machine=mjcf", f"machine.path={OWN}", f"gait.width={width}")
    warnings = make_scenario(compose_config(machine)).warnings
    assert ["use a larger gait.width or posture.gain" in text for text in warnings] == [True] * is_narrow
    assert not make_scenario(compose_config([*machine, "warn=false"])).warnings
