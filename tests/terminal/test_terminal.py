"""What is printed fits the terminal, and nothing is left out in silence."""

from support.command import call

import cmacexp
from cmacexp.terminal.messages import print_table


def numbers_in(text):
    return [line.split() for line in text.splitlines() if line.split()[:1] and line.split()[0].isdecimal()]


def test_a_run_prints_a_table_of_80_columns_that_says_where_all_of_its_cycles_are(tmp_path):
    words = ("scenario=force_step", "gait.cycle_time=0.3", "sampling_period=0.01", "cycles=25", "record=metrics")
    printed = call("main", *words, "hydra.run.dir=r", folder=tmp_path).stdout
    assert max(len(line) for line in printed.splitlines() if str(tmp_path) not in line) <= 80
    assert [row[0] for row in numbers_in(printed)][::19] == ["1", "25"]
    assert "20 of 25 cycles; all are in " in printed
    assert str(cmacexp.load(tmp_path / "r")).partition("\n")[2] in printed  # the README shows it


WIDE = ["run", "first\nmm", "second\nmm", "third\nmm"], [["1", "2", "3", "[4]"], ["5", "6", "7", "8"]]


def test_columns_that_do_not_fit_follow_below_as_text_without_control_characters(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "20")
    print_table(*WIDE)
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 20
    assert printed.replace("\n", "").isprintable()
    assert numbers_in(printed) == [["1", "2", "3"], ["5", "6", "7"], ["1", "[4]"], ["5", "8"]]
