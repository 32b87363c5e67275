"""Names, feet and home that are found in a model: by how its bodies hang together, whatever they are called."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import BadInput
from support.robots import FEET, JOINTS, OWN, change, read, turn_frame

from cmacexp.models.robot import read_robot
from cmacexp.models.robot_gains import HEIGHT_OF_LINKS, linearise
from cmacexp.models.robot_search import USUAL_HOME, find_names, find_yaw

pytestmark = pytest.mark.ci


def test_joints_and_feet_are_found_in_the_order_of_legs_at_the_usual_home():
    names = find_names(OWN)
    assert (names.joints, names.feet, names.home) == ([list(leg) for leg in JOINTS], list(FEET), list(USUAL_HOME))


def test_where_axes_point_to_the_right_a_home_of_the_usual_height_is_found(tmp_path):
    def turn(found):
        low, high = (-float(angle) for angle in found[1].split())
        return f'axis="0 -1 0" range="{high} {low}"'

    path = tmp_path / "mirrored.xml"
    path.write_text(re.sub(r'axis="0 1 0" range="([^"]*)"', turn, OWN.read_text()))
    names = find_names(path)
    robot = read(path, names.joints, names.feet, names.home)
    data = robot.at(np.array(names.home))
    thighs = data.xanchor[[robot.model.joint(leg[1]).id for leg in JOINTS]]
    calves = data.xanchor[[robot.model.joint(leg[2]).id for leg in JOINTS]]
    feet = data.geom_xpos[[robot.model.geom(name).id for name in FEET]]
    links = np.linalg.norm(calves - thighs, axis=1) + np.linalg.norm(feet - calves, axis=1)
    assert_allclose(thighs[:, 2] - feet[:, 2], HEIGHT_OF_LINKS * links, atol=0.003)
    assert_allclose(feet[:, 0], thighs[:, 0], atol=0.003)
    assert (calves[:, 0] < feet[:, 0]).all()


@pytest.mark.parametrize("degrees", [-170, -120, -90, -30, 0, 10, 45, 90, 135, 180])
def test_the_direction_of_a_turned_trunk_is_found_by_the_names_of_its_legs(tmp_path, degrees):
    """The robot that is read is that of the frame that is not turned; up to 15 degrees the frame stays."""
    path = tmp_path / "turned.xml"
    half = np.radians(degrees) / 2
    path.write_text(turn_frame(f"{np.cos(half)} 0 0 {np.sin(half)}"))
    yaw, expected = find_yaw(path), np.radians(degrees if abs(degrees) > 15 else 0)
    assert np.exp(1j * yaw) == pytest.approx(np.exp(1j * expected), abs=1e-6)  # so that -180 is 180 degrees
    if yaw:
        robot, turned = read(), read_robot(path, JOINTS, FEET, (0.0, 0.9, -1.8), yaw=yaw)
        assert_allclose(turned.hinges, robot.hinges, atol=1e-9)
        assert_allclose(turned.feet_at_zero, robot.feet_at_zero, atol=1e-9)
        assert_allclose(linearise(turned).inertia, linearise(robot).inertia, atol=1e-9)


def test_without_names_forward_is_on_the_side_of_x_or_of_y(tmp_path):
    path = tmp_path / "turned.xml"
    for degrees, expected in {-90: 90, 180: 0}.items():
        half = np.radians(degrees) / 2
        text = turn_frame(f"{np.cos(half)} 0 0 {np.sin(half)}")
        for number, name in enumerate(FEET):
            text = text.replace(f"{name}_", f"leg{number}_")
        path.write_text(text)
        assert find_yaw(path) == pytest.approx(np.radians(expected), abs=1e-6)


def test_three_legs_are_refused_with_the_joints_that_they_end_at(tmp_path):
    slide = '<joint name="RR_calf_joint" class="calf"'
    with pytest.raises(
        BadInput, match=r"must have four legs.* RR_hip_joint > RR_thigh_joint > RR_calf_joint \(a slide\)"
    ):
        find_names(change(tmp_path, slide, f'{slide} type="slide"'))


def test_the_lowest_sphere_of_a_body_is_its_foot(tmp_path):
    foot = '<geom name="FL" class="foot" pos="0.005 0 -0.21" mass="0.05"/>'
    more = '<geom class="foot" pos="0.005 0 -0.11" mass="0"/>'
    path = change(tmp_path, foot, more + foot.replace('name="FL" ', "") + more)
    found = read(path, feet=("FL_calf", *FEET[1:]))
    assert_allclose(found.feet_at_zero, read().feet_at_zero)
