"""The machine: its body, links and foot paths, and the eyes that see it from the sides."""

import numpy as np
import pyarrow as pa
import rerun as rr

from cmacexp.recording import palette
from cmacexp.recording.entities import Entities, points
from cmacexp.recording.run_view import RunView
from cmacexp.typing import Array

FINE_ANGLE = 2e-3
"""Drawn angles of links are multiples of this, rad: their ends move less than a pixel, and a recording is smaller."""
PATH_POINTS = 150
"""Points of a drawn foot path."""
EYES = {
    "front": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)),
    "right side": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "top": ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
}
"""Of each view of the sides, what is right, down and ahead for its eye, in the frame that moves with the machine."""
AWAY = 10.0
"""Distance of these eyes, m: so far away that parallel lines stay parallel; the viewer has no parallel projection."""
HIGHEST_NUMBER, LOWEST_NUMBER = -0.06, -0.16
"""Where the numbers of the feet are, above the ground, m."""
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


def _log_body(entities: Entities, view: RunView) -> None:
    """The frames ``world/travel``, which moves on with the machine, and ``world/travel/body``, which tilts too."""
    way = view.way()
    ground = way[:, 2] - view.body["height"]
    entities.send_columns(
        "world/travel", rr.Transform3D.columns(translation=np.stack([way[:, 0], way[:, 1], ground], axis=1))
    )
    up = np.stack([np.zeros_like(ground), np.zeros_like(ground), view.body["height"]], axis=1)
    entities.send_columns(
        "world/travel/body", rr.Transform3D.columns(translation=up, quaternion=view.turn().astype(np.float32))
    )
    if not view.walks:
        return
    hips = np.array([[*leg.hip, 0.0] for leg in view.legs])
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


def _turns(angles: Array) -> pa.Array:
    """Turns about the body's y by angles (n,), which the viewer takes as axis and angle: a third of a quaternion."""
    kind = rr.components.RotationAxisAngleBatch(rr.RotationAxisAngle(axis=(0, 1, 0), radians=0)).as_arrow_array().type
    axes = np.tile(np.array([0.0, 1.0, 0.0], dtype=np.float32), len(angles))
    columns = [
        pa.FixedSizeListArray.from_arrays(pa.array(axes), type=kind.field("axis").type),
        pa.array((np.round(angles / FINE_ANGLE) * FINE_ANGLE).astype(np.float32)),
    ]
    return pa.StructArray.from_arrays(columns, fields=list(kind))


def _log_links(entities: Entities, view: RunView) -> None:
    """Thighs, shanks, and knees: capsules along +z, turned to point along the angle of the link from +x, y down."""
    legs = [(leg, *leg.lengths) for leg in view.legs if leg.lengths is not None]
    if not legs:
        return
    number = len(legs)
    hips, knees, _ = (np.stack(joint, axis=1) for joint in zip(*(leg.joints() for leg, _, _ in legs), strict=True))
    q1, q2 = (np.stack([leg[name] for leg, _, _ in legs], axis=1) for name in ("q1", "q2"))
    angles = np.concatenate([q1 + np.pi / 2.0, q1 + q2 + np.pi / 2.0, np.zeros_like(q1)], axis=1)
    links = rr.Capsules3D.from_fields(
        lengths=[upper for _, upper, _ in legs] + [lower for _, _, lower in legs] + [0.0] * number,
        radii=[0.012] * 2 * number + [0.016] * number,
        colors=[palette.THIGH] * number + [palette.SHANK] * number + [palette.THIGH] * number,
        fill_mode="solid",
    )
    entities.log("world/travel/body/links", links)
    moving = rr.Capsules3D.columns(
        translations=points(hips, knees, knees), rotation_axis_angles=_turns(angles.ravel())
    )
    entities.send_columns("world/travel/body/links", moving)
    entities.log("world/travel/body/hips", make_balls(hips[0], 0.02, palette.DESIRED))


def _log_paths(entities: Entities, view: RunView) -> None:
    """The desired paths, and the actual ones in the first and in the last whole cycle, in the frame of the body."""
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
        strips = [leg.in_body(leg[x][rows], leg[y][rows]) for leg in view.legs]
        entities.log(f"world/travel/body/path/{name}", rr.LineStrips3D(strips, radii=[0.003], colors=[colour]))


def _log_numbers(entities: Entities, view: RunView) -> None:
    """The number of each foot below the middle of its desired path, at two heights so that none hides another."""
    places = []
    for leg in view.legs:
        low = HIGHEST_NUMBER if leg.number in (1, 4) else LOWEST_NUMBER
        middle = (leg["x_desired"].min() + leg["x_desired"].max()) / 2.0
        places.append([leg.hip[0] + middle, leg.hip[1], low])
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
