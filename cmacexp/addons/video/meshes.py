"""A robot as its own model shows it: what is seen of each body once, and where the body is at every step."""

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
"""Brightness of black: of many robots all parts are nearly black, and nothing but their outline would be seen."""
UNSET = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom that has none of its own: that of its material counts."""


def read_shown_model(run: Run) -> Robot:
    """The model with which a robot ran, see :func:`read_robot_of_run`; raises BadInput, too, if it was no robot."""
    plain = run.config["machine"]
    require(
        plain["kind"] == "robot" and run.manifest["robot"],
        "--meshes",
        run.folder,
        "is no run of a robot, which alone has meshes; leave out --meshes",
    )
    return read_robot_of_run(run, read_fields(RobotMachine, plain, "machine"))


def _find_colours(model: Any) -> Array:
    """Red, green, blue and opacity (geoms, 4) of all geoms, from 0 to 1."""
    of_material = np.vstack([model.mat_rgba, UNSET])[model.geom_matid]  # that of geoms without any, -1, is the last
    colours = np.where((model.geom_rgba == UNSET).all(axis=1, keepdims=True), of_material, model.geom_rgba)
    return np.column_stack([DARKEST + (1.0 - DARKEST) * colours[:, :3], colours[:, 3]])


def _list_shown(robot: Robot, places: Array, opaque: Mask) -> dict[int, list[int]]:
    """Geoms by bodies: those made to be seen, or all of a body without such; a ball is drawn where a foot is."""
    model, from_foot = robot.model, np.linalg.norm(places[:, None] - robot.feet_at_zero, axis=2).min(axis=1)
    body = model.geom_bodyid
    drawn = opaque & (from_foot > FINENESS) & (model.body_rootid[body] == robot.legs.base)
    shown = model.geom_group < 3  # the others are those that MuJoCo's own viewer does not show
    seen = drawn & shown & ((model.geom_contype | model.geom_conaffinity) == 0)
    best = seen | (drawn & ~np.isin(body, body[seen]))
    return {part: np.flatnonzero(best & (body == part)).tolist() for part in np.unique(body[best]).tolist()}


def _make_mesh(vertices: Array, faces: Counts, colour: Array) -> rr.Mesh3D:
    """A mesh of triangles; vertices that are drawn at the same point are one, and what has no area is left out."""
    drawn, index = np.unique(round_points(vertices), axis=0, return_inverse=True)
    faces = index.ravel()[faces]
    a, b, c = np.moveaxis(drawn[faces], 1, 0)
    across = np.cross(b - a, c - a)
    kept, normals = across.any(axis=1), np.zeros_like(drawn)
    np.add.at(normals, faces, across[:, None])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), FINENESS**3)
    return rr.Mesh3D(
        vertex_positions=drawn, triangle_indices=faces[kept], vertex_normals=normals, albedo_factor=colour
    )


def _make_shape(model: Any, geom: int, colour: Array) -> rr.AsComponents:
    """A geom in its own frame."""
    size, kind = model.geom_size[geom], load_mujoco().mjtGeom(model.geom_type[geom]).name
    if kind == "mjGEOM_MESH":
        mesh = model.mesh(model.geom_dataid[geom])
        points, triangles = int(mesh.vertadr[0]), int(mesh.faceadr[0])
        faces = model.mesh_face[triangles : triangles + int(mesh.facenum[0])]
        return _make_mesh(model.mesh_vert[points : points + int(mesh.vertnum[0])], faces, colour)
    solid: dict[str, Any] = {"colors": [colour], "fill_mode": "solid"}
    along = {"radii": size[:1], "lengths": 2.0 * size[1:2], **solid}
    if kind == "mjGEOM_CYLINDER":
        return rr.Cylinders3D(**along)
    if kind == "mjGEOM_CAPSULE":  # the viewer's begins at the origin
        return rr.Capsules3D(translations=[[0.0, 0.0, -size[1]]], **along)
    if kind == "mjGEOM_BOX":
        return rr.Boxes3D(half_sizes=[size], **solid)
    return rr.Ellipsoids3D(half_sizes=[np.where(size > 0.0, size, size[0])], **solid)  # of a sphere the first alone


def log_meshes(entities: Entities, view: RunView, run: Run) -> None:
    """Log what is seen of each body of a robot, below an entity of its name that moves in the frame of the trunk.

    Raises BadInput if the run is of no robot, and BadRun.
    """
    robot = read_shown_model(run)
    model, data, colours = robot.model, robot.at(np.zeros(3)), _find_colours(robot.model)
    shown = _list_shown(robot, data.geom_xpos, colours[:, 3] > 0.0)
    q = view.trace.stack_joints("q{}")
    poses = np.empty((len(q), model.nbody, 7))
    for pose, angles in zip(poses, q, strict=True):
        set_posture(model, data, robot.legs.joint, angles)
        pose[:, :3], pose[:, 3:] = data.xpos, np.roll(data.xquat, -1, axis=1)
    poses[..., :3] += view.joints[0, 0, 0] - robot.hinges[0, 0, :3]  # from the trunk's frame to the body's
    for body, geoms in shown.items():
        path = f"world/{MESHES}/{rr.escape_entity_path_part(model.body(body).name or f'body {body}')}"
        for geom in geoms:
            turn = np.roll(model.geom_quat[geom], -1)  # w is last in the viewer
            entities.log(f"{path}/{geom}", rr.Transform3D(translation=model.geom_pos[geom], quaternion=turn))
            entities.log(f"{path}/{geom}", _make_shape(model, geom, colours[geom]))
        pose = np.hstack([round_points(poses[:, body, :3]), round_angles(poses[:, body, 3:])])
        rows = np.flatnonzero(np.diff(pose, axis=0, prepend=np.nan).any(axis=1))  # where it moves: NaN counts
        moving = rr.Transform3D.columns(translation=pose[rows, :3], quaternion=pose[rows, 3:])
        entities.send_columns(path, moving, rows=rows)
