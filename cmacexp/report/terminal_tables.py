"""Tables in the terminal: as wide as the terminal; the key of their columns."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from cmacexp.data.tables import METRICS_CSV, Scores
from cmacexp.errors import in_one_line
from cmacexp.metrics.metric import Shown
from cmacexp.metrics.pooling import shorten, tabulate_cycles
from cmacexp.metrics.registry import ALL_METRICS, MAIN
from cmacexp.report.parts import Table

WIDTH = 400
"""Most characters in a line of a table if the output is not a terminal."""
TEXT_WIDTH = 80
"""Most characters in a line of a key."""
KEY = "columns:   python -m cmacexp.report --key"
"""Printed below a table: the command that explains its columns."""
HEAD_WIDTH = 8
"""Most characters in a line of a title."""
GAP = 2


def _terminal_width() -> int:
    from rich.console import Console

    return Console().width if sys.stdout.isatty() else WIDTH


def _split(widths: Sequence[int], line: int, repeated: int) -> Iterator[list[int]]:
    """Columns that fit into a line side by side; the first ``repeated`` begin every group."""
    group: list[int] = []
    for column, width in enumerate(widths):
        if len(group) > repeated and sum(widths[i] + GAP for i in group) + width > line:
            yield group
            group = list(range(repeated))
        group.append(column)
    yield group


def print_table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows under their titles; columns that do not fit into a line follow below, after the first one.

    Titles may have line breaks; the unit is the last line.
    """
    from rich.console import Console
    from rich.table import Table as Grid
    from rich.text import Text

    titles = ["\n".join(map(in_one_line, title.split("\n"))) for title in titles]
    rows = [[in_one_line(cell) for cell in row] for row in rows]
    cells = [titles, *rows]
    widths = [max(len(line) for row in cells for line in row[i].split("\n")) for i in range(len(titles))]
    width, numeric = _terminal_width(), Table(titles, rows).numeric
    for group in _split(widths, width, repeated=1):
        grid = Grid(box=None, pad_edge=False, padding=(0, GAP, 0, 0), header_style="bold")
        for i in group:
            grid.add_column(Text(titles[i]), justify="right" if i in numeric else "left", overflow="fold")
        for row in rows:
            grid.add_row(*(Text(row[i]) for i in group))
        Console(highlight=False, width=width).print(grid)


def head(shown: Shown) -> str:
    """Name of a metric in short lines, and its unit."""
    from textwrap import wrap

    hyphenated = shown.title.replace("overshoot", "over-shoot").replace("feedforward", "feed-forward")
    return "\n".join([*wrap(hyphenated, HEAD_WIDTH), shown.unit])


def print_key() -> None:
    """Print what the columns of metrics mean: name, symbol, meaning, name in the files, pooling over several legs."""
    from textwrap import wrap

    for name, shown in MAIN.items():
        metric = ALL_METRICS[name]
        over_legs = f"; {metric.pooling.name} over legs" if metric.pooling.name and shown.over_legs else ""
        text = f"{shown.title:<21}{shown.symbol:<8}{metric.meaning} ({name}{over_legs})"
        print("\n".join(wrap(text, TEXT_WIDTH, subsequent_indent=" " * 29)))


def print_scores(scores: Scores, folder: Path) -> None:
    """Print the main metrics of a run per cycle, pooled over the legs; of a long run some cycles."""
    main, rows = tabulate_cycles(scores)
    shown = shorten(rows)
    print_table(["cycle\n", *map(head, main.values())], shown)
    if len(shown) < len(rows):
        print(in_one_line(f"{len(shown)} of {len(rows)} cycles; all are in {folder / METRICS_CSV}"))
