"""What is printed fits the terminal, and nothing is left out in silence."""

import io
import re
import sys

import pytest
from support.command import call

from cmacexp.report.run_summary import RunSummary, print_runs
from cmacexp.report.terminal import format_folder
from cmacexp.report.terminal_tables import print_table


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def narrow(monkeypatch):
    """Prints in a terminal of so many columns; what was printed, without what is bold."""

    def show(width, work, *arguments):
        monkeypatch.setenv("COLUMNS", str(width))
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr(sys, "stdout", screen := Terminal())
        work(*arguments)
        return re.sub(r"\x1b\[[\d;]*m", "", screen.getvalue())

    return show


def numbers_in(text):
    return [line.split() for line in text.splitlines() if line.split()[:1] and line.split()[0].isdecimal()]


def test_a_run_prints_a_table_of_80_columns_that_says_where_all_of_its_cycles_are(tmp_path):
    words = ("gait.cycle_time=0.5", "gait.stroke=0.02", "cycles=25", "record=metrics", "feedforward=none")
    printed = call("main", *words, "hydra.run.dir=r", folder=tmp_path).stdout
    assert max(len(line) for line in printed.splitlines() if str(tmp_path) not in line) <= 80
    assert [row[0] for row in numbers_in(printed)][::19] == ["1", "25"]
    assert "20 of 25 cycles; all are in " in printed


def test_the_key_of_metrics_fits_80_columns():
    lines = call("report", "--key").stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert any("(force_rmse" in line for line in lines)


WIDE = ["run", "first\nmm", "second\nmm", "third\nmm"], [["1", "2", "3", "[4]"], ["5", "6", "7", "8"]]


def test_columns_that_do_not_fit_follow_below_and_wide_cells_are_folded(narrow):
    printed = narrow(20, print_table, *WIDE)
    assert max(len(line.rstrip()) for line in printed.splitlines()) <= 20
    assert numbers_in(printed) == [["1", "2", "3"], ["5", "6", "7"], ["1", "[4]"], ["5", "8"]]
    assert narrow(20, print_table, ["run"], [["a" * 50]]).count("a") == 50


def test_a_table_is_the_same_in_a_terminal_and_in_a_file(narrow, capsys):
    """But for the rule below its titles and blanks at the ends of lines; what looks like markup is text."""
    print_table(*WIDE)
    printed = capsys.readouterr().out
    drawn = [line.rstrip() for line in narrow(80, print_table, *WIDE).splitlines()]
    assert set(drawn.pop(2)) == {"\u2500"}
    assert drawn == printed.splitlines()


def test_a_table_of_many_runs_says_where_all_of_them_are(narrow, tmp_path):
    runs = [RunSummary(tmp_path / str(number), "failed", "", {"a.b": number}) for number in range(30)]
    printed = narrow(80, print_runs, runs, ["a.b"], tmp_path / "sweep.csv")
    assert "20 of 30 runs; all are in " in printed


def test_a_folder_is_printed_as_a_command_takes_it(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert format_folder(tmp_path / "a run") == "'a run'"
    assert format_folder(tmp_path.parent) == str(tmp_path.parent)
