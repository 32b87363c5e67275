"""A robot drawn with the geoms of its model: the shape of each body once, and its pose at every step."""

from typing import Any

import numpy as np
import rerun as rr

from cmacexp.config.fields import read_fields
from cmacexp.config.machine import RobotMachine
from cmacexp.data.run import Run
from cmacexp.errors import require
from cmacexp.models.robot import Robot, load_mujoco, set_posture
from cmacexp.recording.entities import FINENESS, Entities, round_angles, round_points
from cmacexp.recording.run_view import RunView, read_robot_of_run
from cmacexp.recording.scene import MESHES
from cmacexp.typing import Array, Counts, Mask

DARKEST = 0.3
"""Brightness of black: many robots are nearly black, and only their outline would be visible."""
UNSET = (0.5, 0.5, 0.5, 1.0)
"""Colour that marks a geom without a colour of its own: its material has the colour."""


def read_shown_model(run: Run) -> Robot:
    """Read the model of the robot of a run as :func:`read_robot_of_run`; also raises BadInput for other machines."""
    plain = run.config["machine"]
    require(
        plain["kind"] == "robot" and run.manifest["robot"],
        "--meshes",
        run.folder,
        "is not a run of a robot; only robots have meshes; leave out --meshes",
    )
    return read_robot_of_run(run, read_fields(RobotMachine, plain, "machine"))


def _find_colours(model: Any) -> Array:
    """Find the colours (geoms, 4) of all geoms: red, green, blue and opacity from 0 to 1."""
    of_material = np.vstack([model.mat_rgba, UNSET])[
        model.geom_matid
    ]  # index -1, of geoms without material, is UNSET
    colours = np.where((model.geom_rgba == UNSET).all(axis=1, keepdims=True), of_material, model.geom_rgba)
    return np.column_stack([DARKEST + (1.0 - DARKEST) * colours[:, :3], colours[:, 3]])


def _list_geoms(robot: Robot, positions: Array, opaque: Mask) -> dict[int, list[int]]:
    """List the geoms to draw by body: the visual ones, or all geoms of a body that has no visual ones.

    Geoms at the feet are left out, since the recording shows feet as balls. ``positions`` (geoms, 3), m, and
    ``opaque`` (geoms,) describe all geoms.
    """
    model = robot.model
    from_foot = np.linalg.norm(positions[:, None] - robot.feet_at_zero, axis=2).min(axis=1)
    body = model.geom_bodyid
    candidates = opaque & (from_foot > FINENESS) & (model.body_rootid[body] == robot.legs.base)
    is_visible = model.geom_group < 3  # the default of MuJoCo's own viewer
    visual = candidates & is_visible & ((model.geom_contype | model.geom_conaffinity) == 0)
    drawn = visual | (candidates & ~np.isin(body, body[visual]))
    return {number: np.flatnonzero(drawn & (body == number)).tolist() for number in np.unique(body[drawn]).tolist()}


def _make_mesh(vertices: Array, faces: Counts, colour: Array) -> rr.Mesh3D:
    """Make a mesh of triangles with vertex normals; merge coinciding vertices, omit triangles without area."""
    drawn, index = np.unique(round_points(vertices), axis=0, return_inverse=True)
    faces = index.ravel()[faces]
    a, b, c = np.moveaxis(drawn[faces], 1, 0)
    across = np.cross(b - a, c - a)
    normals = np.zeros_like(drawn)
    np.add.at(normals, faces, across[:, None])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), FINENESS**3)
    return rr.Mesh3D(
        vertex_positions=drawn,
        triangle_indices=faces[across.any(axis=1)],
        vertex_normals=normals,
        albedo_factor=colour,
    )


def _make_shape(model: Any, geom: int, colour: Array) -> rr.AsComponents:
    """Make the shape of a geom in the frame of the geom."""
    size = model.geom_size[geom]
    kind = load_mujoco().mjtGeom(model.geom_type[geom]).name
    if kind == "mjGEOM_MESH":
        mesh = model.mesh(model.geom_dataid[geom])
        vertices = model.mesh_vert[int(mesh.vertadr[0]) :][: int(mesh.vertnum[0])]
        faces = model.mesh_face[int(mesh.faceadr[0]) :][: int(mesh.facenum[0])]
        return _make_mesh(vertices, faces, colour)
    solid: dict[str, Any] = {"colors": [colour], "fill_mode": "solid"}
    along = {"radii": size[:1], "lengths": 2.0 * size[1:2], **solid}
    if kind == "mjGEOM_CYLINDER":
        return rr.Cylinders3D(**along)
    if kind == "mjGEOM_CAPSULE":  # a capsule of the viewer begins at the origin
        return rr.Capsules3D(translations=[[0.0, 0.0, -size[1]]], **along)
    if kind == "mjGEOM_BOX":
        return rr.Boxes3D(half_sizes=[size], **solid)
    return rr.Ellipsoids3D(
        half_sizes=[np.where(size > 0.0, size, size[0])], **solid
    )  # a sphere has only the first size


def log_meshes(entities: Entities, view: RunView, run: Run) -> None:
    """Log the shapes of each body of a robot, below an entity with the name and the pose of the body.

    Raises BadInput if the machine of the run is not a robot, and BadRun.
    """
    robot = read_shown_model(run)
    model = robot.model
    data = robot.at(np.zeros(3))
    colours = _find_colours(model)
    geoms_by_body = _list_geoms(robot, data.geom_xpos, colours[:, 3] > 0.0)
    q = view.trace.stack_joints("q{}")
    poses = np.empty((len(q), model.nbody, 7))
    for pose, angles in zip(poses, q, strict=True):
        set_posture(model, data, robot.legs.joint, angles)
        pose[:] = np.hstack([data.xpos, np.roll(data.xquat, -1, axis=1)])
    poses[..., :3] += view.joints[0, 0, 0] - robot.hinges[0, 0, :3]  # from the frame of the trunk to that of the body
    for body, geoms in geoms_by_body.items():
        path = f"world/{MESHES}/{rr.escape_entity_path_part(model.body(body).name or f'body {body}')}"
        for geom in geoms:
            entities.log(
                f"{path}/{geom}",
                rr.Transform3D(
                    translation=model.geom_pos[geom],
                    quaternion=np.roll(model.geom_quat[geom], -1),  # w is last in the viewer
                ),
            )
            entities.log(f"{path}/{geom}", _make_shape(model, geom, colours[geom]))
        pose = np.hstack([round_points(poses[:, body, :3]), round_angles(poses[:, body, 3:])])
        rows = np.flatnonzero(
            np.diff(pose, axis=0, prepend=np.nan).any(axis=1)
        )  # steps in which it moves, and the first, by NaN
        entities.send_columns(
            path,
            rr.Transform3D.columns(translation=pose[rows, :3], quaternion=pose[rows, 3:]),
            rows=rows,
        )
