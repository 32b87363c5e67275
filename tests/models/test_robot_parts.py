"""What is read of a robot's model, on stand-ins of MuJoCo's model: these laws need no MuJoCo."""

import os
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.doors import BadInput

from cmacexp.models.robot import require_sizes
from cmacexp.models.robot_feet import _touch
from cmacexp.models.robot_legs import find_joint, torque_limits
from cmacexp.models.robot_spec import (
    MOST_MEGABYTES,
    POINT_INERTIA,
    _find_mesh,
    _make_possible,
    _require_size,
    set_run_options,
)

SPHERE, CAPSULE, CYLINDER, ELLIPSOID, BOX, MESH = range(6)
KINDS = SimpleNamespace(
    mjGEOM_SPHERE=SPHERE, mjGEOM_CAPSULE=CAPSULE, mjGEOM_CYLINDER=CYLINDER, mjGEOM_BOX=BOX, mjGEOM_MESH=MESH
)
MUJOCO = SimpleNamespace(
    mjtGeom=KINDS,
    mjtTrn=SimpleNamespace(mjTRN_JOINT=0),
    mjtBias=SimpleNamespace(mjBIAS_NONE=0),
    mjtJoint=SimpleNamespace(mjJNT_HINGE=3, mjJNT_FREE=0),
    mjtDisableBit=SimpleNamespace(mjDSBL_ACTUATION=8),
)
UPRIGHT, EDGE = np.eye(3), np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
"""Turns of a geom; EDGE stands a box on an edge along y."""


@pytest.mark.parametrize(
    ("kind", "size", "turn", "point", "radius"),
    [
        (SPHERE, (0.02, 0.0, 0.0), UPRIGHT, (0.0, 0.0, 0.0), 0.02),
        (CAPSULE, (0.02, 0.1, 0.0), UPRIGHT, (0.0, 0.0, -0.1), 0.02),
        (CYLINDER, (0.02, 0.1, 0.0), UPRIGHT, (0.0, 0.0, -0.1), None),
        (ELLIPSOID, (0.02, 0.04, 0.06), UPRIGHT, (0.0, 0.0, -0.06), None),
        (BOX, (0.02, 0.04, 0.06), UPRIGHT, (0.0, 0.0, -0.06), None),
        (BOX, (0.02, 0.04, 0.06), EDGE, (0.8 * 0.02 - 0.6 * 0.06, 0.0, -0.6 * 0.02 - 0.8 * 0.06), None),
        (MESH, (0.0, 0.0, 0.0), UPRIGHT, (0.01, 0.02, -0.03), None),
    ],
)
def test_a_foot_touches_level_ground_at_its_lowest_points(kind, size, turn, point, radius):
    vertices = np.array([[9.0, 9.0, -9.0], [0.01, 0.02, -0.03], [0.0, 0.0, 0.5], [9.0, 9.0, -9.0]])
    model = SimpleNamespace(geom_type=[kind], geom_size=np.array([size]), geom_bodyid=[4], geom_dataid=[0])
    model.mesh_vertadr, model.mesh_vertnum, model.mesh_vert = [1], [2], vertices
    data = SimpleNamespace(geom_xpos=np.array([[1.0, 2.0, 3.0]]), geom_xmat=turn.reshape(1, 9))
    body, found, found_radius = _touch(MUJOCO, model, data, 0)
    assert_allclose(found - [1.0, 2.0, 3.0], point, atol=1e-12)
    assert (body, radius in (None, found_radius)) == (4, True)


def test_sizes_in_other_units_than_metres_and_kilograms_are_refused_by_name():
    def require(length=0.4, mass=12.0, inertia=0.1):
        model = SimpleNamespace(body_subtreemass=[0.0, mass], body_mass=np.array([0.0, 0.8 * mass]))
        model.body_inertia, model.body = np.full((2, 3), inertia), lambda k: SimpleNamespace(name="trunk")
        require_sizes("own.xml", model, SimpleNamespace(base=1), length)

    require()
    wrong = {"length of a stretched leg": {"length": 400.0}, "the mass": {"mass": 12e3}, "of trunk": {"inertia": 1e5}}
    for what, values in wrong.items():
        with pytest.raises(BadInput, match=what):
            require(**values)


def make_motors(control=(-1.0, 1.0), gain=20.0, gear=2.0):
    """A model of one hinge, a motor whose control has a range, and a servo whose control is an angle."""
    hinge = SimpleNamespace(name="knee")
    return SimpleNamespace(
        joint=lambda k: hinge, njnt=1, jnt_type=[3],
        jnt_actfrclimited=[True], jnt_actfrcrange=np.array([[-90.0, 90.0]]),
        actuator_trntype=np.zeros(2), actuator_trnid=np.zeros((2, 1)), actuator_gear=np.array([[gear], [-3.0]]),
        actuator_forcelimited=[False, True], actuator_forcerange=np.array([[0.0, 0.0], [-25.0, 28.0]]),
        actuator_ctrllimited=[True, True], actuator_ctrlrange=np.array([control, (-0.1, 0.1)]),
        actuator_biastype=[0, 1], actuator_gainprm=np.array([[gain], [50.0]]),
    )  # fmt: skip


def test_a_joint_gives_the_least_that_its_drives_and_itself_allow():
    joints = np.array([[0]])
    assert torque_limits(MUJOCO, make_motors(), joints, True).tolist() == [40.0]
    assert torque_limits(MUJOCO, make_motors(gain=-100.0), joints, True).tolist() == [75.0]
    with pytest.raises(BadInput, match=r"knee.*without torque"):
        torque_limits(MUJOCO, make_motors(gain=0.0), joints, True)
    assert find_joint(MUJOCO, make_motors(), "knee") == 0
    with pytest.raises(BadInput, match=r"ankle.*no joint of the model, which has knee"):
        find_joint(MUJOCO, make_motors(), "ankle")


def test_a_model_runs_with_the_options_of_this_project():
    default = SimpleNamespace(gravity=np.zeros(3), timestep=0.002, iterations=100, wind=np.zeros(3))
    own = SimpleNamespace(gravity=np.ones(3), timestep=0.01, iterations=3, wind=np.ones(3), disableflags=1)
    model = SimpleNamespace(opt=own, jnt_type=np.array([0]), jnt_dofadr=[1], jnt_stiffness=np.ones(1))
    model.dof_damping, model.dof_frictionloss, model.dof_armature = np.ones((3, 8))
    set_run_options(SimpleNamespace(**vars(MUJOCO), MjOption=lambda: default), model)
    assert (own.iterations, own.disableflags, own.gravity.tolist()) == (100, 9, [0.0, 0.0, -9.81])
    assert not own.wind.any()
    assert model.dof_damping.tolist() == model.dof_armature.tolist() == [1.0, *[0.0] * 6, 1.0]


def test_files_of_a_model_are_found_in_its_packages_and_are_not_huge(tmp_path):
    path, mesh = tmp_path / "robot.urdf", tmp_path / "meshes" / "calf.stl"
    mesh.parent.mkdir()
    mesh.touch()
    for name, found in {"package://robot/meshes/calf.stl": True, "meshes/calf.stl": True, "calf.stl": False}.items():
        element = ElementTree.Element("mesh", filename=name)
        assert _find_mesh(path, element, [tmp_path]) is found
        assert element.get("filename") == (str(mesh) if found else name)
    for size in (MOST_MEGABYTES * 1e6, MOST_MEGABYTES * 1e6 + 1):
        os.truncate(mesh, int(size))
        if size > MOST_MEGABYTES * 1e6:
            with pytest.raises(BadInput, match=r"machine\.path.*calf.stl"):
                _require_size(path, mesh)
        else:
            _require_size(path, mesh)


@pytest.mark.parametrize(
    ("mass", "ixx", "expected"), [("2", "1", "1"), ("2", "-1", str(2 * POINT_INERTIA)), ("0", "0", None)]
)
def test_an_inertia_that_no_body_has_becomes_that_of_a_point(mass, ixx, expected):
    inertia = f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    link = ElementTree.fromstring(f'<link><inertial><mass value="{mass}"/>{inertia}</inertial></link>')
    _make_possible(link, link[0])
    left = link.find("inertial/inertia")
    assert (None if left is None else left.get("ixx")) == expected
