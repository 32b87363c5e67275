"""A run as it is drawn: its trace, and where the parts of its machine are at each step.

World: x forward, y left, z up, metres; the undepressed ground is z = 0 up to where a slope begins. Body frame as in
``cmacexp/models/body.py``. Frame of a hip: x forward, y down, z to the left.
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
"""Signals of the body that are 0 where a run has none of them."""
VISIBLE_DEPRESSION = 0.04
"""A smaller largest depression is drawn deeper than it is, m."""
PLATE = 0.008
"""Half the drawn height of the body of a machine with planar legs, m."""


def count_kept(run: Run) -> dict[int, int]:
    """Steps of each cycle in the trace of a run; raises BadRun if there is none."""
    if kept := count_steps_by_cycle(run.folder):
        return kept
    taken = run.manifest["steps"]
    kept_none = f"its trace kept none of its {taken} steps; run it again without record.cycles"
    raise BadRun(f"{run.folder}: {kept_none if taken else 'the run took no step, there is nothing to show'}")


def read_robot_of_run(run: Run, machine: RobotMachine) -> Robot:
    """The model with which a robot ran, as its config names it; no file of the run's folder is read for it.

    Raises BadInput if MuJoCo or the model is missing, BadRun if the model is not that of the run.
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
    """A run as it is drawn: N steps of L legs."""

    run: Run
    trace: Trace
    """The trace of the steps that are drawn."""
    label: str = ""
    """The name of the run, or the settings that distinguish it from those beside it."""
    root: str = ""
    """Prefix of the paths of its entities in a recording."""
    meshes: bool = False
    """Whether the machine is drawn as the model of the robot shows it, not as links and a box."""

    @property
    def time(self) -> Array:
        """(N,), s."""
        return self.trace.shared("time")

    @property
    def step(self) -> Array:
        """(N,), from 0."""
        return self.trace.shared("step")

    @property
    def cycle(self) -> Array:
        """(N,), from 1."""
        return self.trace.shared("cycle")

    @cached_property
    def clock(self) -> Array:
        """(N,), time since the cycle began, s."""
        return self.time - (self.cycle - 1) * float(self.run.config["gait"]["cycle_time"])

    @cached_property
    def cycles(self) -> list[int]:
        """Numbers of the cycles of which it has a step."""
        return list(np.unique(self.cycle).tolist())

    @cached_property
    def body(self) -> dict[str, Array]:
        """Signals of the body, (N,); of a stand only its constant position and orientation."""
        pose = dict.fromkeys(POSE, np.zeros(self.trace.steps))
        body = self.trace.body
        if body is None:
            return pose | {"height": pose["yaw"] + self.run.config["machine"]["hip_height"]}
        return pose | {name: body[name] for name in body.names}

    @property
    def walks(self) -> bool:
        """Whether there is a body on legs."""
        return self.trace.legs > 1

    @property
    def robot(self) -> Mapping[str, Any]:
        """How a robot, whose legs move in space, is built, as its model says; empty of other machines."""
        return self.run.manifest["robot"] or {}

    @property
    def foot_radius(self) -> float:
        """m: the ground that is seen is so far below the centre of a foot that touches it."""
        return float(self.robot.get("foot_radius", 0.0))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the legs."""
        return LEG_NAMES[: self.trace.legs] if self.walks else ("leg",)

    @property
    def _planar_legs(self) -> list[Mapping[str, Any]]:
        """How each leg that moves in a plane is built, as the config says; empty of a point mass."""
        machine = self.run.config["machine"]
        has_legs = machine["kind"] == "quadruped"
        return [machine["legs"][key] for key in LEG_KEYS] if has_legs else [machine.get("leg") or {}]

    @cached_property
    def hips(self) -> Array:
        """Hips (L, 3) in the body frame, m."""
        planar = [(leg.get("hip_x", 0.0), leg.get("hip_y", 0.0)) for leg in self._planar_legs]
        return np.pad(np.array(self.robot.get("hips", planar)), ((0, 0), (0, 1)))

    @cached_property
    def has_joints(self) -> bool:
        """Whether the machine has legs, and is not a point mass."""
        return bool(self.robot) or "length_1" in self._planar_legs[0]

    def _in_body(self, points: Array) -> Array:
        """Points (N, L, 3) of the frames of the hips in the body frame."""
        return points[..., [0, 2, 1]] * [1.0, 1.0, -1.0] + self.hips

    def feet(self, kind: str = "") -> Array:
        """The feet (N, L, 3) in the body frame, m; ``kind`` ``_desired``: where they should be."""
        points = np.zeros((self.trace.steps, self.trace.legs, 3))
        for n, axis in enumerate(self.trace.axes):
            points[..., n] = self.trace[axis + kind]
        return self._in_body(points)

    @cached_property
    def joints(self) -> Array:
        """Hip, knee and foot, of a robot its three hinges and the foot, (N, L, joints + 1, 3), in the body frame, m.

        Those of a point mass are all at its foot.
        """
        if not self.has_joints:
            return np.stack([self.feet()] * 3, axis=2)
        if self.robot:
            angles, chains = self.trace.stack_joints("q{}"), map(np.array, self.robot["chains"])
            points = np.stack([chain_points(chain, angles[:, n]) for n, chain in enumerate(chains)], axis=1)
            return np.stack([self._in_body(joint) for joint in np.moveaxis(points, 2, 0)], axis=2)
        angle, hip = self.trace["q1"], np.zeros((self.trace.steps, self.trace.legs, 3))
        thighs = np.array([leg["length_1"] for leg in self._planar_legs])
        knee = np.stack([thighs * np.cos(angle), thighs * np.sin(angle), hip[..., 2]], axis=2)
        return np.stack([self._in_body(hip), self._in_body(knee), self.feet()], axis=2)

    def torques(self, joint: int) -> dict[str, Array]:
        """Torques (N, L) of a joint, from 1 on, by their parts, N m; forces along an axis, N, of a point mass.

        Of a robot J^T F_d, which the plan knows, is apart from the feedback.
        """
        feedback, known = self.trace[f"tau_feedback_{joint}"], dict[str, Array]()
        if self.robot:
            known["for the desired force"] = self.trace[f"tau_force_{joint}"]
            feedback = feedback - known["for the desired force"]
        return {**known, "feedback": feedback, "feedforward": self.trace[f"tau_feedforward_{joint}"]}

    @cached_property
    def trunk(self) -> tuple[Array, Array]:
        """Middle and half the size of the box that joins the hips, (3,) each, in the body frame, m."""
        hips = self.joints[0, :, 0] + 0.0  # no negative zero
        half = (hips.max(axis=0) - hips.min(axis=0)) / 2.0
        half[2] = half[1] if self.robot else PLATE  # trunks of robots are about as high as they are wide
        return (hips.max(axis=0) + hips.min(axis=0)) / 2.0, half

    def whole_cycles(self) -> tuple[int, int]:
        """The first cycle and the last whole one; of a run without a whole cycle, its last."""
        return self.cycles[0], (self.run.select_whole(self.cycles) or self.cycles)[-1]

    def turn(self) -> Array:
        """Orientation of the body as quaternions (N, 4), x y z w: roll about x, pitch about y, yaw about z."""
        a, p, r = (self.body[name] / 2.0 for name in ("yaw", "pitch", "roll"))
        x, y, z, w = np.cos(p) * np.sin(r), np.sin(p) * np.cos(r), -np.sin(p) * np.sin(r), np.cos(p) * np.cos(r)
        c, s = np.cos(a), np.sin(a)
        return np.stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z], axis=1)

    def way(self) -> Array:
        """The body in the world (N, 3), m."""
        x = self.body["cog_x"]
        return np.stack([x, self.body["cog_y"], self.body["height"] + self.ground_height(x)], axis=1)

    def in_world(self, points: Array) -> Array:
        """Points (N, ..., 3) of the body frame in the world."""
        each_step = (slice(None), *[None] * (points.ndim - 2))
        turn, way = self.turn()[each_step], self.way()[each_step]
        twice = 2.0 * np.cross(turn[..., :3], points)
        return points + turn[..., 3:] * twice + np.cross(turn[..., :3], twice) + way

    def ground_height(self, x: Array) -> Array:
        """z of the centre of a foot that touches the undepressed ground at ``x`` in the world, m.

        Flat where a config has no slope.
        """
        terrain = self.run.config.get("terrain", {})
        return height_at(terrain.get("slope", 0.0), terrain.get("slope_start", 0.0), x)

    def surface(self, x: Array) -> Array:
        """z of the ground that is seen at ``x`` in the world, m."""
        return self.ground_height(x) - self.foot_radius

    @property
    def depression_scale(self) -> int:
        """How many times deeper than they are depressions are drawn."""
        depth = float(self.trace["force_desired"].max()) / self.run.config["terrain"]["stiffness"]
        return round(VISIBLE_DEPRESSION / depth / 10.0) * 10 if 0.0 < depth < VISIBLE_DEPRESSION / 5.0 else 1
