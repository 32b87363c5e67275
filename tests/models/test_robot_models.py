"""Models that are no quadruped of three hinges a leg are refused by their key; packages are only found."""

import os
import sys
from xml.etree import ElementTree

import pytest
from support.doors import BadInput
from support.robots import FEET, HOME, JOINTS, OWN, change, read

from cmacexp.models import robot_file as find
from cmacexp.models.robot import read_robot
from cmacexp.models.robot_spec import LEAST_INERTIA, POINT_INERTIA, _find_mesh, _make_possible

INSIDE = "<worldbody>"
FOOT = '<geom name="FL"'
SLIDE = '<joint name="FL_calf_joint" class="calf"'
MOTOR = '    <motor name="RR_calf" class="calf" joint="RR_calf_joint"/>\n'
WHEEL = '<body><joint name="FL_wheel" axis="0 1 0"/><geom size="0.02 0.01" mass="1"/></body>'
CHANGES = {
    "no MJCF": ("<mujoco", "<html", "path="),
    "a joint of another name": ("RR_calf_joint", "RR_knee", "joints=RR_calf_joint"),
    "a foot of another name": ('<geom name="RL"', '<geom name="rear"', "feet=RL"),
    "a slide": (SLIDE, f'{SLIDE} type="slide"', "joints=FL_calf_joint"),
    "a wheel": (FOOT, WHEEL + FOOT, "joints=FL_wheel"),
    "a joint without an actuator": (MOTOR, "", "joints=RR_calf_joint"),
    "no mass": ('mass="0.8"', 'mass="0"', "path="),
    "a pipe": (INSIDE, f'<include file="pipe"/>{INSIDE}', "path=.*pipe"),
    "a file that names a pipe": (INSIDE, f'<include file="other.xml"/>{INSIDE}', "path=.*pipe"),
    "a mesh that is a pipe": (INSIDE, f'<asset><mesh file="&#112;ipe"/></asset>{INSIDE}', "path=.*pipe"),
}


@pytest.fixture
def folder(tmp_path):
    """A folder with a pipe, which would be waited for."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "other.xml").write_text("<mujoco><include file='pipe'/></mujoco>")
    return tmp_path


@pytest.mark.ci
@pytest.mark.parametrize("what", CHANGES)
def test_a_model_that_is_no_quadruped_is_refused(folder, what):
    old, new, message = CHANGES[what]
    with pytest.raises(BadInput, match=rf"^machine\.{message}") as raised:
        read(change(folder, old, new))
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.ci
def test_what_stands_in_comments_makes_no_template(tmp_path):
    path = change(tmp_path, INSIDE, f'<!-- <xacro:leg/> ${{size}} <robot > a="nan" -->{INSIDE}')
    assert read(path).fingerprint == read().fingerprint


def swap(names, i, j):
    names = list(names)
    names[i], names[j] = names[j], names[i]
    return names


NAMES = [
    (JOINTS[:2], FEET[:2], "joints="),
    ([leg[:2] for leg in JOINTS], FEET, "joints="),
    (JOINTS, FEET[:2], "feet=FL, FR:"),
    (JOINTS, ("FL", "FL", "RL", "RR"), "feet=FL, FL, RL, RR:"),
    (JOINTS, swap(FEET, 0, 1), "feet=FR:"),
    (swap(JOINTS, 0, 2), swap(FEET, 0, 2), "feet=RL, FR, FL, RR:"),
    ([swap(JOINTS[0], 1, 2), *JOINTS[1:]], FEET, "feet=FL:"),
    ([JOINTS[0], JOINTS[0], *JOINTS[2:]], FEET, "joints=FR_hip_joint, FR_thigh_joint, FR_calf_joint:"),
]


@pytest.mark.ci
@pytest.mark.parametrize(("joints", "feet", "key"), NAMES)
def test_names_that_do_not_fit_the_model_are_refused(joints, feet, key):
    with pytest.raises(BadInput, match=rf"^machine\.{key}"):
        read_robot(OWN, joints, feet, HOME)


def test_a_path_counts_before_the_name(monkeypatch):
    assert find.find_model("go1", str(OWN)) == OWN.resolve()
    monkeypatch.setenv("HOME", str(OWN.parent))
    assert find.find_model(None, f"~/{OWN.name}") == OWN.resolve()
    for path, fault in {"nowhere.xml": "there is no such file", "~": "is a folder"}.items():
        with pytest.raises(BadInput, match=rf"^machine\.path={path}: {fault}"):
            find.find_model("go1", path)


def test_a_package_is_found_and_not_imported(tmp_path, monkeypatch):
    folder = tmp_path / "robots_of_a_test" / "robot_model" / "own"
    folder.mkdir(parents=True)
    (folder / "own.xml").write_text(OWN.read_text())
    (folder / "scene.xml").write_text("")
    (tmp_path / "robots_of_a_test" / "__init__.py").write_text("raise RuntimeError")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(find, "PACKAGE", "robots_of_a_test")
    assert find.package_models() == {"own": folder / "own.xml"}
    with pytest.raises(BadInput, match=r"^machine\.model=go3: .*installed are own"):
        find.find_model("go3", None)
    assert "robots_of_a_test" not in sys.modules


def test_files_of_a_model_are_found_in_its_packages(tmp_path):
    mesh = tmp_path / "meshes" / "calf.stl"
    mesh.parent.mkdir()
    mesh.touch()
    (tmp_path / "thigh.stl").write_text("version https://git-lfs.github.com/spec/v1")
    names = {"package://robot/meshes/calf.stl": "", "meshes/calf.stl": "", "calf.stl": "calf.stl"}
    names["thigh.stl"] = "thigh.stl (a Git LFS pointer: run git lfs pull)"
    for name, absent in names.items():
        element = ElementTree.Element("mesh", filename=name)
        assert _find_mesh(element, [tmp_path]) == absent
        assert element.get("filename") == (name if absent else str(mesh))


@pytest.mark.parametrize(
    ("mass", "ixx", "expected"),
    [("2", "1", "1"), ("2", "-1", str(2 * POINT_INERTIA)), ("1e-9", "0", str(LEAST_INERTIA)), ("0", "0", None)],
)
def test_an_inertia_that_no_body_has_becomes_that_of_a_point(mass, ixx, expected):
    inertia = f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    link = ElementTree.fromstring(f'<link><inertial><mass value="{mass}"/>{inertia}</inertial></link>')
    _make_possible(link, link[0])
    left = link.find("inertial/inertia")
    assert (None if left is None else left.get("ixx")) == expected
