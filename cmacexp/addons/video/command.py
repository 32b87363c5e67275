"""``cmacexp video``: draw cycles of one run, or of several side by side, as a video."""

from collections.abc import Sequence
from pathlib import Path

from cmacexp.addons.video.picture import (
    FORMATS,
    MOST_CYCLES,
    MP4,
    RobotPicture,
    render_robot,
    view_cycles,
    write_video,
)
from cmacexp.commands.command import FOLDERS, Arguments, command, make_flag
from cmacexp.data import manifest as manifests
from cmacexp.data.run import Run
from cmacexp.errors import CmacexpError, require, require_extra
from cmacexp.recording.run_view import RunView
from cmacexp.terminal.output import print_line, show_activity


def _make_pictures(views: Sequence[RunView]) -> list[RobotPicture | None]:
    """Make a renderer for the robot of each view; return an empty list, and print the reason, if rendering fails."""
    try:
        return [render_robot(view.run) if view.robot else None for view in views]
    except CmacexpError as error:
        print_line(f"drawn as lines: {error}")
        return []


DEFAULT = Path("walk.gif")


def _choose(arguments: Arguments) -> list[RunView]:
    """Select the cycles to show; raises BadInput if a run lacks them, BadRun if a folder is not a run."""
    runs = [Run(folder, manifests.read(folder)) for folder in arguments.folders]
    if len(runs) == 1:
        numbers = arguments.cycles.split(",") if arguments.cycles else []
        require(
            all(number.isdigit() for number in numbers),
            "--cycles",
            arguments.cycles,
            "must be whole numbers, separated by commas",
        )
        return view_cycles(runs[0], [int(number) for number in numbers])
    require(
        not arguments.cycles,
        "--cycles",
        arguments.cycles,
        "is for one run; of several their last cycles are shown",
    )
    require(len(runs) <= MOST_CYCLES, "DIR", len(runs), f"must be at most {MOST_CYCLES} runs")
    return [view_cycles(run, [])[-1] for run in runs]


@command(
    "video",
    "Draw cycles of one run, or the last cycle of each of several runs, side by side as a video.",
    {
        "folders": {**FOLDERS["folders"], "help": f"one run (latest: the newest), or up to {MOST_CYCLES} runs"},
        "--cycles": {
            "metavar": "1,10",
            "help": "cycles to show of one run (default: the first and the last whole cycle)",
        },
        "--titles": {"metavar": "A,B", "help": "titles above the cycles (default: their numbers)"},
        "--lines": make_flag("draw robots as lines instead of rendering their models"),
        "--out": {
            "type": Path,
            "metavar": "FILE",
            "help": f"output file, {', '.join(FORMATS)} (default: {DEFAULT}, unless it exists)",
        },
    },
)
def main(arguments: Arguments) -> None:
    """Write the video and print its path."""
    out = arguments.out or DEFAULT
    require(arguments.out or not out.exists(), "--out", out, f"exists; --out {out} replaces it")
    require(out.suffix in FORMATS, "--out", out, f"must end in {', '.join(FORMATS)}")
    require(out.parent.is_dir(), "--out", out, "must lie in a folder that exists")
    titles = arguments.titles.split(",") if arguments.titles else []
    views = _choose(arguments)
    require(
        len(titles) in (0, len(views)),
        "--titles",
        arguments.titles,
        f"must be {len(views)} texts, separated by commas",
    )
    if out.suffix == MP4:
        require_extra("imageio_ffmpeg")
    with show_activity("drawing"):
        write_video(views, out, titles, [] if arguments.lines else _make_pictures(views))
    print_line(str(out))
