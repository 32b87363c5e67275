"""Lines and progress on stdout and stderr, which may be closed, full, or unable to encode a character.

A line that is printed while a terminal shows progress replaces the progress, which is drawn again below it.
"""

import io
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from datetime import timedelta
from threading import Event, Thread
from typing import TextIO

from cmacexp.errors import in_one_line

CLEAR = "\r\x1b[2K"
"""Control sequence that clears the current line of a terminal."""
SCREEN_DELAY, SCREEN_INTERVAL = 0.3, 0.1
"""Time before a terminal shows progress, s, so that short work does not import rich; time between updates, s."""
FIRST_LINE_DELAY, LINE_INTERVAL = 2.0, 10.0
"""Time before the first line of progress in a log, s; least time between two lines, s."""
BAR_WIDTH = 24
"""Width of a progress bar, characters."""
State = tuple[str, float | None]
"""Progress of work: a text, and the completed fraction from 0 to 1; None: unknown."""


def keep_outputs() -> None:
    """Prepare stdout and stderr: escape characters that they cannot encode, and reserve descriptors of closed ones.

    A file that is opened later would otherwise get the descriptor of a closed output.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # else the next file would get this descriptor, with all that libraries print
    os.close(number)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def write_output(stream: TextIO | None, text: str = "") -> None:
    """Write ``text`` to an output, None if it is closed, and flush it.

    If that fails, e.g. since the reader has stopped, all later output is discarded, as the documentation of
    :mod:`signal` advises ("Note on SIGPIPE"); else Python would report the error again when it exits.
    """
    if stream is None:
        return
    try:
        stream.write(text)
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def is_screen(stream: TextIO | None) -> bool:
    """Check whether an output is a terminal whose lines can be cleared."""
    return stream is not None and stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def print_line(text: str, error: bool = False) -> None:
    """Print one line to stdout, or with ``error`` to stderr, and flush it; control characters are escaped.

    A closed output is ignored. In a terminal the line replaces the progress bar, if there is one; a single write
    clears the bar and prints the line, so that output of other processes cannot come between.
    """
    stream: TextIO | None = sys.stderr if error else sys.stdout
    write_output(stream, f"{CLEAR if is_screen(stream) else ''}{in_one_line(text)}\n")


def _draw_bar(read_state: Callable[[], State], ended: Event) -> None:
    """Show progress as a bar in the last line of the terminal until ``ended`` is set."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    bar = Progress(
        *(BarColumn(BAR_WIDTH), TextColumn("{task.description}", markup=False)),
        console=Console(stderr=True),
        auto_refresh=False,
        transient=True,
        redirect_stdout=False,  # print_line() clears the bar, also for output that goes elsewhere than to stderr
        redirect_stderr=False,
    )
    task = bar.add_task("", total=None)
    with bar:
        while not ended.wait(SCREEN_INTERVAL):
            text, done = read_state()
            total = None if done is None else 1.0
            bar.update(task, description=in_one_line(text), total=total, completed=done, refresh=True)


def _write_lines(read_state: Callable[[], State], ended: Event) -> None:
    """Write progress to a log until ``ended`` is set: only changed lines, and fewer of them the longer it takes."""
    wait, began, last = 0.0, time.monotonic(), ""
    while not ended.wait(wait):
        if (text := read_state()[0]) != last:
            print_line(text, error=True)
        wait, last = max(LINE_INTERVAL, (time.monotonic() - began) / 10.0), text


@contextmanager
def show_state(read_state: Callable[[], State]) -> Iterator[None]:
    """Show progress on stderr within a context: a bar in a terminal, occasional lines in a log."""
    ended, on_screen = Event(), is_screen(sys.stderr)

    def show() -> None:
        if not ended.wait(SCREEN_DELAY if on_screen else FIRST_LINE_DELAY):
            (_draw_bar if on_screen else _write_lines)(read_state, ended)

    writer = Thread(target=show, daemon=True)
    writer.start()
    try:
        yield
    finally:
        ended.set()
        writer.join()


@contextmanager
def show_progress(
    what: str, total: int | None, unit: str = "", describe: Callable[[], str] = str
) -> Iterator[Callable[[float], None]]:
    """Show how much of some work is done while it takes place, and the time that is left at this rate.

    Yields a function that takes the number of parts that are done, of ``total``; None: unknown. ``describe`` gives
    further text, such as the number of tasks that wait.
    """
    done, began = 0.0, time.monotonic()

    def set_done(parts: float) -> None:
        nonlocal done
        done = parts

    def read_state() -> State:
        text = f"{what}: {int(done)}{f'/{total}' if total else ''} {unit}".rstrip()
        if done and total:
            left = timedelta(seconds=round((time.monotonic() - began) * (total - done) / done))
            text += f" ({100.0 * done / total:.1f} %), {left} left"
        return ", ".join(filter(None, (text, describe()))), done / total if total else None

    with show_state(read_state):
        yield set_done


def show_activity(what: str) -> AbstractContextManager[None]:
    """Show the activity ``what`` within a context, without a measure of progress."""
    return show_state(lambda: (f"{what} ...", None))
