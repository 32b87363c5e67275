"""Printing in the terminal: that compiling takes place, the progress of work, tables, and the summary of a run."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache

from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import RECORDING, Scores
from cmacexp.jit.compiler import call_before_compiling
from cmacexp.metrics.drift import Drift, format_drift
from cmacexp.metrics.summary import format_cycles

COMPILING = "compiling the control loop: takes up to half a minute, once; so many steps repay it"


def say(text: str, error: bool = False) -> None:
    """Print a line at once; a closed pipe does no harm to the run."""
    stream = sys.stderr if error else sys.stdout
    try:
        print(text, file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@cache
def announce_compiling() -> None:
    """Print :data:`COMPILING`, once, if this process has to compile."""
    call_before_compiling(lambda: say(COMPILING, error=True))


@contextmanager
def progress(
    what: str, total: int | None = None, unit: str = "", shown: bool = True
) -> Iterator[Callable[[int], None]]:
    """A progress bar while work takes place, if ``shown`` and the output is a terminal; gives what moves it.

    Args:
        what: is being done.
        total: parts of the work, of which so many have to be given as done; None: not known, the time alone is shown.
        unit: of the parts.
        shown: False where several processes would draw over each other's bars.
    """
    if not (shown and sys.stderr.isatty()):
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as Remaining

    parts = (MofNCompleteColumn(), TextColumn(unit), Remaining()) if total else (TimeElapsedColumn(),)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), *parts)
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


def warn_of_drift(drift: Drift) -> None:
    """Warn that learning drifts, while the run goes on."""
    say(f"warning: {format_drift(drift)}", error=True)


def print_scores(scores: Scores) -> None:
    """Print the metrics per cycle, pooled over the legs, without columns that are undefined throughout."""
    titles, rows = format_cycles(scores)
    print_table([f"{title}\n{unit}".rstrip() for title, unit in titles], rows)


def format_outcome(result: StoredRun) -> str:
    """How a run ended, in one line."""
    manifest = result.manifest
    steps, seconds = manifest["steps"], manifest["rollout_seconds"]
    per_step = f", loop {seconds / steps * 1e6:.2f} us a step" if steps else ""
    drift = f"; {format_drift(Drift(**manifest['drift']))}" if manifest["drift"] else ""
    return f"{result.ending}: {steps} steps in {manifest['wall_seconds']:.2f} s{per_step}{drift}"


def print_summary(result: StoredRun) -> None:
    """Print the metrics of a run, how it ended and its folder."""
    manifest = result.manifest
    if result.scores.legs.num_rows:
        print_scores(result.scores)
    print(format_outcome(result))
    if manifest["config"]["learning"]["lead"] == "auto":
        print(f"learning.lead=auto is {manifest['learning_lead']} here")
    for dropped in manifest["dropped"]:
        time = dropped["step"] * manifest["config"]["sampling_period"]
        where = f"force sensor of leg {dropped['leg']} rejected at step {dropped['step']} (t = {time:g} s)"
        print(f"{where}: it reports a force that the ground cannot give")
    if RECORDING in manifest["files"]:
        from cmacexp.recording.window import choose_every

        if (every := choose_every(steps := manifest["steps"])) > 1:
            print(f"{RECORDING}: one step in {every} of {steps}; python -m cmacexp.replay DIR --every 1 shows all")
    print(result.folder)


WIDTH = 400
"""Most characters in a line if the output is not a terminal."""


def print_table(titles: Sequence[str], rows: Sequence[Sequence[str]], left: int = 0) -> None:
    """Print rows under their titles.

    Args:
        titles: of the columns; the unit follows a line break.
        rows: cells as text.
        left: so many columns hold text and stand to the left.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, title in enumerate(titles):
        table.add_column(title, justify="left" if index < left else "right")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH).print(table)
