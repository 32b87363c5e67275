"""Work that takes seconds shows that it goes on: in a terminal at once, in a log by a line now and then."""

import contextlib
import io
import os
import pty
import re
import subprocess
import sys
import threading
import time

import pytest
from support.command import environment

import cmacexp
from cmacexp.commands import main as command_line
from cmacexp.commands.score import main as score
from cmacexp.commands.verify import main as verify
from cmacexp.experiment.workers import VARIABLE, share_progress, shared_progress, workers
from cmacexp.report import terminal
from cmacexp.report.terminal import activity, format_progress, progress


class Terminal(io.StringIO):
    """What a command writes to a terminal."""

    def isatty(self) -> bool:
        return True


def use_terminal(monkeypatch, stream: io.StringIO) -> io.StringIO:
    """Have the process write its errors to ``stream``, as to a terminal of 80 columns if that is one."""
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys, "stderr", stream)
    return stream


HIDE_CURSOR, SHOW_CURSOR, LAST_CLEAR = "\x1b[?25l", "\x1b[?25h", "\r\x1b[1A\x1b[2K"


def shown_in(screen: Terminal) -> str:
    """What a terminal was sent, without colours."""
    return re.sub(r"\x1b\[[\d;]*m", "", screen.getvalue())


def wait_for(screen: Terminal, text: str) -> None:
    while text not in shown_in(screen):
        time.sleep(0.01)


def test_parts_of_known_number_are_counted_and_the_bar_leaves(monkeypatch):
    screen = use_terminal(monkeypatch, Terminal())
    with progress("running", 12, "cycles") as watch:
        wait_for(screen, "\u2501 running: 0/12 cycles")
        watch(5.5)
        wait_for(screen, "\u2501 running: 5/12 cycles (45.8 %), ")
    assert screen.getvalue().startswith(HIDE_CURSOR)
    assert screen.getvalue().endswith(f"\n{SHOW_CURSOR}{LAST_CLEAR}")
    assert "\n" not in shown_in(screen).removesuffix(f"\n{SHOW_CURSOR}{LAST_CLEAR}"), "it takes one line"


def test_an_error_or_an_interrupt_gives_the_cursor_back(monkeypatch):
    screen = use_terminal(monkeypatch, Terminal())
    with contextlib.suppress(KeyboardInterrupt), activity("reading"):
        wait_for(screen, "reading ...")
        raise KeyboardInterrupt
    assert screen.getvalue().endswith(f"\n{SHOW_CURSOR}{LAST_CLEAR}")


def test_a_line_that_is_printed_meanwhile_takes_the_place_of_the_bar(monkeypatch):
    screen = use_terminal(monkeypatch, Terminal())
    with activity("reading a[b] folder"):
        wait_for(screen, "reading a[b] folder ...")
        terminal.say("a [bold] line", error=True)
        while "reading a[b]" not in shown_in(screen).rpartition("\r\x1b[2Ka [bold] line\n")[2]:
            time.sleep(0.01)


def test_a_terminal_that_cannot_clear_a_line_gets_lines_as_a_log_does(monkeypatch):
    monkeypatch.setattr(terminal, "FIRST_LINE_DELAY", 0.0)
    screen = use_terminal(monkeypatch, Terminal())
    monkeypatch.setenv("TERM", "dumb")
    with activity("reading"):
        wait_for(screen, "\n")
    assert screen.getvalue() == "reading ...\n"


@pytest.mark.parametrize(("seconds", "left"), [(3.0, "9 s"), (60.0, "3 min"), (7200.0, "6 h")])
def test_the_time_that_is_left_is_what_the_rest_takes_at_this_rate(seconds, left):
    assert format_progress("sweep", 1.5, 6, "jobs", seconds) == f"sweep: 1/6 jobs (25.0 %), {left} left"


def test_of_a_search_jobs_are_counted_without_a_total():
    assert format_progress("sweep", 1.5, 0, "jobs", 3.0) == "sweep: 1 jobs"


@pytest.fixture
def described(monkeypatch):
    """What is shown of work when it begins, however soon it ends."""
    texts = []

    @contextlib.contextmanager
    def shown(look):
        texts.append(look()[0])
        yield

    monkeypatch.setattr(terminal, "shown", shown)
    return texts


def test_a_command_of_unknown_length_shows_what_it_does(described, monkeypatch, tmp_path):
    run = cmacexp.run(["cycles=1", "sampling_period=0.05", "record=trace"], tmp_path / "run")
    for command, main in {"score": score, "verify": verify}.items():
        monkeypatch.setattr(sys, "argv", [command, str(run.folder)])
        assert main() == 0
    assert described == [f"scoring {run.folder} ...", f"checking {run.folder} ..."]
    monkeypatch.setattr(sys, "argv", ["cmacexp", *SHORT, f"hydra.run.dir={tmp_path / 'again'}"])
    monkeypatch.chdir(tmp_path)
    assert command_line.main() == 3  # so coarse a step diverges at once
    assert described[2:] == ["planning 60 steps a cycle ...", "one_leg: 0/1 cycles"]


SHORT = ["cycles=1", "sampling_period=0.05", "record=trace"]


def test_verify_imports_no_rich_even_in_a_terminal(tmp_path):
    run = cmacexp.run(SHORT, tmp_path / "run")
    code = (
        f"import sys, threading; sys.argv = ['verify', {str(run.folder)!r}]; from cmacexp.report import terminal; "
        "terminal.SCREEN_DELAY = threading.TIMEOUT_MAX; from cmacexp.commands.verify import main; main(); "
        "print(sys.stdout.isatty(), 'rich' in sys.modules)"
    )
    master, slave = pty.openpty()
    subprocess.run([sys.executable, "-c", code], stdout=slave, stderr=slave, env=environment(TERM="xterm"))
    assert os.read(master, 10_000).decode().endswith("intact (diverged)\r\nTrue False\r\n")
    os.close(master), os.close(slave)


class Log(io.StringIO):
    """What is no terminal; holds up work until so many lines have been written."""

    def __init__(self, awaited=0):
        super().__init__()
        self.awaited, self.arrived = awaited, threading.Event()

    def write(self, text):
        written = super().write(text)
        if self.getvalue().count("\n") >= self.awaited:
            self.arrived.set()
        return written


def test_long_work_writes_lines_to_a_log(monkeypatch):
    monkeypatch.setattr(terminal, "FIRST_LINE_DELAY", 0.0)
    monkeypatch.setattr(terminal, "LINE_INTERVAL", 0.001)
    log = use_terminal(monkeypatch, Log(1))
    with progress("running", 12, "cycles") as watch:
        assert log.arrived.wait(60.0)
        log.awaited = 2
        log.arrived.clear()
        watch(5)
        assert log.arrived.wait(60.0)
    lines = log.getvalue().splitlines()
    assert lines == ["running: 0/12 cycles", "running: 5/12 cycles (41.7 %), 0 s left"], "none comes twice"
    log = use_terminal(monkeypatch, Log(1))
    with activity("reading") as show:
        assert log.arrived.wait(60.0)
        log.awaited = 2
        log.arrived.clear()
        show("drawing")
        assert log.arrived.wait(60.0)
    assert log.getvalue().splitlines() == ["reading ...", "drawing ..."]


def test_no_line_of_work_that_ends_soon(monkeypatch):
    monkeypatch.setattr(terminal, "FIRST_LINE_DELAY", 60.0)
    log = use_terminal(monkeypatch, io.StringIO())
    with progress("running", 12, "cycles") as watch:
        watch(5)
    assert not log.getvalue()


def test_work_of_other_processes_is_counted(monkeypatch):
    screen = use_terminal(monkeypatch, Terminal())
    with shared_progress("sweep", lambda: 4, "jobs"):
        share_progress(2)(0.5)
        share_progress(0)(1.0)
        wait_for(screen, "1/4 jobs (37.5 %)")
    share_progress(1)(0.5)  # nobody shows it


def test_processes_that_work_on_report_to_who_shows_it_now():
    with workers() as each:
        first, second = (each(what, os.getenv, [(VARIABLE,)]) for what in ("looking", "running"))
    assert first != second
