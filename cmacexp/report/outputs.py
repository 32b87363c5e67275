"""What a command prints never ends it: an output can be closed, full, or unable to show a character."""

import io
import os
import sys
from functools import cache
from typing import Any

OUTPUTS = {"stdin": 0, "stdout": 1, "stderr": 2}
"""File numbers of the streams of :mod:`sys`."""


class _Output(io.FileIO):
    """An output of this process, which discards what it cannot write, e.g. when its reader has stopped."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError:
            os.dup2(_open_nothing(), self.fileno())
            return memoryview(data).nbytes


def _open_nothing() -> int:
    return os.open(os.devnull, os.O_RDWR)


def _open_closed(number: int) -> None:
    """Open a file number if it is closed, or the next file that this process writes would take what it prints."""
    try:
        os.fstat(number)
    except OSError:
        opened = _open_nothing()
        if opened != number:
            os.dup2(opened, number)
            os.close(opened)


@cache
def keep_outputs() -> None:
    """Make the outputs of this process last to its end, whatever becomes of their readers.

    Streams that a caller has replaced, as a notebook does, stay as they are.
    """
    for name, number in OUTPUTS.items():
        stream, original = getattr(sys, name), getattr(sys, f"__{name}__")
        if stream is None:
            _open_closed(number)
            nothing = io.FileIO(_open_nothing(), "r+")
            setattr(
                sys,
                name,
                io.TextIOWrapper(io.BufferedRWPair(nothing, nothing), encoding="utf-8", errors="backslashreplace"),
            )
        elif name != "stdin" and stream is original and isinstance(stream, io.TextIOWrapper):
            stream.flush()
            buffer = io.BufferedWriter(_Output(stream.fileno(), "w", closefd=False))
            lasting = io.TextIOWrapper(
                buffer,
                encoding=stream.encoding,
                errors="backslashreplace",
                line_buffering=stream.line_buffering or stream.write_through,
            )
            setattr(sys, name, lasting)
