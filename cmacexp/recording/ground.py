"""Feet on the ground: where they press, how deep and how hard, and the polygon that they support."""

import numpy as np
import rerun as rr

from cmacexp.recording import palette
from cmacexp.recording.entities import Entities, points, round_points
from cmacexp.recording.run_view import RunView
from cmacexp.recording.scene import FOOT, make_balls
from cmacexp.typing import Array, Mask

FORCE_LENGTH = 0.15
"""Length of an arrow for the largest desired force, m."""
VISIBLE_DEPRESSION = 0.04
"""A smaller largest depression is drawn deeper than it is, m."""
ABOVE_GROUND = 0.002
"""Height at which marks on the ground are drawn, m, so that they are visible."""
DENT = 0.06
"""Half the length of the dent that a foot presses, m."""
ASIDE = 0.025
"""Distance of the arrow of the desired force from that of the actual one, m."""


def depression_scale(view: RunView) -> int:
    """How many times deeper than they are depressions are drawn."""
    force = max(float(leg["force_desired"].max()) for leg in view.legs)
    depth = force / view.config["terrain"]["stiffness"]
    return round(VISIBLE_DEPRESSION / depth / 10.0) * 10 if 0.0 < depth < VISIBLE_DEPRESSION / 5.0 else 1


def _log_dents(entities: Entities, view: RunView, feet: Array) -> None:
    """The surface of the ground in the plane of each leg, pressed down by its foot."""
    x, y, z = np.moveaxis(feet, 2, 0)[..., None]
    # The plant takes the height of a slope where the foot of a level body would be: some mm off on a steep one.
    at = np.stack([view.body["cog_x"] + leg.hip[0] + leg["x"] for leg in view.legs], axis=1)
    depth = np.maximum(view.ground_height(at)[..., None] - z, 0.0) * depression_scale(view)
    along, deep = x + np.array([-DENT, 0.0, DENT]), depth * [0.0, 1.0, 0.0]
    if not view.walks:
        end = np.full_like(x, 0.35)  # half the length of the ground that is drawn under one leg, m
        along, deep = np.concatenate([-end, along, end], axis=2), np.pad(deep, ((0, 0), (0, 0), (1, 1)))
    surface = np.stack([along, np.broadcast_to(y, along.shape), view.surface(along) - deep], axis=3)
    strips = round_points(surface.reshape(-1, *surface.shape[2:]))
    entities.log("world/ground", rr.LineStrips3D.from_fields(radii=[0.005], colors=[palette.GROUND]))
    entities.send_columns("world/ground", rr.LineStrips3D.columns(strips=strips))


def _log_feet(entities: Entities, view: RunView, feet: Array) -> None:
    """The feet, coloured by planned phase, with actual and desired contact forces as arrows side by side."""
    support = np.stack([leg.support for leg in view.legs], axis=1)
    changes = np.flatnonzero(np.any(np.diff(support, axis=0, prepend=~support[:1]), axis=1))
    colours = np.where(support[changes, :, None], palette.SUPPORT, palette.TRANSFER).astype(np.uint8)
    radius = (view.foot_radius or FOOT) * (1.1 if view.meshes else 1.0)  # else its mesh would hide its colour
    balls = rr.Ellipsoids3D.from_fields(half_sizes=[[radius] * 3] * len(view.legs), fill_mode="solid")
    entities.log("world/feet", balls)
    entities.send_columns("world/feet", rr.Ellipsoids3D.columns(centers=points(feet)))
    entities.send_columns("world/feet", rr.Ellipsoids3D.columns(colors=colours.reshape(-1, 3)), rows=changes)
    force, desired = (np.stack([leg[name] for leg in view.legs], axis=1) for name in ("force", "force_desired"))
    scale = FORCE_LENGTH / max(1e-9, float(desired.max()))
    # Arrows stand on the foot and point the way the ground pushes it.
    up = np.clip(np.concatenate([force, desired], axis=1) * scale, 0.0, 4.0 * FORCE_LENGTH)
    both = [palette.ACTUAL] * len(view.legs) + [palette.DESIRED] * len(view.legs)
    entities.log("world/forces", rr.Arrows3D.from_fields(radii=[0.006], colors=both))
    arrows = rr.Arrows3D.columns(
        vectors=points(up[..., None] * [0.0, 0.0, 1.0]), origins=points(feet, feet + np.array([ASIDE, 0.0, 0.0]))
    )
    entities.send_columns("world/forces", arrows)


def _around(feet: Array, support: Mask) -> Array:
    """Corners (steps, 5, 3) of the closed polygons of the supporting feet (steps, 4, 3).

    Legs go round the body as 1, 2, 4, 3; a leg in transfer gives way to the one before it.
    """
    order = np.array([0, 1, 3, 2])
    feet, support = feet[:, order], support[:, order]
    corners = np.empty((len(feet), 5, 3))
    current = feet[np.arange(len(feet)), np.argmax(support, axis=1)]
    for n in (3, 2, 1, 0, 3):  # from the last supporting foot backwards, so that a leg in transfer repeats it
        current = np.where(support[:, n, None], feet[:, n], current)
        corners[:, n] = current
    corners[:, 4] = corners[:, 0]
    return corners


def _log_stability(entities: Entities, view: RunView, feet: Array) -> None:
    """Polygon of the feet planned to support, and the centre of gravity above its projection on the ground."""
    support = np.stack([leg.support for leg in view.legs], axis=1)
    way = view.way()[:, None]
    corners = _around(feet, support)
    corners[..., 2] = view.surface(corners[..., 0]) + ABOVE_GROUND
    plumb = np.repeat(way, corners.shape[1], axis=1)
    plumb[:, 0, 2] = view.surface(way[:, 0, 0]) + ABOVE_GROUND
    strips = round_points(np.stack([corners, plumb], axis=1).reshape(-1, *corners.shape[1:]))
    lines = rr.LineStrips3D.from_fields(radii=[0.004, 0.0015], colors=[palette.POLYGON, palette.COG])
    entities.log("world/support", lines)
    entities.send_columns("world/support", rr.LineStrips3D.columns(strips=strips))
    entities.log(
        "world/travel/centre_of_gravity", make_balls(np.array([[0.0, 0.0, ABOVE_GROUND]]), 0.012, palette.COG)
    )


def _log_slope(entities: Entities, view: RunView, feet: Array) -> None:
    """The surface of sloping ground to the left and right of the way."""
    first, last = float(feet[..., 0].min()), float(feet[..., 0].max())
    bends = [first - DENT, *(b for b in [view.config["terrain"]["slope_start"]] if first < b < last), last]
    along = np.array(bends)
    sides = max(abs(leg.hip[1]) for leg in view.legs) + 2.0 * DENT
    strips = [np.stack([along, np.full_like(along, y), view.surface(along)], axis=1) for y in (-sides, sides)]
    entities.log("world/slope", rr.LineStrips3D(strips, radii=0.004, colors=palette.GROUND))


def log_ground(entities: Entities, view: RunView) -> None:
    """Everything between feet and ground."""
    feet = np.stack([view.in_world(leg.foot()) for leg in view.legs], axis=1)
    _log_dents(entities, view, feet)
    _log_feet(entities, view, feet)
    if view.config["terrain"].get("slope"):
        _log_slope(entities, view, feet)
    if view.walks:
        _log_stability(entities, view, feet)
