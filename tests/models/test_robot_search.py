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


def test_legs_that_stand_far_from_the_usual_home_have_another_one(tmp_path):
    """The zero of each calf is turned by 1.7 rad, so that it stands near 0 instead of near -1.7."""
    path = tmp_path / "turned.xml"
    text = OWN.read_text().replace('range="-2.7 -0.5"', 'range="-1.0 1.2"')
    path.write_text(re.sub(r'(<body name="\w+_calf" pos="[^"]*")', r'\1 euler="0 -1.7 0"', text))
    home = np.array(find_names(path).home)
    assert np.abs(home[..., 2]).max() < 0.5


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


def test_what_is_given_is_not_searched(tmp_path):
    path = change(tmp_path, 'range="-1.5 3.5"', 'range="3.1 3.5"')  # legs that point upwards
    with pytest.raises(BadInput, match=r"machine\.joints=FL_calf_joint: .*give machine\.home"):
        find_names(path)
    assert find_names(path, home=[0, 3.2, -1]).home == [0, 3.2, -1]
    bodies = [f"{leg}_calf" for leg in FEET]
    assert find_names(OWN, joints=JOINTS, feet=bodies) == ([list(leg) for leg in JOINTS], bodies, list(USUAL_HOME))
    with pytest.raises(BadInput, match=r"machine\.feet=FR: must hang on FL_hip_joint"):
        find_names(OWN, feet=("FR", "FL", "RL", "RR"))
    with pytest.raises(BadInput, match=r"machine\.joints=.*four lists of three names"):
        find_names(OWN, joints=JOINTS[:2])


def test_the_order_of_given_joints_says_where_the_front_is():
    assert abs(find_yaw(OWN, joints=JOINTS[::-1])) == pytest.approx(np.pi)
    assert find_yaw(OWN, joints=JOINTS[:1] + JOINTS[:0:-1]) == 0.0  # diagonal legs: refused later, in this frame
    with pytest.raises(BadInput, match=r"change the order, or machine\.yaw=1\.571"):
        find_names(OWN, joints=JOINTS, yaw=1.5708)


def test_names_say_where_the_front_is_if_hips_pitch_before_they_roll(tmp_path):
    text = change(tmp_path, 'class="hip"><joint axis="1 0 0"', 'class="hip"><joint axis="0 1 0"').read_text()
    path = tmp_path / "pitch.xml"
    path.write_text(text.replace('class="thigh"><joint axis="0 1 0"', 'class="thigh"><joint axis="1 0 0"'))
    assert find_yaw(path) == 0.0
    assert find_names(path, home=[0.9, 0, -1.8]).joints == [list(leg) for leg in JOINTS]
    path.write_text(re.sub("[FR][LR]_", lambda found: str(FEET.index(found[0][:2])), path.read_text()))
    assert abs(find_yaw(path)) == pytest.approx(np.pi / 2)


def test_the_lowest_sphere_of_a_body_is_its_foot(tmp_path):
    foot = '<geom name="FL" class="foot" pos="0.005 0 -0.21" mass="0.05"/>'
    more = '<geom class="foot" pos="0.005 0 -0.11" mass="0"/>'
    path = change(tmp_path, foot, more + foot.replace('name="FL" ', "") + more)
    found = read(path, feet=("FL_calf", *FEET[1:]))
    assert_allclose(found.feet_at_zero, read().feet_at_zero)
