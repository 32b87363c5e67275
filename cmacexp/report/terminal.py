"""Printing in the terminal: that compiling takes place, how work goes on, how a run ended, what to do next."""

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from shlex import quote
from threading import Event, Thread

from cmacexp.config import Config
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import RECORDING
from cmacexp.errors import in_one_line
from cmacexp.jit.compiler import call_before_compiling
from cmacexp.metrics.drift import Drift, format_drift, read_drift_entry
from cmacexp.metrics.pooling import count_legs
from cmacexp.report.outputs import keep_outputs
from cmacexp.report.terminal_tables import print_key, print_scores

NEXT = {"report": "report", "replay": "replay"}
"""Commands that show more of a run, with their purpose."""
LATE, OFTEN = 2.0, 10.0
"""Seconds of work after which a log has its first line of it, and the next at the earliest."""
COMPILING = "compiling the control loop: takes up to half a minute, once; so many steps repay it"


def say(text: str, error: bool = False) -> None:
    """Print one line at once; control characters, which a folder's name or a file can hold, as in Python.

    An output that is closed does no harm to the run, in a worker process either.
    """
    keep_outputs()
    print(in_one_line(text), file=sys.stderr if error else sys.stdout, flush=True)


@cache
def announce_compiling() -> None:
    """Print :data:`COMPILING`, once, if this process has to compile."""
    call_before_compiling(lambda: say(COMPILING, error=True))


@contextmanager
def _lines(describe: Callable[[], str], shown: bool) -> Iterator[None]:
    """What a terminal would show, for a log: a line on stderr after :data:`LATE`, then now and then until the end."""
    if not shown:
        yield
        return
    ended, began = Event(), time.monotonic()

    def write() -> None:
        wait = LATE
        while not ended.wait(wait):
            say(describe(), error=True)
            wait = max(OFTEN, (time.monotonic() - began) / 10.0)  # work of hours fills no pages

    writer = Thread(target=write, daemon=True)
    writer.start()
    try:
        yield
    finally:
        ended.set()
        writer.join()


@contextmanager
def progress(what: str, total: int, unit: str = "", shown: bool = True) -> Iterator[Callable[[int], None]]:
    """A progress bar while work takes place, lines if the output is no terminal; gives what moves it.

    Args:
        what: is being done.
        total: parts of the work, of which so many have to be given as done.
        unit: of the parts.
        shown: False where several processes would draw over each other's bars.
    """
    if not (shown and sys.stderr.isatty()):
        parts = [0]
        with _lines(lambda: f"{what}: {parts[0]}/{total} {unit}".rstrip(), shown):
            yield lambda done: parts.__setitem__(0, done)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TextColumn(unit))
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(in_one_line(what), total=total)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def activity(what: str, shown: bool = True) -> Iterator[Callable[[str], None]]:
    """``what`` is being done is shown on stderr, a terminal or not; gives ``show(text)`` for what is done next.

    Args:
        what: is being done.
        shown: as for :func:`progress`.
    """
    if not (shown and sys.stderr.isatty()):
        done = [what]
        with _lines(lambda: f"{done[0]} ...", shown):
            yield lambda text: done.__setitem__(0, text)
        return
    from rich.console import Console
    from rich.markup import escape

    with Console(stderr=True, highlight=False).status(escape(in_one_line(what))) as status:
        yield lambda text: status.update(escape(in_one_line(text)))


def describe_planning(config: Config) -> str:
    """What is being done before the first step of a run."""
    return f"planning {config.steps_per_cycle} steps a cycle"


def warn_of_drift(drift: Drift) -> None:
    """Warn that learning drifts, while the run goes on."""
    say(f"warning: {format_drift(drift)}", error=True)


def format_outcome(result: StoredRun, separator: str = ": ") -> str:
    """How a run ended, and after ``separator`` its steps and time."""
    manifest = result.manifest
    steps, seconds = manifest["steps"], manifest["rollout_seconds"]
    per_step = f", loop {seconds / steps * 1e6:.2f} us a step" if steps else ""
    return f"{result.ending}{separator}{steps} steps in {manifest['wall_seconds']:.2f} s{per_step}"


def describe_drift(result: StoredRun) -> str:
    """The drift of the learning of a run, in one line; empty if there is none."""
    drift = read_drift_entry(result.manifest["drift"])
    return format_drift(drift, " at the end") if drift else ""


def format_folder(folder: Path) -> str:
    """A folder as an argument of a command in the current one."""
    full = folder.resolve()
    return quote(str(full.relative_to(Path.cwd()) if full.is_relative_to(Path.cwd()) else full))


def print_next(folder: Path, commands: Mapping[str, str]) -> None:
    """Print commands over a folder to copy, each with what it is for."""
    for name, purpose in commands.items():
        say(f"{purpose + ':':<10} python -m cmacexp.{name} {format_folder(folder)}")


def _print_notes(result: StoredRun) -> None:
    """Print what is special about a run."""
    manifest = result.manifest
    if drift := describe_drift(result):
        say(drift)
    if manifest["config"]["learning"]["lead"] == "auto":
        say(f"learning.lead=auto is {manifest['learning_lead']} here")
    for dropped in manifest["dropped"]:
        time = dropped["step"] * manifest["config"]["sampling_period"]
        where = f"force sensor of leg {dropped['leg']} rejected at step {dropped['step']} (t = {time:g} s)"
        print(f"{where}: it reports a force that the ground cannot give")
    if RECORDING in manifest["files"]:
        from cmacexp.recording.window import choose_every

        if (every := choose_every(steps := manifest["steps"])) > 1:
            print(f"{RECORDING}: one step in {every} of {steps}; replay with --every 1 shows all")


def print_summary(result: StoredRun) -> None:
    """Print the metrics of a run and their key, how it ended, the commands that show more, and its folder."""
    scores = result.scores
    if scores.legs.num_rows:
        print_key(print_scores(scores, Path(format_folder(result.folder))), count_legs(scores))
        print()
    for line in format_outcome(result, "\n" if result.manifest["cause"] else ": ").split("\n"):
        say(line)
    _print_notes(result)
    if scores.legs.num_rows:
        drifts = {"stability": "explain"} if result.manifest["drift"] else {}
        print_next(result.folder, drifts | NEXT)
    say(str(result.folder))
