"""``python -m cmacexp.animate DIR``: cycles of a run side by side as a moving picture."""

import argparse
import sys
from pathlib import Path

from cmacexp.cli.command import command
from cmacexp.cli.working import show_work
from cmacexp.data.discovery import runs_below
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import read_traces, steps_by_cycle
from cmacexp.errors import BadInput, BadRun
from cmacexp.recording.run_view import RunView, make_view

NAME = Path("report", "animation.gif")
"""Where the picture goes in the folder of its run."""
MOST_CYCLES = 3
"""More side by side are too narrow."""


def _cycles(text: str | None, run: StoredRun) -> list[int]:
    """The cycles to show: those asked for, or the first and the last whole one.

    Raises:
        BadInput: the run does not have them.
        BadRun: the run has no whole cycle.
    """
    kept = steps_by_cycle(run.folder)
    whole = [cycle for cycle, steps in kept.items() if steps == max(kept.values())]
    if not whole or run.whole_cycles == 0:
        raise BadRun(f"{run.folder}: its trace has no whole cycle, there is nothing to show")
    if text is None:
        return sorted({whole[0], whole[-1]})
    numbers = [int(part) if part.isdecimal() else 0 for part in text.split(",")]
    if len(numbers) > MOST_CYCLES or not set(numbers) <= set(whole):
        allowed = f"whole cycles from {whole[0]} to {whole[-1]}"
        raise BadInput("--cycles", text, f"write up to {MOST_CYCLES} {allowed}, separated by commas")
    return numbers


def _animate(arguments: argparse.Namespace) -> int:
    from cmacexp.report.animation import write_animation

    runs = [StoredRun(folder) for given in arguments.folders for folder in runs_below(given)]
    if arguments.out is not None and len(runs) > 1:
        raise BadInput("--out", arguments.out, f"is for one run, but {len(runs)} were given")
    for run in runs:
        path = Path(arguments.out or run.folder / NAME)
        if path.suffix != ".gif":
            raise BadInput("--out", path, "must end in .gif")
        views: list[RunView] = []
        for cycle in _cycles(arguments.cycles, run):
            views.append(make_view(read_traces(run.folder, (cycle, cycle)), run.config))
        path.parent.mkdir(parents=True, exist_ok=True)
        with show_work(f"drawing {path}"):
            frames = write_animation(views, path)
        print(f"{path}: cycles {', '.join(str(view.cycle[0]) for view in views)}, {frames} frames")
    return 0


def main() -> int:
    """Run the command."""
    description = "Cycles of a run side by side as a GIF: foot paths, forces and tilt, in the time of one cycle."
    values = [
        ("--cycles", "1,10", "cycles to show (default: the first and the last whole one)"),
        ("--out", "FILE.gif", f"where it goes (default: DIR/{NAME})"),
    ]
    return command("cmacexp.animate", description, _animate, (), values)


if __name__ == "__main__":
    sys.exit(main())
