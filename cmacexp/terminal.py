"""What a person sees in the terminal: a progress bar while a run lasts, a table when it ends."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from cmacexp.config import Config
from cmacexp.console import print_table
from cmacexp.keep import RECORDING, Scores
from cmacexp.pooled import table_of_cycles
from cmacexp.run import RunResult


@contextmanager
def progress(config: Config) -> Iterator[Callable[[int], None]]:
    """A progress bar over the cycles of a run, when a person watches; else nothing."""
    if not sys.stderr.isatty():
        yield lambda cycle: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("cycles"))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(config.scenario, total=config.cycles)
        yield lambda cycle: bar.update(task, completed=cycle)


def scores_table(scores: Scores) -> None:
    """Print the metrics per cycle, pooled over the legs, without columns that are undefined throughout."""
    titles, rows = table_of_cycles(scores)
    print_table([f"{title}\n{unit}".rstrip() for title, unit in titles], rows)


def summary(result: RunResult) -> None:
    """Print what a run gave and where it is kept."""
    manifest = result.manifest
    if result.scores.legs.num_rows:
        scores_table(result.scores)
    steps, seconds = manifest["steps"], manifest["rollout_seconds"]
    per_step = f", loop {seconds / steps * 1e6:.2f} us a step" if steps else ""
    cause = f" {manifest['cause']}" if manifest["cause"] else ""
    print(f"{result.status}{cause}: {steps} steps in {manifest['wall_seconds']:.2f} s{per_step}")
    if RECORDING in manifest["files"]:
        from cmacexp.recording import every_of

        if (every := every_of(steps)) > 1:
            print(f"{RECORDING}: one step in {every} of {steps}; python -m cmacexp.replay DIR --every 1 shows all")
    print(result.folder)
