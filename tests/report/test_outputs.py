"""An output that is closed, full, or cannot show a character neither ends a command nor gives a stack trace."""

import os
import re
import subprocess
import sys

import pytest
from support.command import ROOT, environment, python

from cmacexp.errors import BadInput, format_value

CLOSE = "import os\nfor number in {closed}: os.close(number)\nos.execv({command[0]!r}, {command!r})"
PRINTS = """
import os, sys
from cmacexp.report.outputs import keep_outputs
keep_outputs()
held = os.open({file!r}, os.O_RDWR | os.O_CREAT)
for text in ("m² ┃ 日本", "\\udcff", "x" * 100_000):
    print(text)
    print(text, file=sys.stderr)
sys.stdout.flush()
os.write(held, b"data")
print("end")
"""


def run_with(closed, *arguments, **changes):
    """A command with closed files; the files are closed by a process that becomes the command."""
    command = [sys.executable, *arguments]
    code = CLOSE.format(closed=closed, command=command)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment(**changes), check=False)


@pytest.mark.parametrize("closed", [[1], [2], [0, 1, 2]])
def test_what_is_printed_into_a_closed_output_goes_nowhere(closed, tmp_path):
    file = tmp_path / "data"
    done = run_with(closed, "-c", PRINTS.format(file=str(file)))
    assert done.returncode == 0
    assert b"Traceback" not in done.stderr
    assert file.read_bytes() == b"data", "the file took the number of a closed output"


def test_a_full_output_and_one_whose_reader_has_stopped_go_nowhere(tmp_path):
    code = PRINTS.format(file=str(tmp_path / "data"))
    for end in ("/dev/full", None):
        reader, writer = os.pipe()
        os.close(reader)
        output = os.open(end, os.O_WRONLY) if end else writer
        done = subprocess.run([sys.executable, "-c", code], stdout=output, stderr=subprocess.PIPE, env=environment())
        assert done.returncode == 0
        assert b"Error" not in done.stderr.replace(b"x", b"")
        os.close(writer)


def test_a_character_that_an_output_cannot_show_is_written_as_in_python(tmp_path):
    done = python("-c", PRINTS.format(file=str(tmp_path / "data")), folder=tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0
    assert done.stdout.startswith(r"m\xb2 \u2503 \u65e5\u672c")
    assert done.stdout.endswith("end\n")


def test_a_run_without_outputs_completes(tmp_path):
    run = str(tmp_path / "run")
    done = run_with([1, 2], "-m", "cmacexp", "record=trace", "cycles=1", f"hydra.run.dir={run}")
    assert done.returncode == 0
    assert (tmp_path / "run" / "manifest.json").exists()


def test_files_are_written_as_utf_8_whatever_the_locale():
    for path in (ROOT / "cmacexp").rglob("*.py"):
        for text in re.findall(r"(?<!place)(?<!self)\.write_text\((?:[^()]|\([^()]*\))*\)", path.read_text("utf-8")):
            assert "encoding=" in text or ("ensure_ascii" not in text and "json.dumps" in text), f"{path}: {text}"


@pytest.mark.parametrize(
    "words",
    [
        ("cmacexp.verify", "a\nb"),
        ("cmacexp.verify",),
        ("cmacexp.report", ".", "--no-such-option"),
        ("cmacexp.study", "no.py", "--seeds", "²"),
        ("cmacexp", "cycles=1", "-x"),
        ("cmacexp", "optimize='a\nb'"),
    ],
)
def test_a_refusal_is_one_line(words, tmp_path):
    done = python("-m", *words, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1


def test_a_message_quotes_the_ends_of_a_long_value_and_no_line_break():
    error = BadInput("a\nb", 10**400, "must be\x1b[2J less")
    assert str(error) == rf"a\nb=1{'0' * 119}...{'0' * 60} (401 characters): must be\x1b[2J less"
    assert format_value("x" * 240) == "x" * 240


WRONG = """
import argparse, sys
from cmacexp.commands.main import main
before = argparse.ArgumentParser.error
sys.argv = ["cmacexp", "--unheard-of"]
try:
    main()
except SystemExit as end:
    print(end.code, argparse.ArgumentParser.error is before)
"""


def test_a_wrong_option_is_one_line_and_the_parsers_of_others_stay_as_they_are(tmp_path):
    done = python("-c", WRONG, folder=tmp_path)
    assert done.stdout == "2 True\n"
    assert done.stderr.startswith("error: unrecognized arguments: --unheard-of; ")
    assert done.stderr.count("\n") == 1
