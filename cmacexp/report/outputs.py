"""What a command prints never ends it: an output can be closed, full, or unable to show a character."""

import io
import os
import sys
from functools import cache
from typing import Any


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
