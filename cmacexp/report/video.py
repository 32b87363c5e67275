"""Cycles of one run, or several runs, side by side as a moving picture.

A robot appears as MuJoCo renders its model, from its right side and without perspective, so that lines fit over it.
"""

import copy
import importlib
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from cmacexp.data.files import write_atomically
from cmacexp.data.run import Run
from cmacexp.data.trace import count_steps_by_cycle
from cmacexp.errors import BadInput, BadRun, CmacexpError
from cmacexp.models.robot import Robot, load_mujoco
from cmacexp.recording import palette
from cmacexp.recording.run_view import RunView
from cmacexp.report.figures import Panel, Series, draw_panel
from cmacexp.report.style import (
    DENT,
    DESIRED,
    GROUND,
    MM,
    NEAR,
    NEAR_SIDE,
    STYLE,
    colour,
    draw_leg,
    in_travel,
    joints,
)
from cmacexp.typing import Array

MOST_CYCLES = 3
"""More side by side are too narrow."""
WIDTH, HEIGHT, DPI = 8.0, 4.5, 100
"""Of a frame, inches and pixels per inch."""
FRAMES_PER_SECOND = 12.5
"""Frames of GIF last whole hundredths of a second."""
COLOURS = 128
"""Of the palette that all frames share."""
PATHS = (colour(palette.FIRST_CYCLE), colour(palette.LAST_CYCLE))
"""Of the foot's path: in the last of the cycles the second, in the others the first."""
HATCHED = {"fc": "white", "ec": DESIRED, "hatch": "////"}
SOLID = {"linestyle": "-", "linewidth": 1.4, "marker": None}
BORDER = 60.0
"""Around the machine, mm."""
BODY_THICKNESS = 24.0
"""Drawn thickness of the body, mm."""
PIXELS = 640
"""Width of a rendered robot."""
MP4 = ".mp4"
FORMATS = (".gif", ".webp", MP4)
"""Endings of the file; the last needs the extra ``video``."""
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


class Cycle(NamedTuple):
    """One cycle of a run, as it is drawn."""

    view: RunView
    places: Array
    """Joints and foot of each leg, (steps, legs, joints + 1, 3), mm."""
    desired: Array
    """Where the feet should be, (steps, legs, 3), mm."""
    ink: str
    title: str
    picture: RobotPicture | None = None
    """Of a robot as its model shows it; None: drawn as lines."""

    @property
    def error(self) -> Array:
        """Distance of the feet from where they should be, of the farthest one, (steps,), mm."""
        return np.asarray(np.linalg.norm(self.places[:, :, -1] - self.desired, axis=2).max(axis=1))


def _find_window(cycles: Sequence[Cycle], rendered: bool) -> tuple[Array, Array]:
    """Lower and upper bounds (3,) of all that is drawn of the machines, mm."""
    drawn = np.concatenate([points.reshape(-1, 3) for c in cycles for points in (c.places, c.desired)])
    low, high = drawn.min(axis=0) - BORDER, drawn.max(axis=0) + BORDER
    low[2] = min(low[2], -40.0 - BORDER)
    if rendered:  # heads and rumps stand out of the legs
        low[0], high[[0, 2]] = low[0] - 2.0 * BORDER, high[[0, 2]] + 2.0 * BORDER
    return low, high


def _render(axes: Axes, view: RunView, picture: RobotPicture, k: int, window: tuple[Array, Array]) -> None:
    """The robot in step ``k`` as its model shows it, within the ``window``, mm."""
    low, high = window
    middle, tall = (low + high) / 2.0 / MM, (high[2] - low[2]) / MM
    offset = view.joints[0, 0, 0] - picture.robot.hinges[0, 0, :3]  # of the trunk's frame from the body's
    place = in_travel(view, np.tile(offset, (view.trace.steps, 1)))[k] / MM
    image = picture.draw(view.trace.stack_joints("q{}")[k], place, view.turn()[k], middle, tall)
    axes.imshow(image, extent=(low[0], high[0], low[2], high[2]), zorder=4, interpolation="lanczos")


def _draw_legs(axes: Axes, cycle: Cycle, k: int) -> None:
    """The machine in step ``k`` as lines."""
    view, places = cycle.view, cycle.places
    for i in range(view.trace.legs):
        is_near = i + 1 in NEAR_SIDE or view.hips[i, 1] == 0.0
        draw_leg(axes, places[k, i][:, [0, 2]], is_near, not view.trace.support[k, i])
    if view.walks:
        hips = places[k][:, 0, [0, 2]]
        ends = hips[[hips[:, 0].argmin(), hips[:, 0].argmax()]] + [0.0, BODY_THICKNESS / 2.0]
        for ink, width in ((NEAR, 9.0), (colour(palette.BODY_COLOR), 7.0)):
            axes.plot(*ends.T, color=ink, lw=width, solid_capstyle="round", zorder=3.5)


def _draw_machine(axes: Axes, cycle: Cycle, k: int, window: tuple[Array, Array]) -> None:
    """The machine from its right side in step ``k``; each foot's desired path, and its own up to now."""
    view, places = cycle.view, cycle.places
    if cycle.picture is None:
        _draw_legs(axes, cycle, k)
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
    axes.set(aspect="equal", xticks=[], yticks=[])
    axes.axis("off")
    axes.text(0.0, -0.1, "grey: desired foot paths", color=DESIRED, transform=axes.transAxes)
    axes.set_title(cycle.title, color=cycle.ink, fontsize=12.0, loc="center")


def _make_panels(cycle: Cycle, k: int) -> Iterator[Panel]:
    """The paper's foot force display, actual beside desired; the path error of a walk in this cycle, up to now."""
    view, places = cycle.view, np.arange(cycle.view.trace.legs)
    forces = [
        Series("actual", places, view.trace["force"][k], style={"color": cycle.ink}),
        Series("desired", places, view.trace["force_desired"][k], style=HATCHED),
    ]
    names = ["".join(word[0].upper() for word in name.split()) if view.walks else name for name in view.names]
    yield Panel("", "", "force, N", forces, "bars", ticks=names)
    if view.walks:
        time = view.time - view.time[0]
        error = [Series("", time[: k + 1], cycle.error[: k + 1], style=SOLID | {"color": cycle.ink})]
        x_range = (0.0, float(time[-1]))
        yield Panel("", "time in the cycle, s", "foot error, mm", error, x_limits=[time[k]], x_range=x_range)


def _set_limits(axes: NDArray[Any], cycles: Sequence[Cycle], window: tuple[Array, Array]) -> None:
    """Give the axes of all cycles, a row each of machines, forces and path errors, ranges that hold every frame."""
    force = max(float(c.view.trace[name].max()) for c in cycles for name in ("force", "force_desired"))
    error = max(float(cycle.error.max()) for cycle in cycles)
    (left, _, bottom), (right, _, top) = window
    for column in axes.T:
        column[0].set(xlim=(left, right), ylim=(bottom, top))
        for ax, most in zip(column[1:], (1.5 * force, 1.1 * error or 1.0), strict=False):
            ax.set_ylim(0.0, most)


def draw_frame(cycles: Sequence[Cycle], window: tuple[Array, Array], part: float) -> Image.Image:
    """A frame of the picture.

    Args:
        cycles: side by side.
        window: bounds (3,) of what is drawn of the machines, mm.
        part: of the cycle that has passed, from 0 to 1.
    """
    matplotlib.rcParams.update(STYLE)
    heights = [2.2, 1.0, 1.0] if cycles[0].view.walks else [2.7, 1.0]
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=DPI)
    place = {"left": 0.075, "right": 0.985, "top": 0.94, "bottom": 0.1, "hspace": 0.3, "wspace": 0.1}
    axes = figure.subplots(len(heights), len(cycles), height_ratios=heights, squeeze=False, gridspec_kw=place)
    for column, cycle in enumerate(cycles):
        since = cycle.view.time - cycle.view.time[0]
        k = int(np.abs(since - part * since[-1]).argmin())  # rows of a thinned trace need not be evenly spaced
        _draw_machine(axes[0, column], cycle, k, window)
        for ax, panel in zip(axes[1:, column], _make_panels(cycle, k), strict=True):
            draw_panel(ax, panel, [series.name for series in panel.series])
            ax.set(xlabel=panel.x, ylabel="" if column else panel.y)
            ax.tick_params(labelleft=column == 0)
        if column == len(cycles) - 1:
            axes[1, column].legend(loc="upper right", ncols=2, borderaxespad=0.0)
    _set_limits(axes, cycles, window)
    memory = BytesIO()
    figure.savefig(memory, format="png", dpi=DPI)
    return Image.open(memory).convert("RGB")


def view_cycles(run: Run, asked: Sequence[int]) -> list[RunView]:
    """A view of each cycle that is asked for; of the first and the last whole one if none is.

    Raises:
        BadInput: the trace does not have them whole, or they are too many.
        BadRun: the trace has no whole cycle.
    """
    whole = run.select_whole(sorted(count_steps_by_cycle(run.folder)))
    if not whole:
        raise BadRun(f"{run.folder}: its trace has no whole cycle, there is nothing to show")
    cycles = sorted(set(asked) or {whole[0], whole[-1]})
    if len(cycles) > MOST_CYCLES or not set(cycles) <= set(whole):
        raise BadInput("--cycles", ",".join(map(str, asked)), f"write up to {MOST_CYCLES} whole cycles")
    return [RunView(run, run.read_trace([cycle])) for cycle in cycles]


def write_video(
    views: Sequence[RunView], path: Path, titles: Sequence[str] = (), robots: Sequence[Robot | None] = ()
) -> int:
    """Write cycles side by side as a moving picture that plays one cycle in its own time, again and again.

    Args:
        views: one cycle each.
        path: of the file, whose ending is one of FORMATS.
        titles: one above each cycle; empty: the numbers of the cycles.
        robots: the model that each cycle shows, None for lines; empty: all machines are drawn as lines.

    Returns:
        The number of frames.

    Raises:
        CmacexpError: MuJoCo cannot draw here.
    """
    shown = titles or [f"cycle {view.cycle[0]}" for view in views]
    inks = [PATHS[0]] * (len(views) - 1) + [PATHS[1]]
    cycles = [
        Cycle(view, joints(view), in_travel(view, view.feet("_desired")), ink, title)
        for view, ink, title in zip(views, inks, shown, strict=True)
    ]
    low, high = window = _find_window(cycles, rendered=any(robots))
    size = PIXELS, round(PIXELS * float((high - low)[2] / (high - low)[0]))
    with ExitStack() as pictures:
        for number, robot in enumerate(robots):
            if robot is not None:
                picture = pictures.enter_context(closing(RobotPicture(robot, *size)))
                cycles[number] = cycles[number]._replace(picture=picture)
        seconds = max(float(view.time[-1] - view.time[0]) for view in views)
        count = max(2, round(seconds * FRAMES_PER_SECOND))
        frames = [draw_frame(cycles, window, number / (count - 1)) for number in range(count)]
    with write_atomically(path) as temporary:
        _write_mp4(frames, temporary) if path.suffix == MP4 else _write_picture(frames, temporary, path.suffix)
    return count


def _write_picture(frames: Sequence[Image.Image], path: Path, suffix: str) -> None:
    """Frames as GIF, with one palette for all, or as WebP."""
    options: dict[str, Any] = {"quality": 80}
    if suffix == ".gif":
        colours, options = frames[len(frames) // 2].quantize(COLOURS), {}
        frames = [frame.quantize(palette=colours, dither=Image.Dither.NONE) for frame in frames]
    duration = 1000 / FRAMES_PER_SECOND
    frames[0].save(path, suffix[1:], save_all=True, append_images=frames[1:], duration=duration, loop=0, **options)


def _write_mp4(frames: Sequence[Image.Image], path: Path) -> None:
    """Frames as MP4, by an encoder that an extra has."""
    import imageio_ffmpeg

    size, options = frames[0].size, {"macro_block_size": 2, "output_params": ["-f", "mp4"]}
    writer = imageio_ffmpeg.write_frames(path, size, fps=FRAMES_PER_SECOND, **options)
    writer.send(None)
    for frame in frames:
        writer.send(frame.tobytes())
    writer.close()
