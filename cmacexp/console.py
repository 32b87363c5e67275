"""A table in the terminal."""

import sys
from collections.abc import Sequence

WIDTH = 400
"""Most characters in a line where no person watches; a table takes what it needs."""


def print_table(titles: Sequence[str], rows: Sequence[Sequence[str]], left: int = 0) -> None:
    """Print rows under their titles.

    Args:
        titles: of the columns; what follows a line break is the unit.
        rows: cells as text.
        left: so many columns hold text and stand to the left.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, title in enumerate(titles):
        table.add_column(title, justify="left" if index < left else "right")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH).print(table)
