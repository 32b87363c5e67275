"""The scene of a recording: the machine, the cameras of the side views, the feet and the ground."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from cmacexp.recording import palette
from cmacexp.recording.entities import Entities, flatten_points, round_angles, round_points
from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array, Mask

EYES = {
    "front": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)),
    "right side": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "top": ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
}
"""Right, down and forward axis of the camera of each side view, in the frame that moves with the machine."""
FOOT = 0.018
"""Radius of the ball that is drawn as the foot of a planar leg, whose foot is a point, m."""
AWAY = 10.0
"""Distance of these cameras, m: large, since the viewer has no parallel projection."""
HIGHEST_NUMBER = -0.06
LOWEST_NUMBER = -0.16
"""Heights of the numbers of the feet above the ground, m."""
MESHES = "travel/body/robot"
"""Entity, below ``world``, of the meshes of a robot; side views show :data:`FIGURE` instead."""
FIGURE = ("travel/body/plate", "travel/body/links")
"""Entities of box and links, which would stick out of the meshes."""
MM = 1e3
"""Pixels per metre of these cameras, so that distances in the side views are in mm."""
PATH_POINTS = 150
"""Fewest points of a foot path in a cycle with enough steps; the path has less than twice as many."""
FORCE_LENGTH = 0.15
"""Length of an arrow for the largest desired force, m."""
ABOVE_GROUND = 0.002
"""Height at which marks on the ground are drawn, m, so that they are visible."""
DENT = 0.06
"""Half the length of the dent below a foot, m."""
ASIDE = 0.025
"""Distance between the arrows of desired and actual force, m."""
GROUND_LENGTH = 0.35
"""Half the length of the ground that is drawn below a single leg, m."""


def name_eye(name: str) -> str:
    """Return the entity of one of the cameras of :data:`EYES`."""
    return f"world/travel/eyes/{name.replace(' ', '_')}"


def _log_eyes(entities: Entities) -> None:
    pinhole = rr.Pinhole(focal_length=AWAY * MM, principal_point=(0.0, 0.0), resolution=(1000.0, 1000.0))
    for name, axes in EYES.items():
        entities.log(name_eye(name), rr.Transform3D(translation=-AWAY * np.array(axes[2]), mat3x3=np.array(axes).T))
        entities.log(name_eye(name), pinhole)


def _log_body(entities: Entities, view: RunView) -> None:
    """Log the frame ``world/travel``, which moves with the machine, and ``world/travel/body``, which also tilts."""
    up = (view.body["height"] + view.foot_radius)[:, None] * [0.0, 0.0, 1.0]
    entities.send_columns("world/travel", rr.Transform3D.columns(translation=view.compute_position() - up))
    quaternions = view.compute_orientation().astype(np.float32)
    entities.send_columns("world/travel/body", rr.Transform3D.columns(translation=up, quaternion=quaternions))
    if view.walks:
        middle, half = view.trunk
        plate = rr.Boxes3D(centers=[middle], half_sizes=[half], colors=[palette.BODY_COLOR], fill_mode="solid")
        entities.log("world/travel/body/plate", plate)


def _turn_from_up(along: Array) -> Array:
    """Compute the shortest rotations from +z to directions (n, 3), as quaternions (n, 4), x y z w; NaN for -z.

    A direction of length zero is not rotated.
    """
    x, y, z = (along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)).T
    turn = np.stack([-y, x, np.zeros_like(z), 1.0 + z], axis=1)
    return turn / np.linalg.norm(turn, axis=1, keepdims=True)


def _log_links(entities: Entities, view: RunView) -> None:
    """Log the links of each leg: capsules from the lower joint, rotated from +z towards the upper joint."""
    along = -np.diff(view.joints, axis=2)  # (steps, legs, links, 3)
    lengths = np.linalg.norm(along[0], axis=2)
    links = rr.Capsules3D.from_fields(
        lengths=lengths.ravel(),
        radii=[0.8 * (view.foot_radius or FOOT)] * lengths.size,  # thinner than the foot, which stays visible
        colors=([palette.THIGH] * (lengths.shape[1] - 1) + [palette.SHANK]) * len(lengths),
        fill_mode="solid",
    )
    turns = round_angles(_turn_from_up(along.reshape(-1, 3)))
    ends = flatten_points(view.joints[:, :, 1:].reshape(len(along), -1, 3))
    entities.send_columns(
        "world/travel/body/links",
        rr.Capsules3D.columns(translations=ends, quaternions=turns),
        constant=links,
    )


def _log_paths(entities: Entities, view: RunView) -> None:
    """Log the actual foot paths of the first and the last complete cycle, and the desired paths of each cycle.

    They are in the body frame. A robot adapts its plan to its load and its course from cycle to cycle.
    """
    path = "world/travel/body/path"
    first, last = view.whole_cycles()

    def collect_strips(cycle: int, feet: Array) -> list[NDArray[np.float32]]:
        rows = np.flatnonzero(view.cycle == cycle)
        return list(feet[rows[:: max(1, len(rows) // PATH_POINTS)]].astype(np.float32).swapaxes(0, 1))

    actual, desired = view.feet(), view.feet("_desired")
    styles = {first: ("first_cycle", palette.FIRST_CYCLE)} | {last: ("last_cycle", palette.LAST_CYCLE)}
    for cycle, (name, colour) in styles.items():
        entities.log(f"{path}/{name}", rr.LineStrips3D(collect_strips(cycle, actual), radii=[0.003], colors=[colour]))
    cycles, begins = np.unique(view.cycle, return_index=True)
    moving = [strip for cycle in cycles for strip in collect_strips(cycle, desired)]
    entities.send_columns(
        f"{path}/desired",
        rr.LineStrips3D.columns(strips=moving),
        begins,
        rr.LineStrips3D.from_fields(radii=[0.003], colors=[palette.DESIRED]),
    )


def _log_numbers(entities: Entities, view: RunView) -> None:
    """Log the number of each foot below the middle of its desired path, at two heights to avoid overlaps."""
    x = view.trace["x_desired"]
    positions = view.feet("_desired").mean(axis=0)
    positions[:, 0] = view.hips[:, 0] + (x.min(axis=0) + x.max(axis=0)) / 2.0
    positions[:, 2] = [HIGHEST_NUMBER, LOWEST_NUMBER, LOWEST_NUMBER, HIGHEST_NUMBER]
    labels = [str(number) for number in range(1, len(positions) + 1)]
    numbers = rr.Points3D(positions, radii=0.001, colors=(0, 0, 0), labels=labels, show_labels=True)
    entities.log("world/travel/foot_numbers", numbers)


def log_machine(entities: Entities, view: RunView) -> None:
    """Log everything that moves with the machine."""
    entities.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _log_eyes(entities)
    _log_body(entities, view)
    if view.has_joints:
        _log_links(entities, view)
    _log_paths(entities, view)
    if view.walks:
        _log_numbers(entities, view)


def _log_dents(entities: Entities, view: RunView, feet: Array) -> None:
    """Log the surface of the ground in the plane of each leg, with the dent below its foot."""
    x, y, z = np.moveaxis(feet, 2, 0)[..., None]
    # Like the plant, evaluate the slope below the foot of a level body, which is some mm off on a steep slope.
    foot_x = view.body["cog_x"][:, None] + view.hips[:, 0] + view.trace["x"]
    depth = np.maximum(view.ground_height(foot_x)[..., None] - z, 0.0) * view.depression_scale
    along = x + np.array([-DENT, 0.0, DENT])
    deep = depth * [0.0, 1.0, 0.0]
    if not view.walks:
        end = np.full_like(x, GROUND_LENGTH)
        along = np.concatenate([-end, along, end], axis=2)
        deep = np.pad(deep, ((0, 0), (0, 0), (1, 1)))
    surface = np.stack([along, np.broadcast_to(y, along.shape), view.surface(along) - deep], axis=3)
    strips = round_points(surface.reshape(-1, *surface.shape[2:]))
    entities.send_columns(
        "world/ground",
        rr.LineStrips3D.columns(strips=strips),
        constant=rr.LineStrips3D.from_fields(radii=[0.005], colors=[palette.GROUND]),
    )


def _log_feet(entities: Entities, view: RunView, feet: Array) -> None:
    """Log the feet, coloured by planned phase, with actual and desired contact forces as arrows side by side."""
    support = view.trace.support
    legs = view.trace.legs
    changes = np.flatnonzero(np.any(np.diff(support, axis=0, prepend=~support[:1]), axis=1))
    colours = np.where(support[changes, :, None], palette.SUPPORT, palette.TRANSFER).astype(np.uint8)
    radius = (view.foot_radius or FOOT) * (1.1 if view.meshes else 1.0)  # else its mesh would hide its colour
    balls = rr.Ellipsoids3D.from_fields(half_sizes=[[radius] * 3] * legs, fill_mode="solid")
    entities.send_columns("world/feet", rr.Ellipsoids3D.columns(centers=flatten_points(feet)), constant=balls)
    entities.send_columns("world/feet", rr.Ellipsoids3D.columns(colors=colours.reshape(-1, 3)), rows=changes)
    force, desired = view.trace["force"], view.trace["force_desired"]
    scale = FORCE_LENGTH / max(1e-9, float(desired.max()))
    # Arrows begin at the foot and have the direction of the ground reaction.
    lengths = np.clip(np.concatenate([force, desired], axis=1) * scale, 0.0, 4.0 * FORCE_LENGTH)
    both = [palette.ACTUAL] * legs + [palette.DESIRED] * legs
    beside = feet + np.array([ASIDE, 0.0, 0.0])
    vectors = flatten_points(lengths[..., None] * [0.0, 0.0, 1.0])
    arrows = rr.Arrows3D.columns(vectors=vectors, origins=flatten_points(feet, beside))
    entities.send_columns("world/forces", arrows, constant=rr.Arrows3D.from_fields(radii=[0.006], colors=both))


def _find_corners(feet: Array, support: Mask) -> Array:
    """Find the corners (steps, 5, 3) of the closed polygon of the supporting feet, of all feet (steps, 4, 3).

    The order around the body is 1, 2, 4, 3; a leg in transfer is replaced by the supporting leg before it.
    """
    order = np.array([0, 1, 3, 2])
    twice_around = np.where(np.tile(support[:, order], 2), np.arange(8), 0)
    corners = order[np.maximum.accumulate(twice_around, axis=1)[:, 3:] % 4]
    return np.take_along_axis(feet, corners[..., None], axis=1)


def _log_stability(entities: Entities, view: RunView, feet: Array) -> None:
    """Log the polygon of the planned supporting feet, and the plumb line of the centre of gravity to the ground."""
    position = view.compute_position()[:, None]
    corners = _find_corners(feet, view.trace.support)
    corners[..., 2] = view.surface(corners[..., 0]) + ABOVE_GROUND
    plumb = np.repeat(position, corners.shape[1], axis=1)
    plumb[:, 0, 2] = view.surface(position[:, 0, 0]) + ABOVE_GROUND
    strips = round_points(np.stack([corners, plumb], axis=1).reshape(-1, *corners.shape[1:]))
    lines = rr.LineStrips3D.from_fields(radii=[0.004, 0.0015], colors=[palette.POLYGON, palette.COG])
    entities.send_columns("world/support", rr.LineStrips3D.columns(strips=strips), constant=lines)
    ball = rr.Ellipsoids3D(
        centers=[[0.0, 0.0, ABOVE_GROUND]], half_sizes=[[0.012] * 3], colors=[palette.COG], fill_mode="solid"
    )
    entities.log("world/travel/centre_of_gravity", ball)


def _log_slope(entities: Entities, view: RunView, feet: Array) -> None:
    """Log the surface of sloping ground to the left and right of the path of the machine."""
    first, last = float(feet[..., 0].min()), float(feet[..., 0].max())
    start = view.run.config["terrain"]["slope_start"]
    along = np.array([first - DENT, *([start] if first < start < last else []), last])
    sides = np.abs(view.hips[:, 1]).max() + 2.0 * DENT
    strips = [np.stack([along, np.full_like(along, y), view.surface(along)], axis=1) for y in (-sides, sides)]
    entities.log("world/slope", rr.LineStrips3D(strips, radii=0.004, colors=palette.GROUND))


def log_ground(entities: Entities, view: RunView) -> None:
    """Log feet, contact forces and ground."""
    feet = view.in_world(view.feet())
    _log_dents(entities, view, feet)
    _log_feet(entities, view, feet)
    if view.run.config["terrain"].get("slope"):
        _log_slope(entities, view, feet)
    if view.walks:
        _log_stability(entities, view, feet)
