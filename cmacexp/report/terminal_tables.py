"""Tables in the terminal: as wide as the terminal; the key of their columns."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from shutil import get_terminal_size

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
    return get_terminal_size().columns if sys.stdout.isatty() else WIDTH


def _split(widths: Sequence[int], line: int, repeated: int) -> Iterator[list[int]]:
    """Columns that fit into a line side by side; the first ``repeated`` begin every group."""
    group: list[int] = []
    for column, width in enumerate(widths):
        if len(group) > repeated and sum(widths[i] + GAP for i in group) + width > line:
            yield group
            group = list(range(repeated))
        group.append(column)
    yield group


def format_table(
    titles: Sequence[str], rows: Sequence[Sequence[str]], width: int = TEXT_WIDTH, bold: Sequence[str] = ("", "")
) -> Iterator[str]:
    """Lines with rows under their titles; columns that do not fit into ``width`` follow below, after the first one.

    Titles may have line breaks; the unit is the last line. ``bold`` begins and ends a line of titles.
    """
    heads, rows = [title.split("\n") for title in titles], [list(map(in_one_line, row)) for row in rows]
    height, numeric, columns = max(map(len, heads)), Table(titles, rows).numeric, []
    for i, head in enumerate(heads):
        lines = [*[""] * (height - len(head)), *map(in_one_line, head), *(row[i] for row in rows)]
        widest = max(map(len, lines))
        columns.append([line.rjust(widest) if i in numeric else line.ljust(widest) for line in lines])
    for group in _split([len(column[0]) for column in columns], width, repeated=1):
        for number, cells in enumerate(zip(*(columns[i] for i in group), strict=True)):
            line = (" " * GAP).join(cells).rstrip()
            yield line.join(bold) if number < height else line


def print_table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print :func:`format_table`, as wide as the terminal."""
    bold = ("\x1b[1m", "\x1b[0m") if sys.stdout.isatty() else ("", "")
    print("\n".join(format_table(titles, rows, _terminal_width(), bold)))


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
    print(f"{'-':<29}undefined, e.g. where the force never settles")


def print_scores(scores: Scores, folder: Path) -> None:
    """Print the main metrics of a run per cycle, pooled over the legs; of a long run some cycles."""
    main, rows = tabulate_cycles(scores)
    shown = shorten(rows)
    print_table(["cycle\n", *map(head, main.values())], shown)
    if len(shown) < len(rows):
        print(in_one_line(f"{len(shown)} of {len(rows)} cycles; all are in {folder / METRICS_CSV}"))
