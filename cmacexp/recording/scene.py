"""The machine on its ground: links, feet, paths, contact forces.

World: x forward, y left, z up, metres; the undepressed ground is z = 0.
"""

import numpy as np
import rerun as rr

from cmacexp.arrays import Array
from cmacexp.recording import palette
from cmacexp.recording.view import LegView, RunView

FORCE_LENGTH = 0.15
"""Length of an arrow for the largest desired force, m."""
GROUND_LENGTH = 0.7
"""Length of the drawn ground, m."""
DENT = 0.06
"""Half the length of the dent that a foot presses, m."""
PATH_SAMPLES = 4
"""A drawn path keeps one sample in so many."""


def _world(x: Array, y: Array, hip_height: float) -> Array:
    """Points (n, 3) in the world from x forward, y down in the hip frame."""
    return np.stack([x, np.zeros_like(x), hip_height - y], axis=1)


def _log_ground(recording: rr.RecordingStream, view: RunView, leg: LegView, path: str) -> None:
    """The surface of the ground in the plane of the leg, pressed down by its foot."""
    x, depth = leg["x"], np.maximum(leg["y"] - view.hip_height, 0.0)
    ends = np.full_like(x, GROUND_LENGTH / 2.0)
    zero = np.zeros_like(x)
    along = np.stack([-ends, x - DENT, x - DENT / 2.0, x, x + DENT / 2.0, x + DENT, ends], axis=1)
    up = np.stack([zero, zero, -depth / 2.0, -depth, -depth / 2.0, zero, zero], axis=1)
    strips = np.stack([along, np.zeros_like(along), up], axis=2)
    line = rr.LineStrips3D.from_fields(radii=[0.005], colors=[palette.GROUND])
    recording.log(f"{path}/ground", line, static=True)
    recording.send_columns(f"{path}/ground", view.indexes, rr.LineStrips3D.columns(strips=strips))


def _log_link(
    recording: rr.RecordingStream, view: RunView, path: str, start: Array, angle: Array, length: float
) -> None:
    """A link as a capsule along +z, turned about the world's y so that it points along ``angle`` from +x, y down."""
    colour = palette.THIGH if path.endswith("thigh") else palette.SHANK
    capsule = rr.Capsules3D(lengths=[length], radii=[0.012], colors=[colour], fill_mode="solid")
    recording.log(path, capsule, static=True)
    half = (angle + np.pi / 2.0) / 2.0
    zero = np.zeros_like(half)
    turn = np.stack([zero, np.sin(half), zero, np.cos(half)], axis=1)
    recording.send_columns(path, view.indexes, rr.Transform3D.columns(translation=start, quaternion=turn))


def _log_links(recording: rr.RecordingStream, view: RunView, leg: LegView, path: str) -> None:
    if leg.lengths is None:
        return
    upper, lower = leg.lengths
    hip = _world(np.zeros_like(leg["q1"]), np.zeros_like(leg["q1"]), view.hip_height)
    knee = _world(upper * np.cos(leg["q1"]), upper * np.sin(leg["q1"]), view.hip_height)
    _log_link(recording, view, f"{path}/thigh", hip, leg["q1"], upper)
    _log_link(recording, view, f"{path}/shank", knee, leg["q1"] + leg["q2"], lower)
    stand = rr.Points3D([[0.0, 0.0, view.hip_height]], radii=[0.025], colors=[palette.DESIRED])
    recording.log(f"{path}/hip", stand, static=True)


def _log_paths(recording: rr.RecordingStream, view: RunView, leg: LegView, path: str) -> None:
    """The desired path, and the actual one in the first and in the last whole cycle."""
    cycles = np.unique(view.cycle)
    whole = np.sum(view.cycle == cycles[0])
    last = max(cycle for cycle in cycles if np.sum(view.cycle == cycle) == whole)
    shown = {"desired": (cycles[0], "x_desired", "y_desired", palette.DESIRED, 0.002)}
    shown["first_cycle"] = (cycles[0], "x", "y", palette.FIRST_CYCLE, 0.003)
    if last > cycles[0]:
        shown["last_cycle"] = (last, "x", "y", palette.LAST_CYCLE, 0.003)
    for name, (cycle, x, y, colour, radius) in shown.items():
        rows = np.flatnonzero(view.cycle == cycle)[::PATH_SAMPLES]
        points = _world(leg[x][rows], leg[y][rows], view.hip_height)
        strip = rr.LineStrips3D([points], radii=[radius], colors=[colour])
        recording.log(f"{path}/path/{name}", strip, static=True)


def _log_foot(recording: rr.RecordingStream, view: RunView, leg: LegView, path: str) -> None:
    """The foot, coloured by planned phase, with desired and actual contact force as arrows."""
    foot = _world(leg["x"], leg["y"], view.hip_height)
    colours = np.where(leg.support[:, None], palette.SUPPORT, palette.TRANSFER).astype(np.uint8)
    recording.log(f"{path}/foot", rr.Points3D.from_fields(radii=[0.018]), static=True)
    recording.send_columns(f"{path}/foot", view.indexes, rr.Points3D.columns(positions=foot, colors=colours))
    scale = FORCE_LENGTH / max(float(leg["force_desired"].max()), 1e-9)
    for name, aside, colour in (("force", 0.0, palette.FORCE), ("force_desired", 0.025, palette.DESIRED)):
        # Arrows stand on the foot and point the way the ground pushes it.
        up = np.zeros_like(foot)
        up[:, 2] = np.clip(leg[name], 0.0, 4.0 / scale) * scale
        recording.log(f"{path}/{name}", rr.Arrows3D.from_fields(radii=[0.006], colors=[colour]), static=True)
        origin = foot + np.array([aside, 0.0, 0.0])
        recording.send_columns(f"{path}/{name}", view.indexes, rr.Arrows3D.columns(vectors=up, origins=origin))


def log_scene(recording: rr.RecordingStream, view: RunView) -> None:
    """Everything that stands or moves in the 3-D view."""
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for leg in view.legs:
        path = f"world/leg_{leg.number}"
        _log_ground(recording, view, leg, path)
        _log_links(recording, view, leg, path)
        _log_paths(recording, view, leg, path)
        _log_foot(recording, view, leg, path)
