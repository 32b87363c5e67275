"""A run as it is drawn: its traces leg by leg, and the geometry to draw them with.

World: x forward, y left, z up, metres; the undepressed ground is z = 0 up to where a slope begins. Body frame as in
``cmacexp/models/body.py``.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.manifest import Manifest
from cmacexp.data.parquet import as_array, is_support
from cmacexp.data.run import select_whole
from cmacexp.data.trace import Trace
from cmacexp.models.chain import chain_points
from cmacexp.models.ground import height_at
from cmacexp.recording.window import Window
from cmacexp.typing import Array, Mask


@dataclass(frozen=True)
class LegView:
    """Columns of one leg, (steps,) each, and how it is built."""

    number: int
    name: str
    columns: dict[str, Array]
    support: Mask
    thigh: float
    """Of a leg in a plane, from hip to knee, m; 0 of a point mass."""
    hip: tuple[float, float]
    """In the body frame, forward and left, m."""
    chain: Array | None = None
    """Of a leg that moves in space, as in :mod:`cmacexp.models.chain`."""

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    @property
    def axes(self) -> str:
        """Those in which the foot moves: x forward, y down and, in space, z to the left; there are as many joints."""
        return "xy" if self.chain is None else "xyz"

    @property
    def has_joints(self) -> bool:
        """Whether it is a leg, not a point mass."""
        return self.chain is not None or self.thigh > 0.0

    def in_body(self, x: Array, y: Array, z: Array | float = 0.0) -> Array:
        """Points (n, 3) in the body frame from x forward, y down, z to the left in the frame of the hip."""
        return np.stack([x + self.hip[0], np.full_like(x, self.hip[1]) + z, -y], axis=1)

    def foot(self, of: str = "", rows: slice | NDArray[np.intp] = slice(None)) -> Array:
        """The foot (steps, 3) in the body frame, m; ``of`` ``_desired`` where it should be."""
        return self.in_body(*(self[f"{axis}{of}"][rows] for axis in self.axes))

    def joints(self) -> tuple[Array, ...]:
        """Hip, knee and foot, (steps, 3) each, in the body frame, m; those of a point mass are all at its foot.

        Of a leg that moves in space its three hinges and the foot.
        """
        foot = self.foot()
        if self.chain is not None:
            points = chain_points(self.chain, np.stack([self[f"q{n}"] for n in (1, 2, 3)], axis=1))
            return tuple(self.in_body(*points[:, n].T) for n in range(points.shape[1]))
        if not self.has_joints:
            return foot, foot, foot
        q1, zero = self["q1"], np.zeros_like(self["q1"])
        return self.in_body(zero, zero), self.in_body(*(self.thigh * np.array([np.cos(q1), np.sin(q1)]))), foot


@dataclass(frozen=True)
class RunView:
    """A run as it is drawn; arrays are (steps,)."""

    legs: list[LegView]
    time: Array
    step: Array
    cycle: Array
    body: dict[str, Array]
    """Columns of ``body.parquet``; of a stand only its constant position and orientation."""
    manifest: Manifest
    window: Window
    label: str
    """The name of the run, or the settings that distinguish it from those beside it."""
    root: str
    """Prefix of the paths of its entities in a recording."""
    foot_radius: float = 0.0
    """m: the ground that is seen is so far below the centre of a foot that touches it."""
    meshes: bool = False
    """Whether the machine is drawn as the model of the robot shows it, not as links and a box."""

    @property
    def config(self) -> dict[str, Any]:
        """As plain dictionaries."""
        return dict(self.manifest["config"])

    @property
    def walks(self) -> bool:
        """Whether there is a body on legs."""
        return len(self.legs) > 1

    def whole_cycles(self) -> tuple[int, int]:
        """The first cycle and the last whole one; of a run without a whole cycle, its last."""
        shown = np.unique(self.cycle).tolist()
        return shown[0], (select_whole(self.manifest, shown) or shown)[-1]

    def turn(self) -> Array:
        """Orientation of the body as quaternions (steps, 4), x y z w: roll about x, pitch about y, yaw about z."""
        a, p, r = (self.body[name] / 2.0 for name in ("yaw", "pitch", "roll"))
        level = [np.cos(p) * np.sin(r), np.sin(p) * np.cos(r), -np.sin(p) * np.sin(r), np.cos(p) * np.cos(r)]
        x, y, z, w = level
        c, s = np.cos(a), np.sin(a)
        return np.stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z], axis=1)

    @property
    def is_robot(self) -> bool:
        """Whether its legs move in space."""
        return self.legs[0].chain is not None

    def surface(self, x: Array) -> Array:
        """z of the ground that is seen at ``x`` in the world, m."""
        return self.ground_height(x) - self.foot_radius

    def ground_height(self, x: Array) -> Array:
        """z of the centre of a foot that touches the undepressed ground at ``x`` in the world, m.

        Flat where a config has no slope.
        """
        terrain = self.config.get("terrain", {})
        return height_at(terrain.get("slope", 0.0), terrain.get("slope_start", 0.0), x)

    def in_world(self, points: Array) -> Array:
        """Points (steps, 3) of the body frame in the world."""
        a, p, r = (self.body[name] for name in ("yaw", "pitch", "roll"))
        x, y, z = points.T
        y, z = y * np.cos(r) - z * np.sin(r), y * np.sin(r) + z * np.cos(r)
        x, z = x * np.cos(p) + z * np.sin(p), -x * np.sin(p) + z * np.cos(p)
        x, y = x * np.cos(a) - y * np.sin(a), x * np.sin(a) + y * np.cos(a)
        return np.stack([x, y, z], axis=1) + self.way()

    def way(self) -> Array:
        """The body in the world (steps, 3), m."""
        x = self.body["cog_x"]
        return np.stack([x, self.body["cog_y"], self.body["height"] + self.ground_height(x)], axis=1)


def _leg_configs(config: dict[str, Any], robot: Mapping[str, Any] | None) -> list[dict[str, Any]]:
    """How each leg is built, as the config says or, of a robot, what its model says."""
    machine = config["machine"]
    if robot:
        return [
            {"hip_x": x, "hip_y": y, "chain": chain}
            for (x, y), chain in zip(robot["hips"], robot["chains"], strict=True)
        ]
    return list(machine["legs"].values()) if "legs" in machine else [machine.get("leg") or {}]


def _leg(trace: pa.Table, rows: NDArray[np.intp], number: int, built: dict[str, Any]) -> LegView:
    skipped = {"step", "time", "cycle", "leg", "phase"}
    chain = np.array(built["chain"]) if "chain" in built else None
    return LegView(
        number,
        LEG_NAMES[number - 1] if "hip_x" in built else "leg",
        {name: as_array(trace, name)[rows] for name in trace.column_names if name not in skipped},
        is_support(trace)[rows],
        built.get("length_1", 0.0),
        (built.get("hip_x", 0.0), built.get("hip_y", 0.0)),
        chain,
    )


def make_view(
    traces: Trace, manifest: Manifest, window: Window | None = None, label: str = "", root: str = ""
) -> RunView:
    """The view of a run from the traces of the steps that are drawn; without a window they are all of its steps."""
    trace, config, robot = traces.table, manifest["config"], manifest.get("robot")
    number, built = as_array(trace, "leg"), _leg_configs(config, robot)
    rows = {i: np.flatnonzero(number == i) for i in range(1, len(built) + 1)}
    legs = [_leg(trace, rows[i], i, leg) for i, leg in enumerate(built, start=1)]
    time, step, cycle = (as_array(trace, name)[rows[1]] for name in ("time", "step", "cycle"))
    if traces.body is not None:
        body = {"yaw": np.zeros_like(time)}
        body |= {name: traces.body[name] for name in traces.body.names}
    else:
        still = np.zeros_like(time)
        body = dict.fromkeys(("cog_x", "cog_y", "yaw", "pitch", "roll"), still)
        body["height"] = still + config["machine"]["hip_height"]
    all_steps = Window(int(cycle[0]), int(cycle[-1]), 1, len(cycle))
    radius = robot["foot_radius"] if robot else 0.0
    return RunView(legs, time, step, cycle, body, manifest, window or all_steps, label, root, radius)
