"""What a person sees in the terminal: that something is compiled, how far a run is, a table when it ends."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache

from cmacexp.config import Config
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import RECORDING, Scores
from cmacexp.jit.compiler import call_before_compiling
from cmacexp.metrics.drift import Drift, in_words
from cmacexp.metrics.summary import table_of_cycles

COMPILING = "first run: compiling the control loop, once for all later runs (up to half a minute) ..."


def say(text: str, error: bool = False) -> None:
    """Print a line at once; a reader who has gone away does not harm what is on disk."""
    stream = sys.stderr if error else sys.stdout
    try:
        print(text, file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@cache
def announce_compiling() -> None:
    """Say so, once, if this process has to compile."""
    call_before_compiling(lambda: say(COMPILING, error=True))


@contextmanager
def progress(config: Config, shown: bool = True) -> Iterator[Callable[[int], None]]:
    """A progress bar over the cycles of a run, when a person watches and it is to be shown; else nothing."""
    if not (shown and sys.stderr.isatty()):
        yield lambda cycle: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("cycles"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(config.scenario, total=config.cycles)
        yield lambda cycle: bar.update(task, completed=cycle)


def warn_of_drift(drift: Drift) -> None:
    """Say at once that learning drifts, though the run goes on."""
    say(f"warning: {in_words(drift)}", error=True)


def scores_table(scores: Scores) -> None:
    """Print the metrics per cycle, pooled over the legs, without columns that are undefined throughout."""
    titles, rows = table_of_cycles(scores)
    print_table([f"{title}\n{unit}".rstrip() for title, unit in titles], rows)


def outcome(result: StoredRun) -> str:
    """How a run ended, in one line."""
    manifest = result.manifest
    steps, seconds = manifest["steps"], manifest["rollout_seconds"]
    per_step = f", loop {seconds / steps * 1e6:.2f} us a step" if steps else ""
    cause = f" {manifest['cause']}" if manifest["cause"] else ""
    drift = f"; {in_words(Drift(**manifest['drift']))}" if manifest["drift"] else ""
    return f"{result.status}{cause}: {steps} steps in {manifest['wall_seconds']:.2f} s{per_step}{drift}"


def summary(result: StoredRun) -> None:
    """Print what a run gave and where it is kept."""
    manifest = result.manifest
    if result.scores.legs.num_rows:
        scores_table(result.scores)
    print(outcome(result))
    if manifest["config"]["learning"]["lead"] == "auto":
        print(f"learning.lead=auto is {manifest['learning_lead']} here")
    for dropped in manifest["dropped"]:
        time = dropped["step"] * manifest["config"]["sampling_period"]
        told = f"force sensor of leg {dropped['leg']} dropped at step {dropped['step']} (t = {time:g} s)"
        print(f"{told}: it told what the ground cannot give")
    if RECORDING in manifest["files"]:
        from cmacexp.recording import every_of

        if (every := every_of(steps := manifest["steps"])) > 1:
            print(f"{RECORDING}: one step in {every} of {steps}; python -m cmacexp.replay DIR --every 1 shows all")
    print(result.folder)


WIDTH = 400
"""Most characters in a line where no person watches; a table takes what it needs."""


def print_table(titles: Sequence[str], rows: Sequence[Sequence[str]], left: int = 0) -> None:
    """Print rows under their titles.

    Args:
        titles: of the columns; what follows a line break is the unit.
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
