"""Cycles of one run or of several runs, side by side as a video.

MuJoCo renders a robot from its right side and without perspective, so that paths can be drawn over it.
"""

import copy
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from subprocess import CalledProcessError
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cmacexp.addons.video.meshes import read_shown_model
from cmacexp.data.files import write_atomically
from cmacexp.data.run import Run
from cmacexp.errors import BadRun, CmacexpError, require
from cmacexp.models.robot import Robot, load_mujoco
from cmacexp.recording import palette
from cmacexp.recording.run_view import RunView, count_kept
from cmacexp.report.style import (
    DENT,
    DESIRED,
    GROUND,
    MM,
    STYLE,
    colour,
    draw_machine,
    in_travel,
    joints,
)
from cmacexp.typing import Array

MOST_CYCLES = 3
"""Largest number of cycles side by side."""
FRAME_SIZE = (8.0, 4.5)
"""Width and height of a frame, inches."""
DPI = 100
"""Pixels per inch."""
AXES_LAYOUT = {"left": 0.085, "right": 0.985, "top": 0.94, "bottom": 0.12, "hspace": 0.36, "wspace": 0.12}
"""Position and spacing of the axes in a frame."""
VIDEO_STYLE = STYLE | {"font.size": 11.0, "legend.fontsize": 10.5}
"""Style of a frame, with larger letters than a report: pages show videos at 700 pixels."""
HEIGHTS = (2.2, 1.0, 1.0)
"""Relative heights of the three rows: machine, forces, foot error."""
FRAMES_PER_SECOND = 12.5
"""Frame rate; GIF allows only durations of whole hundredths of a second."""
PATHS = (colour(palette.FIRST_CYCLE), colour(palette.LAST_CYCLE))
"""Colours of the foot paths: the second in the last cycle, the first in all others."""
BORDER = 60.0
"""Border around the machine, mm."""
ROBOT_BORDER = np.array([120.0, 0.0, 120.0])
"""Additional border around the legs of a rendered robot, mm: head and rump extend beyond them."""
PIXELS = 640
"""Width and height of the rendered image, pixels."""
MP4 = ".mp4"
FORMATS = (".gif", ".webp", MP4)
"""File name extensions; the last needs the extra ``video``."""
FROM_THE_RIGHT = 90.0
"""Azimuth of a camera that looks to the left, degrees."""
FAR = 10.0
"""Distance of the camera, m."""


class RobotPicture:
    """Renderer of one robot."""

    def __init__(self, robot: Robot):
        mujoco = load_mujoco()
        self.robot = robot
        self.model = copy.copy(robot.model)
        self.model.vis.global_.offwidth = self.model.vis.global_.offheight = PIXELS
        self.model.vis.headlight.ambient[:], self.model.vis.headlight.diffuse[:] = 0.3, 0.5
        self.data = mujoco.MjData(self.model)
        self.camera: Any = mujoco.MjvCamera()
        self.camera.azimuth, self.camera.elevation, self.camera.distance = FROM_THE_RIGHT, 0.0, FAR
        self.camera.orthographic = 1
        self.renderer: Any = mujoco.Renderer(self.model, PIXELS, PIXELS)

    def draw(self, q: Array, position: Array, attitude: Array, centre: Array, extent: float) -> NDArray[Any]:
        """Render the robot as an image (PIXELS, PIXELS, 4): red, green, blue and opacity from 0 to 255.

        Args:
            q: (4, 3), joint angles, rad.
            position: (3,), origin of the trunk, m.
            attitude: (4,), quaternion x y z w of the trunk.
            centre: (3,), point at the centre of the image, m.
            extent: height and width of the image, m.
        """
        legs = self.robot.legs
        self.data.qpos[legs.base_qpos : legs.base_qpos + 7] = [*position, *np.roll(attitude, 1)]
        self.data.qpos[legs.qpos] = q
        load_mujoco().mj_forward(self.model, self.data)
        self.model.vis.global_.fovy = extent
        self.camera.lookat[:] = centre
        self.renderer.update_scene(self.data, self.camera)
        colours = self.renderer.render()
        self.renderer.enable_segmentation_rendering()
        is_robot = self.renderer.render()[..., :1] >= 0
        self.renderer.disable_segmentation_rendering()
        return np.concatenate([colours, np.where(is_robot, 255, 0).astype(np.uint8)], axis=2)


def render_robot(run: Run) -> RobotPicture:
    """Make the renderer of the robot of a run; it needs no screen if OpenGL supports that.

    Raises BadInput or BadRun if the model of the run is missing, CmacexpError if MuJoCo cannot render here.
    """
    if sys.platform == "linux":
        os.environ.setdefault("MUJOCO_GL", "egl")  # must be set before MuJoCo is imported
    try:
        return RobotPicture(read_shown_model(run))
    except CmacexpError:
        raise
    except Exception as error:  # OpenGL raises errors of many classes
        reason = f"MuJoCo cannot draw here ({type(error).__name__}: {error}); set MUJOCO_GL=egl or osmesa"
        raise CmacexpError(reason) from error


class Cycle(NamedTuple):
    """One cycle of a run and its style."""

    view: RunView
    joints: Array
    """Positions of joints and foot of each leg, (steps, legs, joints + 1, 3), mm."""
    desired: Array
    """Desired positions of the feet, (steps, legs, 3), mm."""
    ink: str
    """Colour of the actual paths, forces and errors."""
    title: str
    picture: RobotPicture | None
    """Renderer of the robot; None: legs are drawn as lines."""


def _find_window(cycles: Sequence[Cycle]) -> tuple[Array, Array]:
    """Find lower and upper bounds (3,) of the machines and desired paths of all cycles, mm."""
    drawn = np.concatenate([points.reshape(-1, 3) for c in cycles for points in (c.joints, c.desired)])
    border = BORDER + ROBOT_BORDER * any(c.picture is not None for c in cycles)
    low, high = drawn.min(axis=0) - border, drawn.max(axis=0) + border
    low[2] = min(drawn[:, 2].min(), -40.0) - BORDER
    return low, high


def _render(axes: Axes, view: RunView, picture: RobotPicture, k: int, window: tuple[Array, Array]) -> None:
    """Render the robot at step ``k`` in a square around the ``window``, mm."""
    centre = np.mean(window, axis=0)
    half = float(np.ptp(window, axis=0).max()) / 2.0
    offset = view.joints[0, 0, 0] - picture.robot.hinges[0, 0, :3]  # from the body's frame to the trunk's
    position = in_travel(view, np.tile(offset, (view.trace.steps, 1)))[k] / MM
    image = picture.draw(
        view.trace.stack_joints("q{}")[k], position, view.compute_orientation()[k], centre / MM, 2.0 * half / MM
    )
    extent = (centre[0] - half, centre[0] + half, centre[2] - half, centre[2] + half)
    axes.imshow(image, extent=extent, zorder=4, interpolation="lanczos")


def _draw_side(axes: Axes, cycle: Cycle, k: int, window: tuple[Array, Array]) -> None:
    """Draw the machine from its right side at step ``k``, with desired foot paths and the actual ones so far."""
    view = cycle.view
    if cycle.picture is None:
        draw_machine(axes, cycle.joints[k][..., [0, 2]], view.hips[:, 1] <= 0.0, ~view.trace.support[k])
    else:
        _render(axes, view, cycle.picture, k, window)
    surface = -MM * view.foot_radius
    depression = MM * view.depression_scale / float(view.run.config["terrain"]["stiffness"])
    for i in range(view.trace.legs):
        x, y = cycle.joints[k, i, -1, 0], surface - depression * view.trace["force"][k, i]
        axes.fill([x - DENT, x, x + DENT], [surface, y, surface], color=GROUND, lw=0.0, zorder=3)
        axes.plot(*cycle.desired[:, i, [0, 2]].T, color=DESIRED, lw=1.0, zorder=5)
        axes.plot(*cycle.joints[: k + 1, i, -1][:, [0, 2]].T, color=cycle.ink, lw=1.6, zorder=6)
    axes.axhline(surface, color=GROUND, lw=1.2, zorder=1)
    axes.axis("off")
    axes.set(aspect="equal", xlim=(window[0][0], window[1][0]), ylim=(window[0][2], window[1][2]))
    axes.text(0.0, -0.1, "grey: desired foot paths", color=DESIRED, transform=axes.transAxes)
    axes.set_title(cycle.title, color=cycle.ink, fontsize=13.0, loc="center")


def _draw_forces(axes: Axes, cycle: Cycle, k: int) -> None:
    """Draw actual and desired foot forces at step ``k`` as bars, like the foot force display of the paper."""
    view = cycle.view
    feet = np.arange(view.trace.legs)
    axes.bar(feet - 0.2, view.trace["force"][k], 0.4, color=cycle.ink, label="actual")
    axes.bar(feet + 0.2, view.trace["force_desired"][k], 0.4, fc="white", ec=DESIRED, hatch="////", label="desired")
    names = ["".join(word[0].upper() for word in name.split()) if view.walks else name for name in view.names]
    axes.set_xticks(feet, names)


def _draw_error(axes: Axes, cycle: Cycle, k: int) -> None:
    """Draw the largest foot error over the cycle, pale, and up to step ``k`` in full colour."""
    time = cycle.view.time - cycle.view.time[0]
    error = np.linalg.norm(cycle.joints[:, :, -1] - cycle.desired, axis=2).max(axis=1)
    axes.plot(time, error, color=cycle.ink, lw=1.0, alpha=0.3)
    axes.plot(time[: k + 1], error[: k + 1], color=cycle.ink, lw=1.4)
    axes.set(xlim=(0.0, time[-1]), xlabel="time in the cycle, s")


def draw_frame(figure: Figure, cycles: Sequence[Cycle], window: tuple[Array, Array], progress: float) -> None:
    """Draw one frame of the video.

    Args:
        figure: cleared, then drawn on.
        cycles: cycles side by side.
        window: lower and upper bounds (3,) of the drawing of the machines, mm.
        progress: elapsed fraction of the cycle, from 0 to 1.
    """
    figure.clear()
    axes = figure.subplots(
        3, len(cycles), sharey="row", height_ratios=HEIGHTS, squeeze=False, gridspec_kw=AXES_LAYOUT
    )
    for column, cycle in zip(axes.T, cycles, strict=True):
        elapsed = cycle.view.time - cycle.view.time[0]
        k = int(np.abs(elapsed - progress * elapsed[-1]).argmin())  # rows of a thinned trace may be unevenly spaced
        _draw_side(column[0], cycle, k, window)
        _draw_forces(column[1], cycle, k)
        _draw_error(column[2], cycle, k)
    most = max(float(c.view.trace[name].max()) for c in cycles for name in ("force", "force_desired"))
    axes[1, 0].set(ylabel="force, N", ylim=(0.0, 1.5 * most))
    axes[1, -1].legend(loc="upper right", ncols=2, borderaxespad=0.0)
    axes[2, 0].set(ylabel="foot error, mm", ylim=(0.0, None))


def view_cycles(run: Run, numbers: Sequence[int]) -> list[RunView]:
    """Make a view of each of the cycles ``numbers``, by default of the first and the last whole cycle.

    Raises:
        BadInput: a cycle is not whole in the trace, or there are too many.
        BadRun: the trace has no whole cycle.
    """
    whole = run.select_whole(sorted(count_kept(run)))
    BadRun.unless(whole, f"{run.folder}: its trace has no whole cycle, there is nothing to show")
    cycles = sorted(set(numbers) or {whole[0], whole[-1]})
    require(
        len(cycles) <= MOST_CYCLES and set(cycles) <= set(whole),
        "--cycles",
        ",".join(map(str, numbers)),
        f"write up to {MOST_CYCLES} whole cycles",
    )
    return [RunView(run, run.read_trace([cycle])) for cycle in cycles]


def write_video(
    views: Sequence[RunView],
    path: Path,
    titles: Sequence[str] = (),
    pictures: Sequence[RobotPicture | None] = (),
) -> int:
    """Write cycles side by side as a video that repeats the cycle in real time.

    Args:
        views: one view per cycle.
        path: output file, with an extension in FORMATS.
        titles: title of each cycle; empty: the numbers of the cycles.
        pictures: renderer of the robot of each cycle, None for lines; empty: all machines are drawn as lines.

    Returns:
        Number of frames.
    """
    titles = titles or [f"cycle {view.cycle[0]}" for view in views]
    pictures = pictures or [None] * len(views)
    inks = [PATHS[0]] * (len(views) - 1) + [PATHS[1]]
    cycles = [
        Cycle(view, joints(view), in_travel(view, view.feet("_desired")), ink, title, picture)
        for view, ink, title, picture in zip(views, inks, titles, pictures, strict=True)
    ]
    window = _find_window(cycles)
    count = max(2, round(max(float(view.time[-1] - view.time[0]) for view in views) * FRAMES_PER_SECOND))
    matplotlib.rcParams.update(VIDEO_STYLE)
    figure = Figure(figsize=FRAME_SIZE)
    writer = _make_writer(path.suffix)
    with TemporaryDirectory() as folder, write_atomically(path) as temporary:
        video = Path(folder, f"video{path.suffix}")  # writers choose the format by the extension
        try:
            with writer.saving(figure, str(video), DPI):
                for progress in np.linspace(0.0, 1.0, count):
                    draw_frame(figure, cycles, window, progress)
                    writer.grab_frame()
        except CalledProcessError as error:
            raise ChildProcessError(f"the encoder failed: {error}") from error
        shutil.copyfile(video, temporary)
    return count


def _make_writer(suffix: str) -> AbstractMovieWriter:
    """Make the writer of frames for a file name extension; MP4 uses the encoder of the extra ``video``."""
    if suffix != MP4:
        return PillowWriter(FRAMES_PER_SECOND)  # type: ignore[arg-type]  # annotated as int, accepts any number
    import imageio_ffmpeg

    matplotlib.rcParams["animation.ffmpeg_path"] = imageio_ffmpeg.get_ffmpeg_exe()
    return FFMpegWriter(FRAMES_PER_SECOND)  # type: ignore[arg-type]
