"""The legs of a machine drawn from its right side."""

from typing import TYPE_CHECKING

from cmacexp.recording import palette
from cmacexp.recording.run_view import RunView
from cmacexp.report.style import colour
from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MM = 1e3
DENT = 26.0
"""Half the length of the dent that a foot presses, mm."""
NEAR, FAR, ALOFT = colour(palette.THIGH), "#AEB9C6", colour(palette.TRANSFER)
NEAR_SIDE = (2, 4)
"""Legs on the viewer's side, who looks from the right."""


def in_travel(view: RunView, points: Array) -> Array:
    """Points (steps, ..., 3) of the body frame in the frame that moves with the machine but does not tilt, mm."""
    travel = (view.way() * [1.0, 1.0, 0.0]).reshape(-1, *[1] * (points.ndim - 2), 3)
    moved: Array = MM * (view.in_world(points) - travel)
    return moved


def joints(view: RunView) -> Array:
    """Joints and foot of each leg (steps, legs, joints + 1, 3) in the frame that moves with the machine, mm."""
    return in_travel(view, view.joints)


def draw_leg(axes: "Axes", points: Array, near: bool, aloft: bool) -> None:
    """Joints and foot (n, 2), mm; of the far side paler, light blue while in transfer."""
    ink = ALOFT if aloft else NEAR if near else FAR
    order = 4 if near else 2
    axes.plot(*points.T, color=ink, lw=3.0 if near else 2.4, solid_capstyle="round", zorder=order)
    axes.plot(*points[:-1].T, "o", ms=4.5, color="white", mec=ink, mew=1.3, zorder=order + 0.5)
    axes.plot(*points[-1], "o", ms=5.5, color=ink, zorder=order + 0.5)
