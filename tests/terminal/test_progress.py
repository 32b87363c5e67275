"""Work that takes seconds shows that it goes on: in a terminal at once, in a log by a line now and then."""

import contextlib
import io
import re
import sys
import time

import pytest

from cmacexp.terminal import output
from cmacexp.terminal.output import show_activity, show_progress

HIDE_CURSOR, SHOW_CURSOR, LAST_CLEAR = "\x1b[?25l", "\x1b[?25h", "\r\x1b[1A\x1b[2K"


class Terminal(io.StringIO):
    """What a command writes to a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def use(monkeypatch):
    """Has the process write its errors to a stream, as to a terminal of 80 columns if that is one."""
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    for name, seconds in {"SCREEN_DELAY": 0.0, "FIRST_LINE_DELAY": 0.0, "LINE_INTERVAL": 0.001}.items():
        monkeypatch.setattr(output, name, seconds)

    def use_stream(stream):
        monkeypatch.setattr(sys, "stderr", stream)
        return stream

    return use_stream


def shown_in(screen: io.StringIO) -> str:
    """What a terminal was sent, without colours."""
    return re.sub(r"\x1b\[[\d;]*m", "", screen.getvalue())


def wait_for(screen: io.StringIO, text: str) -> None:
    while text not in shown_in(screen):
        time.sleep(0.001)


def test_in_a_terminal_parts_are_counted_in_one_line_that_leaves(use):
    screen = use(Terminal())
    with contextlib.suppress(KeyboardInterrupt), show_progress("running", 12, "cycles") as watch:
        wait_for(screen, "\u2501 running: 0/12 cycles")
        watch(5.5)
        wait_for(screen, "\u2501 running: 5/12 cycles (45.8 %), ")
        raise KeyboardInterrupt
    assert screen.getvalue().startswith(HIDE_CURSOR)
    assert screen.getvalue().endswith(f"\n{SHOW_CURSOR}{LAST_CLEAR}")
    assert "\n" not in shown_in(screen).removesuffix(f"\n{SHOW_CURSOR}{LAST_CLEAR}"), "it takes one line"


def test_a_line_that_is_printed_meanwhile_takes_the_place_of_the_bar(use):
    screen = use(Terminal())
    with show_activity("reading a[b] folder"):
        wait_for(screen, "reading a[b] folder ...")
        output.print_line("a [bold] line", error=True)
        wait_for(screen, "\r\x1b[2Ka [bold] line\n")
        printed = len(shown_in(screen))
        while "reading a[b]" not in shown_in(screen)[printed:]:
            time.sleep(0.001)
