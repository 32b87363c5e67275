"""Work that takes seconds shows that it goes on: in a terminal at once, in a log by a line now and then."""

import io
import sys
import threading

import pytest

import cmacexp
from cmacexp.commands import main as command_line
from cmacexp.commands.score import main as score
from cmacexp.commands.verify import main as verify
from cmacexp.report import terminal
from cmacexp.report.terminal import activity, progress


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


def test_parts_of_known_number_are_counted_and_the_bar_leaves(monkeypatch):
    screen = use_terminal(monkeypatch, Terminal())
    with progress("running", 12, "cycles") as watch:
        watch(5)
    assert "running" in screen.getvalue()
    assert "5/12" in screen.getvalue()
    assert screen.getvalue().endswith("\x1b[2K")  # the line is cleared


def test_a_command_of_unknown_length_shows_what_it_does(monkeypatch, tmp_path):
    run = cmacexp.run(["cycles=1", "sampling_period=0.05", "record=trace"], tmp_path)
    monkeypatch.setattr(sys, "argv", ["score", str(run.folder)])
    screen = use_terminal(monkeypatch, Terminal())
    assert score() == 0
    assert "scoring" in screen.getvalue()
    monkeypatch.setattr(sys, "argv", ["verify", str(run.folder)])
    assert verify() == 0
    assert "checking" in screen.getvalue()


def test_planning_is_shown(monkeypatch, tmp_path):
    words = ["cycles=1", "sampling_period=0.05", "record=trace", f"hydra.run.dir={tmp_path / 'run'}"]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["cmacexp", *words])
    screen = use_terminal(monkeypatch, Terminal())
    assert command_line.main() == 3  # so coarse a step diverges at once
    assert "planning 60 steps a cycle" in screen.getvalue()


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
    monkeypatch.setattr(terminal, "LATE", 0.0)
    monkeypatch.setattr(terminal, "OFTEN", 0.001)
    log = use_terminal(monkeypatch, Log(1))
    with progress("running", 12, "cycles") as watch:
        assert log.arrived.wait(60.0)
        log.awaited = log.getvalue().count("\n") + 2  # one may be on its way
        log.arrived.clear()
        watch(5)
        assert log.arrived.wait(60.0)
    lines = log.getvalue().splitlines()
    assert (lines[0], lines[-1]) == ("running: 0/12 cycles", "running: 5/12 cycles")
    log = use_terminal(monkeypatch, Log(1))
    with activity("reading") as show:
        assert log.arrived.wait(60.0)
        log.awaited = log.getvalue().count("\n") + 2
        log.arrived.clear()
        show("drawing")
        assert log.arrived.wait(60.0)
    lines = log.getvalue().splitlines()
    assert (lines[0], lines[-1]) == ("reading ...", "drawing ...")


@pytest.mark.parametrize(("stream", "shown"), [(io.StringIO(), True), (Terminal(), False)])
def test_no_line_of_work_that_ends_soon_and_no_bar_where_nobody_looks_or_others_draw(stream, shown, monkeypatch):
    monkeypatch.setattr(terminal, "LATE", 60.0)
    use_terminal(monkeypatch, stream)
    with progress("running", 12, "cycles", shown=shown) as watch:
        watch(5)
    assert not stream.getvalue()
