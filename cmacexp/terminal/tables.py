"""Tables in the terminal: as wide as the terminal; the key of their columns."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from cmacexp.data.tables import METRICS_CSV, Scores
from cmacexp.errors import in_one_line
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.pooling import shorten, tabulate_cycles
from cmacexp.metrics.registry import ALL_METRICS, MAIN
from cmacexp.metrics.text import find_numeric

WIDTH = 400
"""Most characters in a line of a table if the output is not a terminal."""
TEXT_WIDTH = 80
"""Most characters in a line of a key."""
KEY = "columns:   python -m cmacexp.report --key"
"""Printed below a table: the command that explains its columns."""
HEAD_WIDTH = 8
"""Most characters in a line of a title."""
GAP = 2


def _arrange(titles: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> Iterator[list[list[str]]]:
    """The columns that fit into ``width`` side by side, group by group; the first column begins every group.

    A column is lines of equal length: those of its title, whose last one is the unit, then a cell for each row.
    """
    rows = [list(map(in_one_line, row)) for row in rows]
    height, numeric = 1 + max(title.count("\n") for title in titles), find_numeric(rows)
    group = list[list[str]]()
    for i, title in enumerate(titles):
        lines = [*map(in_one_line, title.split("\n")), *(row[i] for row in rows)]
        lines = [*[""] * (height + len(rows) - len(lines)), *lines]
        widest = max(map(len, lines))
        if len(group) > 1 and sum(len(column[0]) + GAP for column in group) + widest > width:
            yield group
            group = group[:1]
        group = [*group, [line.rjust(widest) if i in numeric else line.ljust(widest) for line in lines]]
    yield group


def format_table(titles: Sequence[str], rows: Sequence[Sequence[str]], width: int = TEXT_WIDTH) -> Iterator[str]:
    """Lines with rows under their titles; columns that do not fit into ``width`` follow below, after the first one.

    Titles may have line breaks; the unit is the last line.
    """
    for group in _arrange(titles, rows, width):
        yield from ((" " * GAP).join(cells).rstrip() for cells in zip(*group, strict=True))


def print_table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print :func:`format_table`; in a terminal by rich, as wide as that."""
    if not sys.stdout.isatty():
        print("\n".join(format_table(titles, rows, WIDTH)))
        return
    from rich import box, console, table

    screen = console.Console(markup=False, highlight=False, emoji=False)
    for group in _arrange(titles, rows, screen.width):
        height = len(group[0]) - len(rows)
        heads = [table.Column("\n".join(lines[:height]), overflow="fold") for lines in group]
        grid = table.Table(*heads, box=box.SIMPLE_HEAD, show_edge=False, padding=(0, GAP - 1, 0, 0), pad_edge=False)
        for cells in zip(*(lines[height:] for lines in group), strict=True):
            grid.add_row(*cells)
        screen.print(grid)


def head(shown: MetricDisplay) -> str:
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
