"""Feet on the ground: where they press, how deep and how hard, and the polygon that they support."""

import numpy as np
import rerun as rr

from cmacexp.recording import palette
from cmacexp.recording.entities import Entities
from cmacexp.recording.run_view import LegView, RunView
from cmacexp.typing import Array, Mask

FORCE_LENGTH = 0.15
"""Length of an arrow for the largest desired force, m."""
LONGEST_ARROW = 4.0
"""An arrow is at most so many times that length."""
VISIBLE_DEPRESSION = 0.04
"""A smaller largest depression is drawn deeper than it is, m."""
GROUND_LENGTH = 0.7
"""Length of the ground that is drawn under one leg, m."""
ABOVE_GROUND = 0.002
"""Height at which marks on the ground are drawn, m, so that they are visible."""
DENT = 0.06
"""Half the length of the dent that a foot presses, m."""


def depression_scale(view: RunView) -> int:
    """How many times deeper than they are depressions are drawn."""
    force = max(float(leg["force_desired"].max()) for leg in view.legs)
    depth = force / view.config["terrain"]["stiffness"]
    return round(VISIBLE_DEPRESSION / depth / 10.0) * 10 if 0.0 < depth < VISIBLE_DEPRESSION / 5.0 else 1


def _log_dent(entities: Entities, view: RunView, leg: LegView, foot: Array, path: str) -> None:
    """The surface of the ground in the plane of a leg, pressed down by its foot."""
    x, y, z = foot.T
    # The plant takes the height of a slope where the foot of a level body would be: some mm off on a steep one.
    surface = view.ground_height(view.body["cog_x"] + leg.hip[0] + leg["x"])
    depth = np.maximum(surface - z, 0.0) * depression_scale(view)
    length = DENT if view.walks else GROUND_LENGTH / 2.0
    start, end = (x - length, x + length) if view.walks else (np.full_like(x, -length), np.full_like(x, length))
    zero = np.zeros_like(x)
    along = np.stack([start, x - DENT, x - DENT / 2.0, x, x + DENT / 2.0, x + DENT, end], axis=1)
    up = view.ground_height(along) - np.stack([zero, zero, depth / 2.0, depth, depth / 2.0, zero, zero], axis=1)
    strips = np.stack([along, np.repeat(y[:, None], 7, axis=1), up], axis=2)
    entities.log(path, rr.LineStrips3D.from_fields(radii=[0.005], colors=[palette.GROUND]))
    entities.send_columns(path, rr.LineStrips3D.columns(strips=strips))


def _log_foot(entities: Entities, view: RunView, leg: LegView, foot: Array, path: str) -> None:
    """The foot, coloured by planned phase, with desired and actual contact force as arrows side by side."""
    colours = np.where(leg.support[:, None], palette.SUPPORT, palette.TRANSFER).astype(np.uint8)
    entities.log(f"{path}/foot", rr.Points3D.from_fields(radii=[0.018]))
    entities.send_columns(f"{path}/foot", rr.Points3D.columns(positions=foot, colors=colours))
    scale = FORCE_LENGTH / max(1e-9, *(float(each["force_desired"].max()) for each in view.legs))
    for name, aside, colour in (("force", 0.0, palette.FORCE), ("force_desired", 0.025, palette.DESIRED)):
        # Arrows stand on the foot and point the way the ground pushes it.
        up = np.zeros_like(foot)
        up[:, 2] = np.clip(leg[name] * scale, 0.0, LONGEST_ARROW * FORCE_LENGTH)
        entities.log(f"{path}/{name}", rr.Arrows3D.from_fields(radii=[0.006], colors=[colour]))
        origins = foot + np.array([aside, 0.0, 0.0])
        entities.send_columns(f"{path}/{name}", rr.Arrows3D.columns(vectors=up, origins=origins))


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
    """Polygon of the feet planned to support, and the centre of gravity projected on the ground."""
    support = np.stack([leg.support for leg in view.legs], axis=1)
    corners = _around(feet, support)
    corners[..., 2] = view.ground_height(corners[..., 0]) + ABOVE_GROUND
    entities.log("world/support", rr.LineStrips3D.from_fields(radii=[0.004], colors=[palette.POLYGON]))
    entities.send_columns("world/support", rr.LineStrips3D.columns(strips=corners.astype(np.float32)))
    point = view.way()
    point[:, 2] = view.ground_height(point[:, 0]) + ABOVE_GROUND
    entities.log("world/centre_of_gravity", rr.Points3D.from_fields(radii=[0.012], colors=[palette.COG]))
    entities.send_columns("world/centre_of_gravity", rr.Points3D.columns(positions=point))
    plumb = np.stack([point, view.way() + np.array([0.0, 0.0, ABOVE_GROUND])], axis=1)
    entities.log("world/plumb", rr.LineStrips3D.from_fields(radii=[0.0015], colors=[palette.COG]))
    entities.send_columns("world/plumb", rr.LineStrips3D.columns(strips=plumb.astype(np.float32)))


def _log_slope(entities: Entities, view: RunView, feet: list[Array]) -> None:
    """The surface of sloping ground to the left and right of the way."""
    x = np.concatenate([foot[:, 0] for foot in feet])
    bends = [x.min() - DENT, *(b for b in [view.config["terrain"]["slope_start"]] if x.min() < b < x.max()), x.max()]
    along = np.array(bends)
    sides = max(abs(leg.hip[1]) for leg in view.legs) + 2.0 * DENT
    strips = [np.stack([along, np.full_like(along, y), view.ground_height(along)], axis=1) for y in (-sides, sides)]
    entities.log("world/ground/slope", rr.LineStrips3D(strips, radii=0.004, colors=palette.GROUND))


def log_ground(entities: Entities, view: RunView) -> None:
    """Everything between feet and ground."""
    feet = [view.in_world(leg.in_body(leg["x"], leg["y"])) for leg in view.legs]
    for leg, foot in zip(view.legs, feet, strict=True):
        _log_dent(entities, view, leg, foot, f"world/ground/leg_{leg.number}")
        _log_foot(entities, view, leg, foot, f"world/feet/leg_{leg.number}")
    if view.config["terrain"].get("slope"):
        _log_slope(entities, view, feet)
    if view.walks:
        _log_stability(entities, view, np.stack(feet, axis=1))
