"""A robot as MuJoCo renders its model, from its right side and without perspective, so that lines fit over it."""

import copy
import importlib
import os
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmacexp.errors import CmacexpError
from cmacexp.models.robot import Robot, load_mujoco
from cmacexp.typing import Array

FROM_THE_RIGHT = 90.0
"""Azimuth of a camera that looks to the left, degrees."""
FAR = 10.0
"""Distance of the camera, m."""


def require_rendering() -> None:
    """Import MuJoCo so that it draws without a screen where it can; raises CmacexpError if it is not able to draw."""
    if sys.platform == "linux":
        os.environ.setdefault("MUJOCO_GL", "egl")  # read when MuJoCo is imported, which fails without that library
    try:
        importlib.import_module("mujoco")
    except Exception as error:  # whatever the OpenGL of this machine raises
        raise _explain(error) from error


def _explain(error: Exception) -> CmacexpError:
    return CmacexpError(f"MuJoCo cannot draw here ({type(error).__name__}: {error}); set MUJOCO_GL=egl or osmesa")


class RobotPicture:
    """Renders one robot, without a screen where OpenGL can do that; raises CmacexpError if it cannot."""

    def __init__(self, robot: Robot, width: int, height: int):
        mujoco = load_mujoco()
        self.robot = robot
        self.model = copy.copy(robot.model)
        self.model.vis.global_.offwidth, self.model.vis.global_.offheight = width, height
        self.model.vis.headlight.ambient[:], self.model.vis.headlight.diffuse[:] = 0.3, 0.5
        self.data = mujoco.MjData(self.model)
        self.camera: Any = mujoco.MjvCamera()
        self.camera.azimuth, self.camera.elevation, self.camera.distance = FROM_THE_RIGHT, 0.0, FAR
        self.camera.orthographic = 1
        try:
            self.renderer: Any = mujoco.Renderer(self.model, height, width)
        except Exception as error:  # whatever the OpenGL of this machine raises
            raise _explain(error) from error

    def draw(self, q: Array, place: Array, turn: Array, middle: Array, high: float) -> NDArray[Any]:
        """The picture (height, width, 4) of the robot, red, green, blue and opacity from 0 to 255.

        Args:
            q: (4, 3), joint angles, rad.
            place: (3,), of the trunk's frame, m.
            turn: (4,), of the trunk, a quaternion x y z w.
            middle: (3,), of the picture, m.
            high: how high it is, m.
        """
        legs, mujoco = self.robot.legs, load_mujoco()
        self.data.qpos[legs.base_qpos : legs.base_qpos + 7] = [*place, *np.roll(turn, 1)]
        self.data.qpos[legs.qpos] = q
        mujoco.mj_forward(self.model, self.data)
        self.model.vis.global_.fovy = high
        self.camera.lookat[:] = middle
        self.renderer.update_scene(self.data, self.camera)
        colours = self.renderer.render()
        self.renderer.enable_segmentation_rendering()
        seen = self.renderer.render()[..., :1] >= 0
        self.renderer.disable_segmentation_rendering()
        return np.concatenate([colours, np.where(seen, 255, 0).astype(np.uint8)], axis=2)

    def close(self) -> None:
        """Free what OpenGL holds."""
        self.renderer.close()
