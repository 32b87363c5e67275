"""Showing that a command works where it would be silent for long."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from cmacexp.report.terminal import say

SILENT = 2.0
"""Longest silence of a command whose output is no terminal, s."""


@contextmanager
def show_work(text: str) -> Iterator[None]:
    """Show ``text`` on stderr while the block runs: in a terminal with a spinner, else as a line if it takes long."""
    if sys.stderr.isatty():
        from rich.console import Console

        with Console(stderr=True).status(text):
            yield
        return
    timer = threading.Timer(SILENT, say, (f"{text} ...", True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
