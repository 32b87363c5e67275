"""A moving picture of a run: some of its cycles side by side, each with foot paths, forces and tilt."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cmacexp.data.files import open_file
from cmacexp.data.folder import write_atomically
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import read_traces, steps_by_cycle
from cmacexp.errors import BadInput, BadRun
from cmacexp.recording import palette
from cmacexp.recording.ground import depression_scale
from cmacexp.recording.run_view import RunView, make_view
from cmacexp.report.machine import draw_side, in_travel, joints
from cmacexp.report.style import DESIRED, SERIES, STYLE, colour
from cmacexp.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from PIL.Image import Image

ANIMATION = "animation.gif"
COMMENT = b"cmacexp: cycles of a run"
"""In the picture, by which it is known."""
MOST_CYCLES = 3
"""More side by side are too narrow."""
WIDTH, HEIGHT, DPI = 8.0, 4.8, 100
"""Of a frame, inches and pixels per inch."""
FRAMES_PER_SECOND = 12.5
"""Frames of GIF last whole hundredths of a second."""
COLOURS = 128
"""Of the palette that all frames share."""
PATHS = (colour(palette.FIRST_CYCLE), colour(palette.LAST_CYCLE))
"""Of the foot's path, in the first of the cycles and in the others."""
BORDER = 60.0
"""Around the machine, mm."""


class Cycle(NamedTuple):
    """One cycle of a run, as it is drawn."""

    view: RunView
    number: int
    places: Array
    """Joints and foot of each leg, (steps, legs, joints + 1, 3), mm."""
    desired: Array
    """Where the feet should be, (steps, legs, 3), mm."""
    ink: str


class Limits(NamedTuple):
    """Axes that all frames share."""

    x: tuple[float, float]
    z: tuple[float, float]
    force: float
    tilt: float


def make_cycles(views: Sequence[RunView]) -> list[Cycle]:
    """The cycles of a run, one view for each."""
    return [
        Cycle(
            view,
            int(view.cycle[0]),
            joints(view),
            np.stack([in_travel(view, leg.foot("_desired")) for leg in view.legs], axis=1),
            PATHS[min(place, 1)],
        )
        for place, view in enumerate(views)
    ]


def _tilt(view: RunView) -> dict[str, Array]:
    """Pitch and roll of the body, mrad."""
    return {name: 1e3 * view.body[name] for name in ("pitch", "roll")}


def _limits(cycles: Sequence[Cycle]) -> Limits:
    """Axes that hold all of the cycles."""
    drawn = [np.concatenate([c.places.reshape(-1, 3), c.desired.reshape(-1, 3)]) for c in cycles]
    low, high = np.min([d.min(axis=0) for d in drawn], axis=0), np.max([d.max(axis=0) for d in drawn], axis=0)
    force = max(float(np.max([leg["force"], leg["force_desired"]])) for c in cycles for leg in c.view.legs)
    tilt = max(float(np.abs(line).max()) for c in cycles for line in _tilt(c.view).values())
    return Limits(
        (low[0] - BORDER, high[0] + BORDER),
        (min(low[2], -40.0) - BORDER, high[2] + BORDER),
        1.1 * force,
        1.1 * tilt or 1.0,
    )


def _draw_machine(axes: "Axes", cycle: Cycle, k: int, limits: Limits) -> None:
    """The machine from its right side; each foot's desired path, and its own up to now."""
    draw_side(axes, cycle.view, cycle.places, k, depression_scale(cycle.view))
    for leg in range(len(cycle.view.legs)):
        axes.plot(*cycle.desired[:, leg, [0, 2]].T, color=DESIRED, lw=1.0, zorder=5)
        axes.plot(*cycle.places[: k + 1, leg, -1][:, [0, 2]].T, color=cycle.ink, lw=1.6, zorder=6)
    axes.set(xlim=limits.x, ylim=limits.z, aspect="equal", xticks=[], yticks=[])
    axes.axis("off")
    axes.text(0.02, 0.0, "grey: desired foot paths", color=DESIRED, transform=axes.transAxes)
    axes.set_title(f"cycle {cycle.number}", color=cycle.ink, fontsize=13.0, loc="center")


def _draw_forces(axes: "Axes", cycle: Cycle, k: int, limits: Limits, first: bool) -> None:
    """The paper's foot force display: actual beside desired, leg by leg."""
    legs = cycle.view.legs
    number = np.array([leg.number for leg in legs])
    axes.bar(number - 0.19, [leg["force"][k] for leg in legs], 0.36, color=cycle.ink, label="actual", zorder=3)
    axes.bar(
        number + 0.19, [leg["force_desired"][k] for leg in legs], 0.36, fc="white", ec=DESIRED, hatch="////",
        label="desired", zorder=3,
    )  # fmt: skip
    names = [f"{leg.number} {leg.name}" if cycle.view.walks else leg.name for leg in legs]
    axes.set(xlim=(0.4, len(legs) + 0.6), ylim=(0.0, limits.force), xticks=number, xticklabels=names)
    axes.grid(visible=False, axis="x")
    if first:
        axes.set_ylabel("force, N")


def _draw_tilt(axes: "Axes", cycle: Cycle, k: int, limits: Limits, first: bool) -> None:
    """Pitch and roll of the body in this cycle, up to now."""
    time = cycle.view.time - cycle.view.time[0]
    for (name, line), ink in zip(_tilt(cycle.view).items(), (SERIES[1], SERIES[3]), strict=True):
        axes.plot(time[: k + 1], line[: k + 1], color=ink, label=name, lw=1.4)
    axes.axvline(time[k], color="black", lw=0.7)
    axes.set(xlim=(0.0, time[-1]), ylim=(-limits.tilt, limits.tilt), xlabel="time in the cycle, s")
    if first:
        axes.set_ylabel("tilt, mrad")


def _find_row(time: Array, part: float) -> int:
    """The row when ``part`` of the time has passed; rows of a thinned trace need not be evenly spaced."""
    return int(np.abs(time - (time[0] + part * (time[-1] - time[0]))).argmin())


def draw_frame(cycles: Sequence[Cycle], part: float, limits: Limits) -> "Image":
    """A frame of the picture.

    Args:
        cycles: side by side.
        part: of the cycle that has passed, from 0 to 1.
        limits: axes that all frames share.
    """
    import matplotlib
    from matplotlib.figure import Figure
    from PIL import Image

    matplotlib.rcParams.update(STYLE)
    walks = cycles[0].view.walks
    figure = Figure(figsize=(WIDTH, HEIGHT), dpi=DPI)
    rows: dict[str, Any] = {"height_ratios": [2.7, 1.0, 0.9] if walks else [2.7, 1.0]}
    place = {"left": 0.075, "right": 0.985, "top": 0.94, "bottom": 0.1, "hspace": 0.3, "wspace": 0.1}
    axes = figure.subplots(2 + walks, len(cycles), squeeze=False, gridspec_kw=rows | place)
    for column, cycle in enumerate(cycles):
        k, last = _find_row(cycle.view.time, part), column == len(cycles) - 1
        _draw_machine(axes[0, column], cycle, k, limits)
        _draw_forces(axes[1, column], cycle, k, limits, column == 0)
        if walks:
            _draw_tilt(axes[2, column], cycle, k, limits, column == 0)
        for row in range(1, 2 + walks):
            axes[row, column].tick_params(labelleft=column == 0)
            if last:
                axes[row, column].legend(loc="upper right", ncols=2, borderaxespad=0.0)
    memory = BytesIO()
    figure.savefig(memory, format="png", dpi=DPI)
    return Image.open(memory).convert("RGB")


def view_cycles(run: StoredRun, asked: Sequence[int]) -> list[RunView]:
    """A view of each cycle that is asked for; of the first and the last whole one if none is.

    Raises:
        BadInput: the trace does not have them whole, or they are too many.
        BadRun: the trace has no whole cycle.
    """
    kept = steps_by_cycle(run.folder)
    whole = run.select_whole(kept)
    if not whole:
        raise BadRun(f"{run.folder}: its trace has no whole cycle, there is nothing to show")
    if len(asked) > MOST_CYCLES or not set(asked) <= set(whole):
        text, last = ",".join(map(str, asked)), whole[-1]
        raise BadInput(
            "--cycles", text, f"write up to {MOST_CYCLES} whole cycles from {whole[0]} to {last} for --gif"
        )
    cycles = asked or sorted({whole[0], whole[-1]})
    return [make_view(read_traces(run.folder, (cycle, cycle)), run.manifest) for cycle in cycles]


def is_animation(path: Path) -> bool:
    """Whether a file is a moving picture of a run, which may be replaced."""
    from PIL import Image

    try:
        with open_file(path) as file, Image.open(file) as picture:
            return bool(picture.info.get("comment") == COMMENT)
    except (OSError, ValueError):
        return False


def write_animation(views: Sequence[RunView], path: Path) -> int:
    """Write cycles of a run side by side as a GIF that plays one cycle in its own time, again and again.

    Args:
        views: one cycle each.
        path: of the ``.gif`` file.

    Returns:
        The number of frames.
    """
    from PIL.Image import Dither

    cycles = make_cycles(views)
    limits = _limits(cycles)
    seconds = max(float(view.time[-1] - view.time[0]) for view in views)
    count = max(2, round(seconds * FRAMES_PER_SECOND))
    frames = [draw_frame(cycles, number / (count - 1), limits) for number in range(count)]
    colours = frames[count // 2].quantize(COLOURS)
    shared = [frame.quantize(palette=colours, dither=Dither.NONE) for frame in frames]
    with write_atomically(path) as temporary:
        shared[0].save(
            temporary,
            format="GIF",
            save_all=True,
            append_images=shared[1:],
            duration=1000 / FRAMES_PER_SECOND,
            loop=0,
            comment=COMMENT,
        )
    return count
