"""Printing in the terminal: that compiling takes place, how work goes on, how a run ended, what to do next."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from shlex import quote
from threading import Event, Thread

from cmacexp.config.machine import describe_other_model
from cmacexp.data.parquet import as_array
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import RECORDING_FILE
from cmacexp.errors import in_one_line
from cmacexp.jit.compiler import call_before_compiling
from cmacexp.metrics.body import describe_load
from cmacexp.metrics.drift import describe_guard, format_drift, read_drift_entry
from cmacexp.terminal.closed_pipes import is_screen
from cmacexp.terminal.closed_pipes import print_line as print_line
from cmacexp.terminal.tables import KEY, print_scores

NEXT = {"report": "report", "replay": "replay"}
"""Commands that show more of a run, with their purpose."""
SCREEN_DELAY, SCREEN_INTERVAL = 0.3, 0.1
"""Seconds before a terminal shows work, so that short work does not import rich; and between two states of it."""
FIRST_LINE_DELAY, LINE_INTERVAL = 2.0, 10.0
"""Seconds of work after which a log has its first line of it, and the next at the earliest."""
BAR_WIDTH = 24
"""Characters of a bar in a terminal."""
UNITS = ((3600.0, "h"), (60.0, "min"), (0.0, "s"))
COMPILING = "compiling the control loop: takes up to half a minute, once; so many steps repay it"
State = tuple[str, float | None]
"""How far some work is: as text, and what is done of it, 0 to 1; None: unknown."""


@cache
def announce_compiling() -> None:
    """Print :data:`COMPILING`, once, if this process has to compile."""
    call_before_compiling(lambda: print_line(COMPILING, error=True))


@cache
def _warn(text: str) -> None:
    print_line(f"warning: {text}", error=True)


def warn_of_models(machines: Iterable[object]) -> None:
    """Print, once in this process, which robots' models are not the ones that results were measured with."""
    for machine in {repr(machine): machine for machine in machines}.values():  # a study has many equal ones
        if other := describe_other_model(machine):
            _warn(other)


def _draw(look: Callable[[], State], ended: Event) -> None:
    """Show the state of work as a bar in the last line of the terminal, until it has ended."""
    if ended.wait(SCREEN_DELAY):
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    bar = Progress(
        *(BarColumn(BAR_WIDTH), TextColumn("{task.description}", markup=False)),
        console=Console(stderr=True),
        auto_refresh=False,
        transient=True,
        redirect_stdout=False,  # what any process prints meanwhile comes from say(), which clears the bar
        redirect_stderr=False,
    )
    with bar:
        task = bar.add_task("", total=None)
        while True:
            text, share = look()
            total = None if share is None else 1.0
            bar.update(task, description=in_one_line(text), total=total, completed=share, refresh=True)
            if ended.wait(SCREEN_INTERVAL):
                return


def _write_lines(look: Callable[[], State], ended: Event) -> None:
    """Write the state of work to a log, a line now and then, and none twice, until it has ended."""
    wait, began, last = FIRST_LINE_DELAY, time.monotonic(), ""
    while not ended.wait(wait):
        if (text := look()[0]) != last:
            print_line(text, error=True)
        wait, last = max(LINE_INTERVAL, (time.monotonic() - began) / 10.0), text  # work of hours fills no pages


@contextmanager
def shown(look: Callable[[], State]) -> Iterator[None]:
    """Show the state of work on stderr: in a terminal a bar, in a log a line now and then."""
    ended = Event()
    writer = Thread(target=_draw if is_screen(sys.stderr) else _write_lines, args=(look, ended), daemon=True)
    writer.start()
    try:
        yield
    finally:
        ended.set()
        writer.join()


def format_progress(what: str, done: float, total: int, unit: str, seconds: float) -> str:
    """How much is done after ``seconds``, and the time that is left at this rate; a search has a total of 0."""
    if not total:
        return f"{what}: {int(done)} {unit}".rstrip()
    text = f"{what}: {int(done)}/{total} {unit}".rstrip()
    if not done:
        return text
    return f"{text} ({100.0 * done / total:.1f} %), {format_duration(seconds * (total - done) / done)} left"


def format_duration(seconds: float) -> str:
    """A time in the unit that suits it."""
    size, name = next(each for each in UNITS if seconds >= 2.0 * each[0])
    return f"{seconds / (size or 1.0):.0f} {name}"


@contextmanager
def progress(what: str, total: int, unit: str = "") -> Iterator[Callable[[float], None]]:
    """Show how much of some work is done while it takes place; gives what is called with the parts that are done."""
    done, began = [0.0], time.monotonic()
    with shown(lambda: (format_progress(what, done[0], total, unit, time.monotonic() - began), done[0] / total)):
        yield lambda parts: done.__setitem__(0, parts)


@contextmanager
def activity(what: str) -> Iterator[Callable[[str], None]]:
    """Show that ``what`` is being done; gives ``show(text)`` for what is done next."""
    current = [what]
    with shown(lambda: (f"{current[0]} ...", None)):
        yield lambda text: current.__setitem__(0, text)


def format_outcome(result: StoredRun, separator: str = ": ") -> str:
    """How a run ended, and after ``separator`` its steps and time."""
    manifest = result.manifest
    steps, seconds = manifest["steps"], manifest["rollout_seconds"]
    per_step = f", loop {seconds / steps * 1e6:.2f} us a step" if steps else ""
    return f"{result.ending}{separator}{steps} steps in {manifest['wall_seconds']:.2f} s{per_step}"


def describe_drift(result: StoredRun) -> str:
    """The drift of the learning of a run, in one line; empty if there is none."""
    drift = read_drift_entry(result.manifest["drift"])
    return format_drift(drift, at_end=True) if drift else ""


def describe_idle(result: StoredRun) -> str:
    """Whether a custom feedforward gave no torque in a whole run, in one line; empty if it gave some."""
    target, learning = result.config["feedforward"]["_target_"], result.config["learning"]
    legs = result.scores.legs
    if target.startswith("cmacexp.") or not legs.num_rows or as_array(legs, "feedforward_rms").any():
        return ""
    cycles, first = result.config["cycles"], learning["start_cycle"]
    return f"{target} gave no torque in {cycles} cycles; it acts from learning.start_cycle={first} on"


def format_folder(folder: Path) -> str:
    """A folder as an argument of a command in the current one."""
    full = folder.resolve()
    return quote(str(full.relative_to(Path.cwd()) if full.is_relative_to(Path.cwd()) else full))


def print_next(folder: Path, commands: Mapping[str, str]) -> None:
    """Print commands over a folder to copy, each with what it is for."""
    for name, purpose in commands.items():
        print_line(f"{purpose + ':':<10} python -m cmacexp.{name} {format_folder(folder)}")


def describe_resume(folder: Path) -> str:
    """How a sweep is continued, after a killed or an interrupted one."""
    return f"the same command with sweep.resume=true hydra.sweep.dir={format_folder(folder)}"


def _print_notes(result: StoredRun) -> None:
    """Print what is special about a run."""
    manifest = result.manifest
    if drift := describe_drift(result):
        print_line(drift)
    if idle := describe_idle(result):
        print_line(f"warning: {idle}")
    if guarded := describe_guard(manifest):
        print_line(f"guard of learning: {guarded}")
    if load := describe_load(manifest):
        print_line(f"load of the feet: {load}")
    for name in ("lead", "rate"):
        given, taken = manifest["config"]["learning"][name], manifest.get(f"learning_{name}")
        if taken not in (None, given):
            print_line(f"learning.{name}={given} is {taken:.4g} here")
    for dropped in manifest["dropped"]:
        time = dropped["step"] * manifest["config"]["sampling_period"]
        where = f"force sensor of leg {dropped['leg']} rejected at step {dropped['step']} (t = {time:g} s)"
        print(f"{where}: it reports a force that the ground cannot give")
    if RECORDING_FILE in manifest["files"]:
        from cmacexp.recording.window import choose_every

        if (every := choose_every(steps := manifest["steps"])) > 1:
            print(f"{RECORDING_FILE}: one step in {every} of {steps}; replay with --every 1 shows all")


def print_summary(result: StoredRun) -> None:
    """Print the metrics of a run, how it ended, the commands that show more, and its folder."""
    scores = result.scores
    if scores.legs.num_rows:
        print_scores(scores, Path(format_folder(result.folder)))
        print()
    for line in format_outcome(result, "\n" if result.manifest["cause"] else ": ").split("\n"):
        print_line(line)
    _print_notes(result)
    if scores.legs.num_rows:
        print_line(KEY)
        drifts = {"stability": "explain"} if result.manifest["drift"] else {}
        print_next(result.folder, drifts | NEXT if result.config["record"]["trace"] else {})
    print_line(str(result.folder))
