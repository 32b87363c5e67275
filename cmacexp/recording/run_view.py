"""The geometry of a run for drawings: its trace, and the positions of body, joints and feet at each step.

World frame: x forward, y left, z up, metres; the undepressed ground is z = 0 up to where a slope starts. Body frame
as in ``cmacexp/models/body.py``. Hip frame: x forward, y down, z left.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cmacexp.config.machine import LEG_KEYS, LEG_NAMES, RobotMachine, read_model
from cmacexp.data.run import Run
from cmacexp.data.trace import Trace, count_steps_by_cycle
from cmacexp.errors import BadRun, require
from cmacexp.models.chain import chain_points
from cmacexp.models.ground import height_at
from cmacexp.models.robot import Robot
from cmacexp.models.robot_file import find_model
from cmacexp.typing import Array

POSE = ("cog_x", "cog_y", "yaw", "pitch", "roll")
"""Signals of the body that are 0 in runs without a body."""
VISIBLE_DEPRESSION = 0.04
"""Depression of the ground, m, to which a much smaller one is scaled in drawings."""
PLATE = 0.008
"""Half the height at which the body of a machine with planar legs is drawn, m."""


def count_kept(run: Run) -> dict[int, int]:
    """Count the steps of each cycle in the trace of a run, by cycle; raises BadRun if there are none."""
    if counts := count_steps_by_cycle(run.folder):
        return counts
    steps = run.manifest["steps"]
    kept_none = f"its trace kept none of its {steps} steps; run it again without record.cycles"
    raise BadRun(f"{run.folder}: {kept_none if steps else 'the run took no step, there is nothing to show'}")


def read_robot_of_run(run: Run, machine: RobotMachine) -> Robot:
    """Read the robot model that the config of a run names; files in the folder of the run are not trusted.

    Raises:
        BadInput: MuJoCo or the model is missing, or the model lies in the folder of the run.
        BadRun: the model, as this version of MuJoCo reads it, is not that of the run.
    """
    path = find_model(machine.model, machine.path)
    require(
        not path.is_relative_to(run.folder.resolve()),
        "machine.path",
        path,
        "lies in the folder of the run, whose files are not trusted",
    )
    robot = read_model(machine)
    BadRun.unless(
        run.manifest["model_hash"] == robot.model_hash,
        f"{run.folder}: ran with another model than {path} is to this MuJoCo; run it again",
    )
    return robot


@dataclass(frozen=True)
class RunView:
    """A run to draw: N steps of L legs."""

    run: Run
    trace: Trace
    """Trace of the steps to draw."""
    label: str = ""
    """Name of the run, or the settings in which it differs from the runs beside it."""
    root: str = ""
    """Prefix of its entity paths in a recording."""
    meshes: bool = False
    """True if a robot is drawn with the meshes of its model, instead of links and a box."""

    @property
    def time(self) -> Array:
        """Time, (N,), s."""
        return self.trace.shared("time")

    @property
    def step(self) -> Array:
        """Number of the step, (N,), from 0."""
        return self.trace.shared("step")

    @property
    def cycle(self) -> Array:
        """Number of the cycle, (N,), from 1."""
        return self.trace.shared("cycle")

    @cached_property
    def clock(self) -> Array:
        """Time since the start of the cycle, (N,), s."""
        return self.time - (self.cycle - 1) * float(self.run.config["gait"]["cycle_time"])

    @cached_property
    def cycles(self) -> list[int]:
        """Numbers of the cycles with at least one step."""
        return list(np.unique(self.cycle).tolist())

    @cached_property
    def body(self) -> dict[str, Array]:
        """Signals of the body by name, (N,) each; for a leg on a stand its constant position and orientation."""
        pose = dict.fromkeys(POSE, np.zeros(self.trace.steps))
        body = self.trace.body
        if body is None:
            return pose | {"height": pose["yaw"] + self.run.config["machine"]["hip_height"]}
        return pose | {name: body[name] for name in body.names}

    @property
    def walks(self) -> bool:
        """True for a machine with several legs, which carry a body."""
        return self.trace.legs > 1

    @property
    def robot(self) -> Mapping[str, Any]:
        """Geometry of a robot with spatial legs, from its model; empty for other machines."""
        return self.run.manifest["robot"] or {}

    @property
    def foot_radius(self) -> float:
        """Height of the centre of a foot above the ground that it touches, m."""
        return float(self.robot.get("foot_radius", 0.0))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the legs."""
        return LEG_NAMES[: self.trace.legs] if self.walks else ("leg",)

    @property
    def _planar_legs(self) -> list[Mapping[str, Any]]:
        """Geometry of each planar leg, from the config; an empty one for a point mass."""
        machine = self.run.config["machine"]
        has_legs = machine["kind"] == "quadruped"
        return [machine["legs"][key] for key in LEG_KEYS] if has_legs else [machine.get("leg") or {}]

    @cached_property
    def hips(self) -> Array:
        """Positions of the hips in the body frame, (L, 3), m."""
        planar = [(leg.get("hip_x", 0.0), leg.get("hip_y", 0.0)) for leg in self._planar_legs]
        return np.pad(np.array(self.robot.get("hips", planar)), ((0, 0), (0, 1)))

    @cached_property
    def has_joints(self) -> bool:
        """True for a machine with legs, False for a point mass."""
        return bool(self.robot) or "length_1" in self._planar_legs[0]

    def _in_body(self, points: Array) -> Array:
        """Transform points (N, L, 3), m, from the hip frames to the body frame."""
        return points[..., [0, 2, 1]] * [1.0, 1.0, -1.0] + self.hips

    def feet(self, kind: str = "") -> Array:
        """Return the positions of the feet in the body frame, (N, L, 3), m; of kind ``_desired`` the desired ones."""
        points = np.zeros((self.trace.steps, self.trace.legs, 3))
        for n, axis in enumerate(self.trace.axes):
            points[..., n] = self.trace[axis + kind]
        return self._in_body(points)

    @cached_property
    def joints(self) -> Array:
        """Positions of the joints and the foot of each leg in the body frame, (N, L, joints + 1, 3), m.

        A planar leg has hip and knee, a robot three hinges; a point mass has three points, all at its foot.
        """
        if not self.has_joints:
            return np.stack([self.feet()] * 3, axis=2)
        if self.robot:
            angles = np.moveaxis(self.trace.stack_joints("q{}"), 1, 0)
            chains = zip(map(np.array, self.robot["chains"]), angles, strict=True)
            points = np.stack([chain_points(chain, leg_angles) for chain, leg_angles in chains], axis=1)
            return np.stack([self._in_body(joint) for joint in np.moveaxis(points, 2, 0)], axis=2)
        angle = self.trace["q1"]
        hip = np.zeros((self.trace.steps, self.trace.legs, 3))
        thighs = np.array([leg["length_1"] for leg in self._planar_legs])
        knee = np.stack([thighs * np.cos(angle), thighs * np.sin(angle), hip[..., 2]], axis=2)
        return np.stack([self._in_body(hip), self._in_body(knee), self.feet()], axis=2)

    def torques(self, joint: int) -> dict[str, Array]:
        """Return the components of the torque of joint number ``joint``, from 1, by name, (N, L) each, N m.

        For a robot J^T F_d is separate from the feedback. For a point mass they are forces along an axis, N.
        """
        feedback = self.trace[f"tau_feedback_{joint}"]
        torques = {"feedback": feedback, "feedforward": self.trace[f"tau_feedforward_{joint}"]}
        if not self.robot:
            return torques
        force_torque = self.trace[f"tau_force_{joint}"]
        return {"for the desired force": force_torque, **torques, "feedback": feedback - force_torque}

    @cached_property
    def trunk(self) -> tuple[Array, Array]:
        """Centre and half sizes of the box between the hips, (3,) each, in the body frame, m."""
        hips = self.joints[0, :, 0] + 0.0  # no negative zero
        half = (hips.max(axis=0) - hips.min(axis=0)) / 2.0
        half[2] = half[1] if self.robot else PLATE  # trunks of robots are about as high as they are wide
        return (hips.max(axis=0) + hips.min(axis=0)) / 2.0, half

    def whole_cycles(self) -> tuple[int, int]:
        """Return the first cycle and the last complete one, or the last if none is complete."""
        return self.cycles[0], (self.run.select_whole(self.cycles) or self.cycles)[-1]

    def compute_orientation(self) -> Array:
        """Compute the orientation of the body in the world as quaternions (N, 4), x y z w.

        It is composed of roll about x, then pitch about y, then yaw about z.
        """
        a, p, r = (self.body[name] / 2.0 for name in ("yaw", "pitch", "roll"))
        x, y, z, w = np.cos(p) * np.sin(r), np.sin(p) * np.cos(r), -np.sin(p) * np.sin(r), np.cos(p) * np.cos(r)
        c, s = np.cos(a), np.sin(a)
        return np.stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z], axis=1)

    def compute_position(self) -> Array:
        """Compute the position of the body in the world, (N, 3), m."""
        x = self.body["cog_x"]
        return np.stack([x, self.body["cog_y"], self.body["height"] + self.ground_height(x)], axis=1)

    def in_world(self, points: Array) -> Array:
        """Transform points (N, ..., 3), m, from the body frame to the world frame."""
        per_step = (slice(None), *[None] * (points.ndim - 2))
        quaternion = self.compute_orientation()[per_step]
        twice = 2.0 * np.cross(quaternion[..., :3], points)
        position = self.compute_position()[per_step]
        return points + quaternion[..., 3:] * twice + np.cross(quaternion[..., :3], twice) + position

    def ground_height(self, x: Array) -> Array:
        """Compute the z of the centre of a foot that touches the undepressed ground at ``x`` in the world, m.

        The ground is flat if the config has no slope.
        """
        terrain = self.run.config.get("terrain", {})
        return height_at(terrain.get("slope", 0.0), terrain.get("slope_start", 0.0), x)

    def surface(self, x: Array) -> Array:
        """Compute the z of the surface of the ground at ``x`` in the world, m."""
        return self.ground_height(x) - self.foot_radius

    @property
    def depression_scale(self) -> int:
        """Factor by which depressions of the ground are exaggerated in drawings."""
        depth = float(self.trace["force_desired"].max()) / self.run.config["terrain"]["stiffness"]
        return round(VISIBLE_DEPRESSION / depth / 10.0) * 10 if 0.0 < depth < VISIBLE_DEPRESSION / 5.0 else 1
