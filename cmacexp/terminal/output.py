"""Lines and progress on the outputs of a command, which can be closed or full, or lack characters, without harm.

A line that is printed while a terminal shows the progress of work takes its place; the progress is drawn again below.
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
"""Clears the line of a terminal."""
SCREEN_DELAY, SCREEN_INTERVAL = 0.3, 0.1
"""Seconds before a terminal shows work, so that short work does not import rich; and between two states of it."""
FIRST_LINE_DELAY, LINE_INTERVAL = 2.0, 10.0
"""Seconds of work after which a log has its first line of it, and the next at the earliest."""
BAR_WIDTH = 24
"""Characters of a bar in a terminal."""
State = tuple[str, float | None]
"""How far some work is: as text, and the fraction that is done, from 0 to 1; None: unknown."""


def keep_outputs() -> None:
    """Let the outputs of this process show any character, and let no file take the number of a closed one."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # else the next file would get it, and what libraries print
    os.close(number)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def write_output(stream: TextIO | None, text: str = "") -> None:
    """Write to an output, which is None if it was closed, at once, with all that it has buffered.

    Where that fails, as when the reader has stopped, all that follows is discarded, as the documentation of
    :mod:`signal` says ("Note on SIGPIPE"); else Python would report it once more at its end.
    """
    if stream is None:
        return
    try:
        stream.write(text)
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def is_screen(stream: TextIO | None) -> bool:
    """Whether an output is a terminal whose lines can be cleared."""
    return stream is not None and stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def print_line(text: str, error: bool = False) -> None:
    """Print one line at once; control characters, which a folder's name or a file can hold, as in Python.

    An output that is closed does no harm to the run. In a terminal the line takes the place of the progress that may
    be shown there: both in one write, which no other process can interrupt.
    """
    stream: TextIO | None = sys.stderr if error else sys.stdout
    write_output(stream, f"{CLEAR if is_screen(stream) else ''}{in_one_line(text)}\n")


def _draw_bar(read_state: Callable[[], State], ended: Event) -> None:
    """Show the state of work as a bar in the last line of the terminal, until it has ended."""
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
    """Write the state of work to a log until it has ended: a line now and then, none twice, of long work fewer."""
    wait, began, last = 0.0, time.monotonic(), ""
    while not ended.wait(wait):
        if (text := read_state()[0]) != last:
            print_line(text, error=True)
        wait, last = max(LINE_INTERVAL, (time.monotonic() - began) / 10.0), text


@contextmanager
def show_state(read_state: Callable[[], State]) -> Iterator[None]:
    """Show the state of work on stderr while it takes place: in a terminal a bar, in a log a line now and then."""
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
    """Show that ``what`` is being done, of which nothing can be counted."""
    return show_state(lambda: (f"{what} ...", None))
