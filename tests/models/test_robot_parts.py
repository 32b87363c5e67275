"""What is read of a robot's model, on stand-ins of MuJoCo's model: these laws need no MuJoCo."""

from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmacexp.models.robot_legs import _touch
from cmacexp.models.robot_spec import (
    POINT_INERTIA,
    _find_mesh,
    _make_possible,
    set_run_options,
)

SPHERE, CAPSULE, CYLINDER, ELLIPSOID, BOX, MESH = range(6)
KINDS = SimpleNamespace(
    mjGEOM_SPHERE=SPHERE, mjGEOM_CAPSULE=CAPSULE, mjGEOM_CYLINDER=CYLINDER, mjGEOM_BOX=BOX, mjGEOM_MESH=MESH
)
MUJOCO = SimpleNamespace(
    mjtGeom=KINDS,
    mjtJoint=SimpleNamespace(mjJNT_FREE=0),
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


def test_a_model_runs_with_the_options_of_this_project():
    default = SimpleNamespace(gravity=np.zeros(3), timestep=0.002, iterations=100, wind=np.zeros(3))
    own = SimpleNamespace(gravity=np.ones(3), timestep=0.01, iterations=3, wind=np.ones(3), disableflags=1)
    model = SimpleNamespace(opt=own, jnt_type=np.array([0]), jnt_dofadr=[1], jnt_stiffness=np.ones(1))
    model.dof_damping, model.dof_frictionloss, model.dof_armature = np.ones((3, 8))
    set_run_options(SimpleNamespace(**vars(MUJOCO), MjOption=lambda: default), model)
    assert (own.iterations, own.disableflags, own.gravity.tolist()) == (100, 9, [0.0, 0.0, -9.81])
    assert not own.wind.any()
    assert model.dof_damping.tolist() == model.dof_armature.tolist() == [1.0, *[0.0] * 6, 1.0]


def test_files_of_a_model_are_found_in_its_packages(tmp_path):
    mesh = tmp_path / "meshes" / "calf.stl"
    mesh.parent.mkdir()
    mesh.touch()
    for name, found in {"package://robot/meshes/calf.stl": True, "meshes/calf.stl": True, "calf.stl": False}.items():
        element = ElementTree.Element("mesh", filename=name)
        assert _find_mesh(element, [tmp_path]) is found
        assert element.get("filename") == (str(mesh) if found else name)


@pytest.mark.parametrize(
    ("mass", "ixx", "expected"), [("2", "1", "1"), ("2", "-1", str(2 * POINT_INERTIA)), ("0", "0", None)]
)
def test_an_inertia_that_no_body_has_becomes_that_of_a_point(mass, ixx, expected):
    inertia = f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    link = ElementTree.fromstring(f'<link><inertial><mass value="{mass}"/>{inertia}</inertial></link>')
    _make_possible(link, link[0])
    left = link.find("inertial/inertia")
    assert (None if left is None else left.get("ixx")) == expected
