"""Work that takes seconds shows that it goes on: in a terminal at once, in a log by a line now and then."""

import io
import os
import sys
import threading
import time

import pytest

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


def test_parts_of_known_number_are_counted_and_the_line_leaves(monkeypatch):
    screen = use_terminal(monkeypatch, Terminal())
    with progress("running", 12, "cycles") as watch:
        watch(5.5)
        while "5/12 cycles (45.8 %), " not in screen.getvalue():
            time.sleep(0.01)
    assert screen.getvalue().startswith("\r\x1b[2Krunning: 0/12 cycles")
    assert screen.getvalue().endswith("\x1b[2K")


@pytest.mark.parametrize(("seconds", "left"), [(3.0, "9 s"), (60.0, "3 min"), (7200.0, "6 h")])
def test_the_time_that_is_left_is_what_the_rest_takes_at_this_rate(seconds, left):
    assert format_progress("sweep", 1.5, 6, "jobs", seconds) == f"sweep: 1/6 jobs (25.0 %), {left} left"


def test_of_a_search_jobs_are_counted_without_a_total():
    assert format_progress("sweep", 1.5, 0, "jobs", 3.0) == "sweep: 1 jobs"


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
    monkeypatch.setattr(terminal, "FIRST_LINE_DELAY", 0.0)
    monkeypatch.setattr(terminal, "LINE_INTERVAL", 0.001)
    log = use_terminal(monkeypatch, Log(1))
    with progress("running", 12, "cycles") as watch:
        assert log.arrived.wait(60.0)
        log.awaited = log.getvalue().count("\n") + 2  # one may be on its way
        log.arrived.clear()
        watch(5)
        assert log.arrived.wait(60.0)
    lines = log.getvalue().splitlines()
    assert (lines[0], lines[-1]) == ("running: 0/12 cycles", "running: 5/12 cycles (41.7 %), 0 s left")
    log = use_terminal(monkeypatch, Log(1))
    with activity("reading") as show:
        assert log.arrived.wait(60.0)
        log.awaited = log.getvalue().count("\n") + 2
        log.arrived.clear()
        show("drawing")
        assert log.arrived.wait(60.0)
    lines = log.getvalue().splitlines()
    assert (lines[0], lines[-1]) == ("reading ...", "drawing ...")


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
        while "1/4 jobs (37.5 %)" not in screen.getvalue():
            time.sleep(0.01)
    share_progress(1)(0.5)  # nobody shows it


def test_processes_that_work_on_report_to_who_shows_it_now():
    with workers() as each:
        first, second = (each(what, os.getenv, [(VARIABLE,)]) for what in ("looking", "running"))
    assert first != second
