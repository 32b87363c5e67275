"""What is printed fits the terminal, and nothing is left out in silence."""

import io
import re
import sys

import numpy as np
import pytest

from cmacexp.data.tables import Scores
from cmacexp.metrics.body import BODY_METRICS
from cmacexp.metrics.metric import CYCLE, LEG, to_table
from cmacexp.metrics.pooling import is_shown
from cmacexp.metrics.registry import MAIN, METRICS, SHOWN
from cmacexp.metrics.tracking import SPATIAL
from cmacexp.report.run_summary import RunSummary, print_runs
from cmacexp.report.terminal import format_folder
from cmacexp.report.terminal_tables import head, print_key, print_scores, print_table


def make_scores(legs, cycles, metrics=METRICS):
    values = {name: np.full((cycles, legs), 9.0) for name in metrics}
    if legs == 1:
        values["force_rmse_three_feet"][:] = np.nan
    cycle, leg = np.repeat(np.arange(1, cycles + 1), legs), np.tile(np.arange(1, legs + 1), cycles)
    body = {name: np.full(cycles, 0.009) for name in BODY_METRICS}
    own = to_table({"cycle": (CYCLE, np.arange(1, cycles + 1))}, body, BODY_METRICS) if legs > 1 else None
    return Scores(to_table({"cycle": (CYCLE, cycle), "leg": (LEG, leg)}, values, metrics), own)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def narrow(monkeypatch):
    """Prints in a terminal of so many columns; what was printed, without what is bold."""

    def call(width, work, *arguments):
        monkeypatch.setenv("COLUMNS", str(width))
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr(sys, "stdout", screen := Terminal())
        work(*arguments)
        return re.sub(r"\x1b\[[\d;]*m", "", screen.getvalue())

    return call


def numbers_in(text):
    return [line.split() for line in text.splitlines() if line.split()[:1] and line.split()[0].isdecimal()]


@pytest.mark.parametrize(("legs", "metrics"), [(1, METRICS), (4, METRICS), (4, {**METRICS, **SPATIAL})])
def test_the_table_of_a_run_fits_80_columns_in_one_piece(legs, metrics, narrow, tmp_path):
    printed = narrow(80, print_scores, make_scores(legs, 5, metrics), tmp_path)
    assert max(map(len, printed.splitlines())) <= 80
    shown = sum(is_shown(name, metrics, legs) for name in metrics if name in MAIN) + (3 if legs > 1 else -1)
    assert [len(row) for row in numbers_in(printed)] == [1 + shown] * 5


def test_the_key_has_the_name_symbol_and_column_of_all_metrics_in_tables(capsys):
    print_key()
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    for name, shown in MAIN.items():
        assert any(line.startswith(f"{shown.title:<21}{shown.symbol} ") for line in lines)
        assert f"({name}" in " ".join(map(str.strip, lines))
    symbols = [shown.symbol for shown in SHOWN.values() if shown.symbol]
    assert len(set(symbols)) == len(symbols)
    assert len({shown.title for shown in SHOWN.values()}) == len(SHOWN)


WIDE = ["run", "first\nmm", "second\nmm", "third\nmm"], [["1", "2", "3", "[4]"], ["5", "6", "7", "8"]]


def test_columns_that_do_not_fit_follow_below(narrow):
    printed = narrow(20, print_table, *WIDE)
    assert max(len(line.rstrip()) for line in printed.splitlines()) <= 20
    assert numbers_in(printed) == [["1", "2", "3"], ["5", "6", "7"], ["1", "[4]"], ["5", "8"]]


def test_a_table_is_the_same_in_a_terminal_and_in_a_file(narrow, capsys):
    """But for the rule below its titles and blanks at the ends of lines; what looks like markup is text."""
    print_table(*WIDE)
    printed = capsys.readouterr().out
    assert (
        printed
        == "     first  second  third\nrun     mm      mm  mm\n  1      2       3  [4]\n  5      6       7  8\n"
    )
    drawn = [line.rstrip() for line in narrow(80, print_table, *WIDE).splitlines()]
    assert drawn.pop(2) == "\u2500" * 25
    assert drawn == printed.splitlines()


def test_a_cell_wider_than_the_terminal_is_folded_not_cut(narrow):
    assert narrow(20, print_table, ["run"], [["a" * 50]]).count("a") == 50


def test_a_long_run_says_where_all_of_its_cycles_are(narrow, tmp_path):
    printed = narrow(80, print_scores, make_scores(1, 60), tmp_path)
    assert [row[0] for row in numbers_in(printed)][:6] == ["1", "2", "3", "4", "5", "6"]
    assert [row[0] for row in numbers_in(printed)][-1] == "20"  # "20 of 60 cycles", after the last row
    assert f"20 of 60 cycles; all are in {tmp_path / 'metrics.csv'}" in printed.replace("\n", "")


def test_a_table_of_many_runs_says_where_all_of_them_are(narrow, tmp_path):
    runs = [RunSummary(tmp_path / str(number), "failed", "", {"a.b": number}) for number in range(30)]
    printed = narrow(80, print_runs, runs, ["a.b"], tmp_path / "sweep.csv")
    assert "20 of 30 runs; all are in " in printed
    assert "metrics" not in printed  # none is defined


def test_short_titles_are_shorter_and_differ():
    heads = [head(shown).split("\n")[:-1] for shown in MAIN.values()]
    assert len({tuple(lines) for lines in heads}) == len(heads)
    assert max(len(line) for lines in heads for line in lines) <= 8


def test_a_folder_is_printed_as_a_command_takes_it(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert format_folder(tmp_path / "a run") == "'a run'"
    assert format_folder(tmp_path.parent) == str(tmp_path.parent)
