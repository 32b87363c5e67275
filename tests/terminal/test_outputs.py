"""An output that is closed, full, or cannot show a character neither ends a command nor gives a stack trace."""

import os
import subprocess
import sys

import pytest
from support.command import environment
from support.doors import BadInput

CLOSE = "import os\nfor number in {closed}: os.close(number)\nos.execv({command[0]!r}, {command!r})"
PRINTS = """
import os, sys
from cmacexp.commands.command import run_command
from cmacexp.terminal.output import print_line

def work():
    held = os.open({file!r}, os.O_RDWR | os.O_CREAT)
    for text in ("m² ┃ 日本", "\\udcff", "x" * 100_000):
        print_line(text)
        print_line(text, error=True)
    os.write(held, b"data")
    print("end")

sys.exit(run_command(work))
"""


def printing(folder, closed=(), **options):
    """How a process that prints ends; files are closed by one that becomes it."""
    command = [sys.executable, "-c", PRINTS.format(file=str(folder / "data"))]
    if closed:
        command = [sys.executable, "-c", CLOSE.format(closed=closed, command=command)]
    return subprocess.run(
        command, **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": environment(), **options}
    )


@pytest.mark.ci
@pytest.mark.parametrize("closed", [[1], [0, 1, 2]])
def test_what_is_printed_into_a_closed_output_goes_nowhere(closed, tmp_path):
    done = printing(tmp_path, closed)
    assert (done.returncode, b"Traceback" in done.stderr) == (0, False)
    assert (tmp_path / "data").read_bytes() == b"data", "the file took the number of a closed output"


@pytest.mark.ci
def test_a_full_output_and_one_whose_reader_has_stopped_go_nowhere(tmp_path):
    reader, writer = os.pipe()
    os.close(reader)
    for output in (os.open("/dev/full", os.O_WRONLY), writer):
        done = printing(tmp_path, stdout=output)
        assert (done.returncode, b"Error" in done.stderr) == (0, False)


def test_a_message_quotes_the_ends_of_a_long_value_and_no_line_break():
    text = str(BadInput("a\nb", 10**400, "must be\x1b[2J less"))
    assert len(text) < 300
    assert text.isprintable()
    assert "x" * 240 in str(BadInput("key", "x" * 240, ""))
