"""The machine: its body, links and foot paths."""

import numpy as np
import rerun as rr

from cmacexp.recording import palette
from cmacexp.recording.entities import Entities
from cmacexp.recording.run_view import LegView, RunView
from cmacexp.typing import Array

PATH_POINTS = 150
"""Points of a drawn foot path."""


def _log_body(entities: Entities, view: RunView) -> None:
    """The frames ``world/travel``, which moves on with the machine, and ``world/travel/body``, which tilts too."""
    zero = np.zeros_like(view.time)
    way = view.way() * [1.0, 1.0, 0.0]
    entities.send_columns("world/travel", rr.Transform3D.columns(translation=way))
    up = np.stack([zero, zero, view.way()[:, 2]], axis=1)
    pose = rr.Transform3D.columns(translation=up, quaternion=view.turn())
    entities.send_columns("world/travel/body", pose)
    hips = np.array([[*leg.hip, 0.0] for leg in view.legs])
    entities.log("world/travel/body/hips", rr.Points3D(hips, radii=0.02, colors=palette.DESIRED))
    if view.walks:
        half = (hips.max(axis=0) - hips.min(axis=0)) / 2.0 + [0.0, 0.0, 0.008]
        middle = (hips.max(axis=0) + hips.min(axis=0)) / 2.0
        plate = rr.Boxes3D(centers=[middle], half_sizes=[half], colors=[palette.BODY], fill_mode="solid")
        entities.log("world/travel/body/plate", plate)
        nose = [
            [middle[0] + half[0], -0.03, 0.0],
            [middle[0] + half[0] + 0.06, 0.0, 0.0],
            [middle[0] + half[0], 0.03, 0.0],
        ]
        entities.log("world/travel/body/nose", rr.LineStrips3D([nose], radii=0.006, colors=palette.THIGH))


def _log_link(entities: Entities, view: RunView, path: str, start: Array, angle: Array, length: float) -> None:
    """A link as a capsule along +z, turned about the body's y so that it points along ``angle`` from +x, y down."""
    colour = palette.THIGH if path.endswith("thigh") else palette.SHANK
    capsule = rr.Capsules3D(lengths=[length], radii=[0.012], colors=[colour], fill_mode="solid")
    entities.log(path, capsule)
    half = (angle + np.pi / 2.0) / 2.0
    zero = np.zeros_like(half)
    turn = np.stack([zero, np.sin(half), zero, np.cos(half)], axis=1)
    entities.send_columns(path, rr.Transform3D.columns(translation=start, quaternion=turn))


def _log_links(entities: Entities, view: RunView, leg: LegView, path: str) -> None:
    if leg.lengths is None:
        return
    upper, lower = leg.lengths
    hip = leg.in_body(np.zeros_like(leg["q1"]), np.zeros_like(leg["q1"]))
    knee = leg.in_body(upper * np.cos(leg["q1"]), upper * np.sin(leg["q1"]))
    _log_link(entities, view, f"{path}/thigh", hip, leg["q1"], upper)
    _log_link(entities, view, f"{path}/shank", knee, leg["q1"] + leg["q2"], lower)
    joint = rr.Points3D.from_fields(radii=[0.016], colors=[palette.THIGH])
    entities.log(f"{path}/knee", joint)
    entities.send_columns(f"{path}/knee", rr.Points3D.columns(positions=knee))


def _log_paths(entities: Entities, view: RunView, leg: LegView, path: str) -> None:
    """The desired path, and the actual one in the first and in the last whole cycle, in the frame of the hip."""
    first, last = view.whole_cycles()
    shown = {
        "desired": (first, "x_desired", "y_desired", palette.DESIRED),
        "first_cycle": (first, "x", "y", palette.FIRST_CYCLE),
        "last_cycle": (last, "x", "y", palette.LAST_CYCLE),
    }
    if first == last:
        del shown["first_cycle"]
    for name, (cycle, x, y, colour) in shown.items():
        rows = np.flatnonzero(view.cycle == cycle)
        rows = rows[:: max(1, len(rows) // PATH_POINTS)]
        strip = rr.LineStrips3D([leg.in_body(leg[x][rows], leg[y][rows])], radii=[0.003], colors=[colour])
        entities.log(f"{path}/path/{name}", strip)


def log_machine(entities: Entities, view: RunView) -> None:
    """Everything that is part of the machine, or moves with it."""
    entities.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _log_body(entities, view)
    for leg in view.legs:
        path = f"world/travel/body/leg_{leg.number}"
        _log_links(entities, view, leg, path)
        _log_paths(entities, view, leg, path)
