"""Cycles of one run, or several runs, side by side as a moving picture.

A robot appears as MuJoCo renders its model, from its right side and without perspective, so that lines fit over it.
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
"""More side by side are too narrow."""
WIDTH, HEIGHT, DPI = 8.0, 4.5, 100
"""Size of a frame, inches, and its pixels per inch."""
PLACE = {"left": 0.075, "right": 0.985, "top": 0.94, "bottom": 0.1, "hspace": 0.3, "wspace": 0.1}
"""Where the axes are in a frame."""
HEIGHTS = (2.2, 1.0, 1.0)
"""Heights of the machine, the forces and the error of the feet above each other."""
FRAMES_PER_SECOND = 12.5
"""Frames of GIF last whole hundredths of a second."""
PATHS = (colour(palette.FIRST_CYCLE), colour(palette.LAST_CYCLE))
"""Colours of the foot's path: in the last of the cycles the second, in the others the first."""
BORDER = 60.0
"""Around the machine, mm."""
ROBOT_BORDER = np.array([120.0, 0.0, 120.0])
"""Around the legs of a robot that is rendered, mm: its head and rump stand out of them."""
PIXELS = 640
"""Width and height of a rendered robot."""
MP4 = ".mp4"
FORMATS = (".gif", ".webp", MP4)
"""Endings of the file; the last needs the extra ``video``."""
FROM_THE_RIGHT = 90.0
"""Azimuth of a camera that looks to the left, degrees."""
FAR = 10.0
"""Distance of the camera, m."""


class RobotPicture:
    """Renders one robot."""

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

    def draw(self, q: Array, place: Array, turn: Array, middle: Array, high: float) -> NDArray[Any]:
        """The picture (PIXELS, PIXELS, 4) of the robot, red, green, blue and opacity from 0 to 255.

        Args:
            q: (4, 3), joint angles, rad.
            place: (3,), of the trunk's frame, m.
            turn: (4,), of the trunk, a quaternion x y z w.
            middle: (3,), of the picture, m.
            high: how high and wide it is, m.
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


def render_robot(run: Run) -> RobotPicture:
    """What renders the robot of a run, without a screen where OpenGL can do that.

    Raises BadInput or BadRun if the run's model is not there, CmacexpError if MuJoCo cannot draw here.
    """
    if sys.platform == "linux":
        os.environ.setdefault("MUJOCO_GL", "egl")  # read when MuJoCo is imported, which fails without that library
    try:
        return RobotPicture(read_shown_model(run))
    except CmacexpError:
        raise
    except Exception as error:  # whatever the OpenGL of this machine raises
        reason = f"MuJoCo cannot draw here ({type(error).__name__}: {error}); set MUJOCO_GL=egl or osmesa"
        raise CmacexpError(reason) from error


class Cycle(NamedTuple):
    """One cycle of a run, as it is drawn."""

    view: RunView
    places: Array
    """Joints and foot of each leg, (steps, legs, joints + 1, 3), mm."""
    desired: Array
    """Where the feet should be, (steps, legs, 3), mm."""
    ink: str
    title: str
    picture: RobotPicture | None
    """The robot as its model shows it; None: it is drawn as lines."""


def _find_window(cycles: Sequence[Cycle]) -> tuple[Array, Array]:
    """Lower and upper bounds (3,) of all that is drawn of the machines, mm."""
    drawn = np.concatenate([points.reshape(-1, 3) for c in cycles for points in (c.places, c.desired)])
    border = BORDER + ROBOT_BORDER * any(c.picture is not None for c in cycles)
    low, high = drawn.min(axis=0) - border, drawn.max(axis=0) + border
    low[2] = min(drawn[:, 2].min(), -40.0) - BORDER
    return low, high


def _render(axes: Axes, view: RunView, picture: RobotPicture, k: int, window: tuple[Array, Array]) -> None:
    """The robot in step ``k`` as its model shows it, in a square about the ``window``, mm."""
    middle, half = np.mean(window, axis=0), float(np.ptp(window, axis=0).max()) / 2.0
    offset = view.joints[0, 0, 0] - picture.robot.hinges[0, 0, :3]  # of the trunk's frame from the body's
    place = in_travel(view, np.tile(offset, (view.trace.steps, 1)))[k] / MM
    image = picture.draw(
        view.trace.stack_joints("q{}")[k], place, view.compute_orientation()[k], middle / MM, 2.0 * half / MM
    )
    extent = (middle[0] - half, middle[0] + half, middle[2] - half, middle[2] + half)
    axes.imshow(image, extent=extent, zorder=4, interpolation="lanczos")


def _draw_side(axes: Axes, cycle: Cycle, k: int, window: tuple[Array, Array]) -> None:
    """The machine from its right side in step ``k``; each foot's desired path, and its own up to now."""
    view, places = cycle.view, cycle.places
    if cycle.picture is None:
        draw_machine(axes, places[k][..., [0, 2]], view.hips[:, 1] <= 0.0, ~view.trace.support[k])
    else:
        _render(axes, view, cycle.picture, k, window)
    surface = -MM * view.foot_radius
    depression = MM * view.depression_scale / float(view.run.config["terrain"]["stiffness"])
    for i in range(view.trace.legs):
        x, deep = places[k, i, -1, 0], surface - depression * view.trace["force"][k, i]
        axes.fill([x - DENT, x, x + DENT], [surface, deep, surface], color=GROUND, lw=0.0, zorder=3)
        axes.plot(*cycle.desired[:, i, [0, 2]].T, color=DESIRED, lw=1.0, zorder=5)
        axes.plot(*places[: k + 1, i, -1][:, [0, 2]].T, color=cycle.ink, lw=1.6, zorder=6)
    axes.axhline(surface, color=GROUND, lw=1.2, zorder=1)
    axes.axis("off")
    axes.set(aspect="equal", xlim=(window[0][0], window[1][0]), ylim=(window[0][2], window[1][2]))
    axes.text(0.0, -0.1, "grey: desired foot paths", color=DESIRED, transform=axes.transAxes)
    axes.set_title(cycle.title, color=cycle.ink, fontsize=12.0, loc="center")


def _draw_forces(axes: Axes, cycle: Cycle, k: int) -> None:
    """The paper's foot force display in step ``k``: actual beside desired."""
    view, feet = cycle.view, np.arange(cycle.view.trace.legs)
    axes.bar(feet - 0.2, view.trace["force"][k], 0.4, color=cycle.ink, label="actual")
    axes.bar(feet + 0.2, view.trace["force_desired"][k], 0.4, fc="white", ec=DESIRED, hatch="////", label="desired")
    names = ["".join(word[0].upper() for word in name.split()) if view.walks else name for name in view.names]
    axes.set_xticks(feet, names)


def _draw_error(axes: Axes, cycle: Cycle, k: int) -> None:
    """How far the farthest foot is from where it should be, pale in the cycle, and in colour up to now."""
    time = cycle.view.time - cycle.view.time[0]
    error = np.linalg.norm(cycle.places[:, :, -1] - cycle.desired, axis=2).max(axis=1)
    axes.plot(time, error, color=cycle.ink, lw=1.0, alpha=0.3)
    axes.plot(time[: k + 1], error[: k + 1], color=cycle.ink, lw=1.4)
    axes.set(xlim=(0.0, time[-1]), xlabel="time in the cycle, s")


def draw_frame(figure: Figure, cycles: Sequence[Cycle], window: tuple[Array, Array], part: float) -> None:
    """Draw a frame of the picture.

    Args:
        figure: what is drawn on anew.
        cycles: side by side.
        window: bounds (3,) of what is drawn of the machines, mm.
        part: of the cycle that has passed, from 0 to 1.
    """
    figure.clear()
    axes = figure.subplots(3, len(cycles), sharey="row", height_ratios=HEIGHTS, squeeze=False, gridspec_kw=PLACE)
    for column, cycle in zip(axes.T, cycles, strict=True):
        since = cycle.view.time - cycle.view.time[0]
        k = int(np.abs(since - part * since[-1]).argmin())  # rows of a thinned trace need not be evenly spaced
        _draw_side(column[0], cycle, k, window)
        _draw_forces(column[1], cycle, k)
        _draw_error(column[2], cycle, k)
    most = max(float(c.view.trace[name].max()) for c in cycles for name in ("force", "force_desired"))
    axes[1, 0].set(ylabel="force, N", ylim=(0.0, 1.5 * most))
    axes[1, -1].legend(loc="upper right", ncols=2, borderaxespad=0.0)
    axes[2, 0].set(ylabel="foot error, mm", ylim=(0.0, None))


def view_cycles(run: Run, asked: Sequence[int]) -> list[RunView]:
    """A view of each cycle that is asked for; of the first and the last whole one if none is.

    Raises:
        BadInput: the trace does not have them whole, or they are too many.
        BadRun: the trace has no whole cycle.
    """
    whole = run.select_whole(sorted(count_kept(run)))
    BadRun.unless(whole, f"{run.folder}: its trace has no whole cycle, there is nothing to show")
    cycles = sorted(set(asked) or {whole[0], whole[-1]})
    require(
        len(cycles) <= MOST_CYCLES and set(cycles) <= set(whole),
        "--cycles",
        ",".join(map(str, asked)),
        f"write up to {MOST_CYCLES} whole cycles",
    )
    return [RunView(run, run.read_trace([cycle])) for cycle in cycles]


def write_video(
    views: Sequence[RunView],
    path: Path,
    titles: Sequence[str] = (),
    pictures: Sequence[RobotPicture | None] = (),
) -> int:
    """Write cycles side by side as a moving picture that plays one cycle in its own time, again and again.

    Args:
        views: one cycle each.
        path: of the file, whose ending is one of FORMATS.
        titles: one above each cycle; empty: the numbers of the cycles.
        pictures: what renders the robot of each cycle, None for lines; empty: all machines are drawn as lines.

    Returns:
        The number of frames.
    """
    titles = titles or [f"cycle {view.cycle[0]}" for view in views]
    pictures = pictures or [None] * len(views)
    inks = [PATHS[0]] * (len(views) - 1) + [PATHS[1]]
    cycles = [
        Cycle(view, joints(view), in_travel(view, view.feet("_desired")), ink, title, picture)
        for view, ink, title, picture in zip(views, inks, titles, pictures, strict=True)
    ]
    window = _find_window(cycles)
    seconds = max(float(view.time[-1] - view.time[0]) for view in views)
    count = max(2, round(seconds * FRAMES_PER_SECOND))
    matplotlib.rcParams.update(STYLE)
    figure, writer = Figure(figsize=(WIDTH, HEIGHT)), _make_writer(path.suffix)
    with TemporaryDirectory() as folder, write_atomically(path) as temporary:
        made = Path(folder, f"video{path.suffix}")  # writers choose the format by the ending
        try:
            with writer.saving(figure, str(made), DPI):
                for part in np.linspace(0.0, 1.0, count):
                    draw_frame(figure, cycles, window, part)
                    writer.grab_frame()
        except CalledProcessError as error:
            raise ChildProcessError(f"the encoder failed: {error}") from error
        shutil.copyfile(made, temporary)
    return count


def _make_writer(suffix: str) -> AbstractMovieWriter:
    """What writes frames to a file with this ending; the encoder of MP4 is that of the extra."""
    if suffix != MP4:
        return PillowWriter(FRAMES_PER_SECOND)  # type: ignore[arg-type]  # typed as an integer; any number will do
    import imageio_ffmpeg

    matplotlib.rcParams["animation.ffmpeg_path"] = imageio_ffmpeg.get_ffmpeg_exe()
    return FFMpegWriter(FRAMES_PER_SECOND)  # type: ignore[arg-type]
