"""What a command prints never ends it: an output can be closed, full, or unable to show a character.

A line that is printed while a terminal shows the state of work takes its place.
"""

import io
import os
import sys
from functools import cache
from typing import Any, TextIO

from cmacexp.errors import in_one_line

CLEAR = "\r\x1b[2K"
"""Clears the line of a terminal."""


class _Output(io.FileIO):
    """An output of this process, which discards what it cannot write, e.g. when its reader has stopped."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return memoryview(data).nbytes


@cache
def keep_outputs() -> None:
    """Make the outputs of this process last to its end, whatever becomes of their readers.

    Streams that a caller has replaced, as a notebook does, stay as they are.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass  # the number of a closed output is taken, or the next file would get it and what is printed
    os.close(number)
    for name, number in {"stdout": 1, "stderr": 2}.items():
        stream = getattr(sys, name)
        if stream is None or (stream is getattr(sys, f"__{name}__") and isinstance(stream, io.TextIOWrapper)):
            buffer = io.BufferedWriter(_Output(number, "w", closefd=False))
            encoding, at_once = "utf-8", False
            if stream:
                encoding, at_once = stream.encoding, stream.line_buffering or stream.write_through
            setattr(sys, name, io.TextIOWrapper(buffer, encoding, "backslashreplace", line_buffering=at_once))


def is_screen(stream: TextIO) -> bool:
    """Whether an output is a terminal whose lines can be cleared."""
    return stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def print_line(text: str, error: bool = False) -> None:
    """Print one line at once; control characters, which a folder's name or a file can hold, as in Python.

    An output that is closed does no harm to the run, in a worker process either. In a terminal the line takes the
    place of the state of work that this process, or that of the sweep, may show there: all in one write, which no
    other process can interrupt.
    """
    keep_outputs()
    stream = sys.stderr if error else sys.stdout
    stream.write(f"{CLEAR if is_screen(stream) else ''}{in_one_line(text)}\n")
    stream.flush()
