"""The documentation of the metrics describes every column as the code defines it.

After a change of a definition, renew its tables with ``python tests/commands/test_metrics_doc.py`` and read the diff.
"""

import re
from pathlib import Path

import pytest

from cmacexp.metrics import compute
from cmacexp.metrics.body import BODY_METRICS
from cmacexp.metrics.metric import CONTRACT, CYCLE, LEG, Metric, describe
from cmacexp.metrics.registry import METRICS, OF_A_ROBOT

PAGE = Path(__file__).parents[2] / "docs" / "metrics.md"
LEGS, ROBOT = "`metrics.parquet`", "`metrics.parquet` of a robot"
COLUMNS = {
    LEGS: {"cycle": CYCLE, "leg": LEG, **METRICS},
    ROBOT: OF_A_ROBOT,
    "`body_metrics.parquet`": {"cycle": CYCLE, **BODY_METRICS},
}
HEAD = ["column", "unit", "definition", "over legs", "better", "NaN where", "source"]


def line(cells):
    return "| " + " | ".join(cells) + " |\n"


def judgement(column):
    """How a column is pooled over the legs and which direction is better; neither for an index."""
    return (column.pooling.name or "-", column.better or "-") if isinstance(column, Metric) else ("-", "-")


def table_of(columns):
    """The table that is to stand in the page."""
    rows = [
        [f"`{name}`", c.unit or "1", c.meaning, *judgement(c), c.undefined, c.source] for name, c in columns.items()
    ]
    return line(HEAD) + "|---" * len(HEAD) + "|\n" + "".join(map(line, rows))


def table_below(text, heading):
    """The first table below a heading, with where it stands."""
    return re.compile(r"(?:^\|.*\n)+", re.MULTILINE).search(text, text.index(f"\n## {heading}\n"))


def write():
    for heading, columns in COLUMNS.items():
        text = PAGE.read_text()
        old = table_below(text, heading)
        PAGE.write_text(text[: old.start()] + table_of(columns) + text[old.end() :])


@pytest.mark.parametrize("heading", COLUMNS)
def test_the_page_has_every_column_with_unit_definition_and_source(heading):
    assert table_below(PAGE.read_text(), heading)[0] == table_of(COLUMNS[heading])


@pytest.mark.parametrize("headings", [[LEGS], [LEGS, ROBOT]], ids=["plane", "space"])
def test_the_page_speaks_of_the_columns_that_are_written(headings):
    from support.made_traces import make_trace  # not where this file runs as a script

    table = compute(make_trace("TTSS", in_space=ROBOT in headings), 4)
    columns = {name: column for heading in headings for name, column in COLUMNS[heading].items()}
    assert table.column_names == list(columns)
    for name, column in columns.items():
        about = table.schema.field(name).metadata
        assert {key.decode(): text.decode() for key, text in about.items()} == describe(column)


@pytest.mark.parametrize("columns", COLUMNS.values(), ids=COLUMNS)
def test_every_source_is_listed_in_full(columns):
    listed = PAGE.read_text().split("\n## Sources\n")[1]
    for column in columns.values():
        authors = CONTRACT if column.source == CONTRACT else re.search(r"[A-Z][^:]*? \d{4}", column.source)[0]
        assert f"- **{authors}**" in listed


if __name__ == "__main__":
    write()
