"""Names, feet and home that are found in a model: by how its bodies hang together, whatever they are called."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import BadInput
from support.robots import FEET, JOINTS, OWN, change, read, turn_frame

from cmacexp.models.robot_gains import HEIGHT_OF_LINKS
from cmacexp.models.robot_search import find_names

pytestmark = pytest.mark.ci


def test_joints_and_feet_are_found_in_the_order_of_legs_at_a_home_of_the_usual_height():
    names = find_names(OWN)
    assert (names.joints, names.feet) == ([list(leg) for leg in JOINTS], list(FEET))
    robot = read(OWN, names.joints, names.feet, names.home)
    data = robot.at(np.array(names.home))
    thighs = data.xanchor[[robot.model.joint(leg[1]).id for leg in JOINTS]]
    calves = data.xanchor[[robot.model.joint(leg[2]).id for leg in JOINTS]]
    feet = data.geom_xpos[[robot.model.geom(name).id for name in FEET]]
    links = np.linalg.norm(calves - thighs, axis=1) + np.linalg.norm(feet - calves, axis=1)
    assert_allclose(thighs[:, 2] - feet[:, 2], HEIGHT_OF_LINKS * links, atol=0.003)
    assert_allclose(feet[:, 0], thighs[:, 0], atol=0.003)
    assert (calves[:, 0] < feet[:, 0]).all()


@pytest.mark.parametrize("quaternion", ["0.7071 0 0 0.7071", "0.7071 -0.7071 0 0"])
def test_legs_in_a_turned_frame_are_refused_in_the_order_that_they_have(tmp_path, quaternion):
    """A frame whose y axis points forward, and one whose y axis points up."""
    path = tmp_path / "turned.xml"
    path.write_text(turn_frame(quaternion))
    with pytest.raises(BadInput, match=r"^machine\.feet=FL, FR, RL, RR: .* turn the frame"):
        find_names(path)


def test_three_legs_are_refused_with_the_joints_that_they_end_at(tmp_path):
    slide = '<joint name="RR_calf_joint" class="calf"'
    with pytest.raises(BadInput, match=r"has 3 chains .* end at FL_calf_joint, FR_calf_joint, RL_calf_joint"):
        find_names(change(tmp_path, slide, f'{slide} type="slide"'))


def test_the_lowest_sphere_of_a_body_is_its_foot(tmp_path):
    foot = '<geom name="FL" class="foot" pos="0.005 0 -0.21" mass="0.05"/>'
    more = '<geom class="foot" pos="0.005 0 -0.11" mass="0"/>'
    path = change(tmp_path, foot, more + foot.replace('name="FL" ', "") + more)
    found = read(path, feet=("FL_calf", *FEET[1:]))
    assert_allclose(found.feet_at_zero, read().feet_at_zero)
