"""A robot as its own model shows it: what is seen of each body once, and where the body is at every step."""

from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from cmacexp.config.fields import check_fields, make_config
from cmacexp.config.machine import RobotMachine, read_model
from cmacexp.data.manifest import Manifest
from cmacexp.errors import BadInput
from cmacexp.models.robot import Robot, load_mujoco, place
from cmacexp.models.robot_file import find_model
from cmacexp.planning.robot import find_stance
from cmacexp.recording.entities import Entities, round_points
from cmacexp.recording.run_view import RunView
from cmacexp.recording.scene import MESHES, round_angles
from cmacexp.typing import Array, Counts

HIDDEN = 3
"""First of the groups of geoms that MuJoCo's own viewer does not show."""
DARKEST = 0.3
"""Brightness of black: of many robots all parts are nearly black, and nothing but their outline would be seen."""
TINY = 1e-30
"""Keeps the length of a normal from being zero; sums of areas of triangles are far larger, m^2."""
UNSET = (0.5, 0.5, 0.5, 1.0)
"""Colour of a geom that has none of its own: that of its material counts."""


def read_shown_model(folder: Path, manifest: Manifest) -> Robot:
    """The model with which a robot ran, as its config names it; no file of the run's folder is read for it.

    Raises:
        BadInput: it is no run of a robot, MuJoCo or the model is missing, or the model is not that of the run.
    """
    plain = manifest["config"]["machine"]
    if plain["kind"] != "robot" or "robot" not in manifest:
        raise BadInput("--meshes", folder, "is no run of a robot, which alone has meshes; leave --meshes out")
    machine: RobotMachine = make_config(RobotMachine, plain, "machine")
    check_fields(machine, "machine")
    path = find_model(machine.model, machine.path)
    if path.is_relative_to(folder.resolve()):
        raise BadInput("machine.path", path, "lies in the folder of the run, whose files are not trusted")
    robot = read_model(machine)
    if manifest.get("model_hash") != robot.model_hash:
        reason = f"is not what {path} is now, or to this version of MuJoCo; run it again, or leave --meshes out"
        raise BadInput("--meshes", folder, f"its model {reason}")
    return robot


def find_poses(robot: Robot, q: Array) -> Array:
    """Poses (steps, bodies, 7) of all bodies in the frame of the trunk: place, m, and turn as a quaternion, x y z w.

    Args:
        robot: the robot.
        q: (steps, 4, 3) joint angles, rad.
    """
    data, poses = load_mujoco().MjData(robot.model), np.empty((len(q), robot.model.nbody, 7))
    for pose, angles in zip(poses, q, strict=True):
        place(robot.model, data, robot.legs, angles)
        pose[:, :3], pose[:, 3:] = data.xpos, np.roll(data.xquat, -1, axis=1)
    return poses


def _list_shown(robot: Robot, body: int) -> list[int]:
    """The geoms of a body that are made to be seen; of a body without such, those that collide.

    Those around the middle of a foot are left out: the scene has a ball there.
    """
    model, first = robot.model, int(robot.model.body_geomadr[body])
    feet = [tuple(model.geom_pos[foot]) for foot in robot.legs.foot_geom if model.geom_bodyid[foot] == body]
    geoms = [
        geom
        for geom in range(first, first + int(model.body_geomnum[body]))
        if _find_colour(model, geom)[3] > 0.0 and tuple(model.geom_pos[geom]) not in feet
    ]
    touch = model.geom_contype | model.geom_conaffinity
    return [geom for geom in geoms if not touch[geom] and model.geom_group[geom] < HIDDEN] or geoms


def _find_colour(model: Any, geom: int) -> Array:
    """Red, green, blue and opacity of a geom, from 0 to 1."""
    colour, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    if material >= 0 and np.array_equal(colour, UNSET):
        colour = model.mat_rgba[material]
    return np.append(DARKEST + (1.0 - DARKEST) * colour[:3], colour[3])


def _make_mesh(vertices: Array, faces: Counts, colour: Array) -> rr.Mesh3D:
    """A mesh of triangles; vertices that are drawn at the same point are one, and what has no area is left out."""
    drawn, index = np.unique(round_points(vertices), axis=0, return_inverse=True)
    corners = index.ravel()[faces]
    a, b, c = np.moveaxis(drawn[corners], 1, 0)
    across = np.cross(b - a, c - a)
    kept, normals = across.any(axis=1), np.zeros_like(drawn)
    np.add.at(normals, corners[kept], across[kept, None])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True) + TINY
    return rr.Mesh3D(
        vertex_positions=drawn, triangle_indices=corners[kept], vertex_normals=normals, albedo_factor=colour
    )


def _make_shape(model: Any, geom: int) -> rr.AsComponents | None:
    """A geom in its own frame; None for a kind that no robot consists of, such as a plane."""
    size, colour = model.geom_size[geom], _find_colour(model, geom)
    solid: dict[str, Any] = {"colors": [colour], "fill_mode": "solid"}
    match load_mujoco().mjtGeom(model.geom_type[geom]).name:
        case "mjGEOM_MESH":
            mesh = model.mesh(model.geom_dataid[geom])
            vertices, faces = (
                mesh.vertadr[0] + np.arange(mesh.vertnum[0]),
                mesh.faceadr[0] + np.arange(mesh.facenum[0]),
            )
            return _make_mesh(model.mesh_vert[vertices], model.mesh_face[faces], colour)
        case "mjGEOM_BOX":
            return rr.Boxes3D(half_sizes=[size], **solid)
        case "mjGEOM_SPHERE":
            return rr.Ellipsoids3D(radii=[size[0]], **solid)
        case "mjGEOM_ELLIPSOID":
            return rr.Ellipsoids3D(half_sizes=[size], **solid)
        case "mjGEOM_CYLINDER":
            return rr.Cylinders3D(radii=[size[0]], lengths=[2.0 * size[1]], **solid)
        case "mjGEOM_CAPSULE":  # the viewer's begins at the origin
            start = [[0.0, 0.0, -size[1]]]
            return rr.Capsules3D(radii=[size[0]], lengths=[2.0 * size[1]], translations=start, **solid)
        case _:
            return None


def _log_geoms(entities: Entities, path: str, robot: Robot, body: int) -> bool:
    """Log what is seen of a body, below its entity; returns whether there is anything."""
    model = robot.model
    shapes = {geom: shape for geom in _list_shown(robot, body) if (shape := _make_shape(model, geom)) is not None}
    for geom, shape in shapes.items():
        turn = np.roll(model.geom_quat[geom], -1)
        entities.log(f"{path}/{geom}", rr.Transform3D(translation=model.geom_pos[geom], quaternion=turn))
        entities.log(f"{path}/{geom}", shape)
    return bool(shapes)


def log_meshes(entities: Entities, view: RunView, robot: Robot) -> None:
    """What is seen of each body, below an entity of the body's name that moves in the frame of the robot's body."""
    q = np.stack([[leg[f"q{n}"] for n in (1, 2, 3)] for leg in view.legs]).transpose(2, 0, 1)
    poses = find_poses(robot, q)
    poses[..., :3] -= find_stance(robot, view.config["machine"]["hip_height"]).origin
    for body in np.flatnonzero(robot.model.body_rootid == robot.legs.base).tolist():
        path = f"world/{MESHES}/{rr.escape_entity_path_part(robot.model.body(body).name or f'body {body}')}"
        if not _log_geoms(entities, path, robot, body):
            continue
        at, turn = round_points(poses[:, body, :3]), round_angles(poses[:, body, 3:])
        moved = np.diff(np.hstack([at, turn]), axis=0, prepend=np.nan).any(axis=1)  # a NaN is true
        rows = np.flatnonzero(moved)
        entities.send_columns(path, rr.Transform3D.columns(translation=at[rows], quaternion=turn[rows]), rows=rows)
