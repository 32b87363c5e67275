"""Work that takes seconds shows that it goes on, to a person at a terminal only."""

import io
import sys

import pytest

import cmacexp
from cmacexp.cli import main as command_line
from cmacexp.report.terminal import progress
from cmacexp.score import main as score
from cmacexp.verify import main as verify


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
    terminal = use_terminal(monkeypatch, Terminal())
    with progress("running", 12, "cycles") as watch:
        watch(5)
    assert "running" in terminal.getvalue()
    assert "5/12" in terminal.getvalue()
    assert terminal.getvalue().endswith("\x1b[2K")  # the line is cleared


def test_a_command_of_unknown_length_shows_what_it_does(monkeypatch, tmp_path):
    run = cmacexp.run(["cycles=1", "sampling_period=0.05", "record=trace"], tmp_path)
    monkeypatch.setattr(sys, "argv", ["score", str(run.folder)])
    terminal = use_terminal(monkeypatch, Terminal())
    assert score() == 0
    assert "scoring" in terminal.getvalue()
    monkeypatch.setattr(sys, "argv", ["verify", str(run.folder)])
    assert verify() == 0
    assert "checking" in terminal.getvalue()


@pytest.mark.parametrize(("quick", "shown"), [(59, True), (60, False)])
def test_planning_of_a_long_cycle_is_shown(monkeypatch, tmp_path, quick, shown):
    words = ["cycles=1", "sampling_period=0.05", "record=trace", f"hydra.run.dir={tmp_path / 'run'}"]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["cmacexp", *words])
    monkeypatch.setattr(command_line, "QUICK", quick)
    terminal = use_terminal(monkeypatch, Terminal())
    assert command_line.main() == 3  # so coarse a step diverges at once
    assert ("planning 60 steps a cycle" in terminal.getvalue()) == shown


@pytest.mark.parametrize(("stream", "shown"), [(io.StringIO(), True), (Terminal(), False)])
def test_no_bar_where_nobody_looks_or_others_draw(stream, shown, monkeypatch):
    use_terminal(monkeypatch, stream)
    with progress("running", 12, "cycles", shown=shown) as watch:
        watch(5)
    assert not stream.getvalue()
