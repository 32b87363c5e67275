"""What a command is doing, shown to a person who watches its terminal."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def show_activity() -> Iterator[Callable[[str], None]]:
    """Gives ``say(text)``: the text stands on stderr, if that is a terminal, until the next one or the end."""
    if not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console

    with Console(stderr=True, highlight=False).status("") as status:
        yield lambda text: status.update(f"{text} ...")
