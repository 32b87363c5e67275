"""Tables in the terminal, as wide as that, and the key of their columns.

Tables are text without control characters, the same in a terminal, in a file and in a printed run. A terminal of 80
columns shows the cycles of a run; columns that do not fit side by side follow below, so that no number is folded.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from shutil import get_terminal_size
from textwrap import wrap

from cmacexp.data.run import Run
from cmacexp.data.tables import METRICS_CSV, Scores
from cmacexp.errors import in_one_line
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.pooling import shorten, tabulate_cycles
from cmacexp.metrics.registry import ALL_METRICS, MAIN
from cmacexp.metrics.run_table import tabulate_runs
from cmacexp.metrics.text import find_numeric
from cmacexp.terminal.output import print_line

WIDTH = 400
"""Most characters in a line of a table if the output is not a terminal."""
TEXT_WIDTH = 80
"""Most characters in a line of a key."""
KEY = "columns:   python -m cmacexp.report --key"
"""Printed below a table: the command that explains its columns."""
TITLE_WIDTH = 8
"""Most characters in a line of a title."""
GAP = 2
"""Characters between two columns."""


def _make_columns(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[list[str]]:
    """Each column as lines of equal length: those of its title, the last one with the unit, then a cell per row."""
    rows = [list(map(in_one_line, row)) for row in rows]
    height, numeric = 1 + max(title.count("\n") for title in titles), find_numeric(rows)
    for index, title in enumerate(titles):
        heading = [""] * (height - 1 - title.count("\n")) + list(map(in_one_line, title.split("\n")))
        lines = [*heading, *(row[index] for row in rows)]
        width = max(map(len, lines))
        yield [line.rjust(width) if index in numeric else line.ljust(width) for line in lines]


def format_table(titles: Sequence[str], rows: Sequence[Sequence[str]], width: int = TEXT_WIDTH) -> Iterator[str]:
    """Lines with rows under their titles; columns that do not fit into ``width`` follow below, after the first one.

    Titles may have line breaks; the unit is the last line.
    """
    first, *others = _make_columns(titles, rows)
    groups = [[first]]
    for column in others:
        if len(groups[-1]) > 1 and sum(len(lines[0]) + GAP for lines in groups[-1]) + len(column[0]) > width:
            groups.append([first])
        groups[-1].append(column)
    for group in groups:
        yield from ((" " * GAP).join(cells).rstrip() for cells in zip(*group, strict=True))


def print_table(
    titles: Sequence[str], rows: Sequence[Sequence[str]], what: str = "", place: object = "", count: int = 0
) -> None:
    """Print :func:`format_table`, as wide as the terminal; of many of ``what`` some, if all are in ``place``.

    ``count`` is how many there are if ``rows`` are only those that are shown.
    """
    shown = shorten(rows) if place else rows
    for line in format_table(titles, shown, get_terminal_size((WIDTH, 0)).columns):
        print_line(line)
    if len(shown) < (count := count or len(rows)):
        print_line(f"{len(shown)} of {count} {what}; all are in {place}")


def format_title(shown: MetricDisplay) -> str:
    """The title of a metric in short lines, and its unit."""
    hyphenated = shown.title.replace("overshoot", "over-shoot").replace("feedforward", "feed-forward")
    return "\n".join([*wrap(hyphenated, TITLE_WIDTH), shown.unit])


def print_key() -> None:
    """Print what the columns of metrics mean: name, symbol, meaning, name in the files, pooling over several legs."""
    for name, shown in MAIN.items():
        metric = ALL_METRICS[name]
        over_legs = f"; {metric.pooling.name} over legs" if metric.pooling.name and shown.over_legs else ""
        text = f"{shown.title:<21}{shown.symbol:<8}{metric.meaning} ({name}{over_legs})"
        print("\n".join(wrap(text, TEXT_WIDTH, subsequent_indent=" " * 29)))
    print(f"{'-':<29}undefined, e.g. where the force never settles")


def print_runs(runs: Sequence[Run], keys: Sequence[str], all_in: Path) -> None:
    """Print a table of runs; of many runs some, and where all are."""
    main, rows = tabulate_runs(shorten(runs), keys)
    titles = ["run\n", *(key.replace(".", ".\n") + "\n" for key in keys), "status\n", "cycles\ndone\n"]
    print_table([*titles, *map(format_title, main.values())], rows, "runs", all_in, len(runs))
    if main:
        print("metrics are those of the last whole cycle")
        print(KEY)


def format_scores(scores: Scores) -> list[str]:
    """The main metrics of a run per cycle, pooled over the legs, as lines; of a long run some cycles."""
    main, rows = tabulate_cycles(scores)
    return list(format_table(["cycle\n", *map(format_title, main.values())], shorten(rows)))


def print_scores(scores: Scores, folder: Path) -> None:
    """Print the main metrics of a run per cycle, pooled over the legs; of a long run some cycles."""
    main, rows = tabulate_cycles(scores)
    print_table(["cycle\n", *map(format_title, main.values())], rows, "cycles", folder / METRICS_CSV)
