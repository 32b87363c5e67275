"""A machine drawn from the side: its links, its body, and the ground that its feet press."""

from typing import TYPE_CHECKING

import numpy as np

from cmacexp.recording import palette
from cmacexp.recording.run_view import LegView, RunView
from cmacexp.report.style import GROUND, colour
from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MM = 1e3
DENT = 26.0
"""Half the length of the dent that a foot presses, mm."""
BODY = 24.0
"""Drawn thickness of the body, mm."""
NEAR, FAR, ALOFT = colour(palette.THIGH), "#AEB9C6", colour(palette.TRANSFER)
NEAR_SIDE = (2, 4)
"""Legs on the viewer's side, who looks from the right."""


def is_near(leg: LegView) -> bool:
    """Whether a leg is on the viewer's side; a single one is."""
    return leg.number in NEAR_SIDE or leg.hip[1] == 0.0


def in_travel(view: RunView, points: Array) -> Array:
    """Points (steps, 3) of the body frame in the frame that moves with the machine but does not tilt, mm."""
    moved: Array = MM * (view.in_world(points) - view.way() * [1.0, 1.0, 0.0])
    return moved


def joints(view: RunView) -> Array:
    """Joints and foot of each leg (steps, legs, joints + 1, 3) in the frame that moves with the machine, mm."""
    legs = [np.stack([in_travel(view, joint) for joint in leg.joints()], axis=1) for leg in view.legs]
    return np.stack(legs, axis=1)


def draw_leg(axes: "Axes", points: Array, near: bool, aloft: bool) -> None:
    """Joints and foot (n, 2), mm; of the far side paler, light blue while in transfer."""
    ink = ALOFT if aloft else NEAR if near else FAR
    order = 4 if near else 2
    axes.plot(*points.T, color=ink, lw=3.0 if near else 2.4, solid_capstyle="round", zorder=order)
    axes.plot(*points[:-1].T, "o", ms=4.5, color="white", mec=ink, mew=1.3, zorder=order + 0.5)
    axes.plot(*points[-1], "o", ms=5.5, color=ink, zorder=order + 0.5)


def draw_side(axes: "Axes", view: RunView, places: Array, k: int, depression: float) -> None:
    """The machine in step ``k`` from its right side, x forward and z up.

    Args:
        axes: where.
        view: the run.
        places: of its :func:`joints`, (steps, legs, joints + 1, 3).
        k: step of the view.
        depression: factor by which drawn depressions exceed the true ones.
    """
    stiffness, surface = float(view.config["terrain"]["stiffness"]), -MM * view.foot_radius
    for leg, points in sorted(zip(view.legs, places[k], strict=True), key=lambda pair: is_near(pair[0])):
        draw_leg(axes, points[:, [0, 2]], is_near(leg), not leg.support[k])
        x, deep = points[-1, 0], surface - MM * depression * leg["force"][k] / stiffness
        axes.fill([x - DENT, x, x + DENT], [surface, deep, surface], color=GROUND, lw=0.0, zorder=3)
    if view.walks:
        hips = places[k][:, 0, [0, 2]]
        ends = hips[[hips[:, 0].argmin(), hips[:, 0].argmax()]] + [0.0, BODY / 2.0]
        for ink, width in ((NEAR, 9.0), (colour(palette.BODY), 7.0)):
            axes.plot(*ends.T, color=ink, lw=width, solid_capstyle="round", zorder=3.5)
    axes.axhline(surface, color=GROUND, lw=1.2, zorder=1)
