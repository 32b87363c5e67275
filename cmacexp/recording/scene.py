"""The machine: its body, links and foot paths, and the eyes that see it from the sides."""

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from cmacexp.recording import palette
from cmacexp.recording.entities import Entities, points
from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array

FINE_ANGLE = 2e-3
"""Drawn angles of links are multiples of this, rad: their ends move less than a pixel, and a recording is smaller."""
EYES = {
    "front": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)),
    "right side": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "top": ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
}
"""Of each view of the sides, what is right, down and ahead for its eye, in the frame that moves with the machine."""
FOOT = 0.018
"""Radius of the ball that a planar leg, whose foot is a point, has as a foot, m."""
AWAY = 10.0
"""Distance of these eyes, m: so far away that parallel lines stay parallel; the viewer has no parallel projection."""
HIGHEST_NUMBER, LOWEST_NUMBER = -0.06, -0.16
"""Where the numbers of the feet are, above the ground, m."""
MESHES = "travel/body/robot"
"""Where in the world the bodies of a robot's model are; views of the sides show the figure below instead."""
FIGURE = ("travel/body/plate", "travel/body/nose", "travel/body/links")
"""The figure of box and links, which would stick out of them."""
MM = 1e3
"""Pixels of these eyes per metre, so that what they see is measured in mm."""


def make_balls(centres: Array, radius: float, colour: tuple[int, ...]) -> rr.Ellipsoids3D:
    """Balls of one size at points (n, 3)."""
    return rr.Ellipsoids3D(
        centers=centres, half_sizes=[[radius] * 3] * len(centres), colors=[colour] * len(centres), fill_mode="solid"
    )


def eye_path(name: str) -> str:
    """The entity of an eye."""
    return f"world/travel/eyes/{name.replace(' ', '_')}"


def _log_eyes(entities: Entities) -> None:
    for name, axes in EYES.items():
        ahead = np.array(axes[2])
        entities.log(eye_path(name), rr.Transform3D(translation=-AWAY * ahead, mat3x3=np.array(axes).T))
        entities.log(
            eye_path(name),
            rr.Pinhole(focal_length=AWAY * MM, principal_point=(0.0, 0.0), resolution=(1000.0, 1000.0)),
        )


def find_trunk(view: RunView) -> tuple[Array, Array]:
    """Middle and half the size of the box that joins the hips, (3,) each, in the body frame, m."""
    hips = np.array([leg.joints()[0][0] for leg in view.legs]) + 0.0  # no negative zero
    half = (hips.max(axis=0) - hips.min(axis=0)) / 2.0
    half[2] = half[1] if view.is_robot else 0.008  # trunks of robots are about as high as they are wide
    return (hips.max(axis=0) + hips.min(axis=0)) / 2.0, half


def _log_body(entities: Entities, view: RunView) -> None:
    """The frames ``world/travel``, which moves on with the machine, and ``world/travel/body``, which tilts too."""
    way = view.way()
    ground = way[:, 2] - view.body["height"] - view.foot_radius
    entities.send_columns(
        "world/travel", rr.Transform3D.columns(translation=np.stack([way[:, 0], way[:, 1], ground], axis=1))
    )
    up = np.stack([np.zeros_like(ground), np.zeros_like(ground), view.body["height"] + view.foot_radius], axis=1)
    entities.send_columns(
        "world/travel/body", rr.Transform3D.columns(translation=up, quaternion=view.turn().astype(np.float32))
    )
    if not view.walks:
        return
    middle, half = find_trunk(view)
    plate = rr.Boxes3D(centers=[middle], half_sizes=[half], colors=[palette.BODY_COLOR], fill_mode="solid")
    entities.log("world/travel/body/plate", plate)
    front = middle[0] + half[0]
    nose = [[front, -0.03, 0.0], [front + 0.06, 0.0, 0.0], [front, 0.03, 0.0]]
    entities.log("world/travel/body/nose", rr.LineStrips3D([nose], radii=0.006, colors=palette.THIGH))


def round_angles(values: Array) -> NDArray[np.float32]:
    """Angles (...), rad, or parts of unit vectors to :data:`FINE_ANGLE`."""
    return (np.round(values / FINE_ANGLE) * FINE_ANGLE).astype(np.float32)


def _make_turns(angles: Array, axes: Array) -> pa.Array:
    """Turns by angles (n,) about axes (n, 3) in the frame of the body.

    The viewer takes them as axis and angle, where the axis is constant a third of a quaternion.
    """
    kind = rr.components.RotationAxisAngleBatch(rr.RotationAxisAngle(axis=(0, 1, 0), radians=0)).as_arrow_array().type
    columns = [
        pa.FixedSizeListArray.from_arrays(pa.array(round_angles(axes).ravel()), type=kind.field("axis").type),
        pa.array(round_angles(angles)),
    ]
    return pa.StructArray.from_arrays(columns, fields=list(kind))


def turn_from_up(along: Array) -> tuple[Array, Array]:
    """Angles (n,), rad, and axes (n, 3) of length 1 of the turns straight from +z to directions (n, 3)."""
    x, y, z = along.T
    beside = np.hypot(x, y)
    turned = beside > 0.0  # else any axis will do
    level = np.where(turned, beside, 1.0)
    return np.arctan2(beside, z), np.stack([-y / level, np.where(turned, x, 1.0) / level, np.zeros_like(z)], axis=1)


def _log_links(entities: Entities, view: RunView) -> None:
    """Links between the joints of each leg: capsules along +z, turned to point to the next joint."""
    if not view.legs[0].has_joints:
        return
    joints = np.stack([np.stack(leg.joints(), axis=1) for leg in view.legs], axis=1)  # (steps, legs, joints, 3)
    along = np.diff(joints, axis=2)
    lengths = np.linalg.norm(along[0], axis=2)
    links = rr.Capsules3D.from_fields(
        lengths=lengths.ravel(),
        radii=[0.8 * (view.foot_radius or FOOT)] * lengths.size,  # thinner than the foot, which is to be seen
        colors=([palette.THIGH] * (lengths.shape[1] - 1) + [palette.SHANK]) * len(view.legs),
        fill_mode="solid",
    )
    entities.log("world/travel/body/links", links)
    turns = _make_turns(*turn_from_up(along.reshape(-1, 3)))
    starts = points(joints[:, :, :-1].reshape(len(joints), -1, 3))
    moving = rr.Capsules3D.columns(translations=starts, rotation_axis_angles=turns)
    entities.send_columns("world/travel/body/links", moving)


def _collect_paths(view: RunView, cycle: int, of: str) -> list[NDArray[np.float32]]:
    """The path of each foot in a cycle, in the frame of the body, of so many points that it is smooth."""
    rows = np.flatnonzero(view.cycle == cycle)
    rows = rows[:: max(1, len(rows) // 150)]
    return [leg.foot(of, rows).astype(np.float32) for leg in view.legs]


def _log_paths(entities: Entities, view: RunView) -> None:
    """The actual paths in the first and in the last whole cycle, and in each cycle the desired ones of that cycle.

    They are in the frame of the body. The plan of a robot follows its load and its course from cycle to cycle.
    """
    path, (first, last) = "world/travel/body/path", view.whole_cycles()
    shown = {first: ("first_cycle", palette.FIRST_CYCLE)} | {last: ("last_cycle", palette.LAST_CYCLE)}
    for cycle, (name, colour) in shown.items():
        strips = _collect_paths(view, cycle, "")
        entities.log(f"{path}/{name}", rr.LineStrips3D(strips, radii=[0.003], colors=[colour]))
    cycles, begins = np.unique(view.cycle, return_index=True)
    desired = [strip for cycle in cycles for strip in _collect_paths(view, cycle, "_desired")]
    entities.log(f"{path}/desired", rr.LineStrips3D.from_fields(radii=[0.003], colors=[palette.DESIRED]))
    entities.send_columns(f"{path}/desired", rr.LineStrips3D.columns(strips=desired), rows=begins)


def _log_numbers(entities: Entities, view: RunView) -> None:
    """The number of each foot below the middle of its desired path, at two heights so that none hides another."""
    places = []
    for leg in view.legs:
        low = HIGHEST_NUMBER if leg.number in (1, 4) else LOWEST_NUMBER
        middle = (leg["x_desired"].min() + leg["x_desired"].max()) / 2.0
        places.append([leg.hip[0] + middle, leg.foot("_desired")[:, 1].mean(), low])
    numbers = rr.Points3D(
        places, radii=0.001, colors=(0, 0, 0), labels=[str(leg.number) for leg in view.legs], show_labels=True
    )
    entities.log("world/travel/foot_numbers", numbers)


def log_machine(entities: Entities, view: RunView) -> None:
    """Everything that is part of the machine, or moves with it."""
    entities.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _log_eyes(entities)
    _log_body(entities, view)
    _log_links(entities, view)
    _log_paths(entities, view)
    if view.walks:
        _log_numbers(entities, view)
