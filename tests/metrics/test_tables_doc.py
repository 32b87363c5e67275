"""The documentation of metrics and signals describes every column as the code defines it.

After a change of a definition, renew its tables with ``python tests/commands/test_tables_doc.py`` and read the diff.
"""

import re
from pathlib import Path

import pytest

from cmacexp.data.signals import (
    ARRAYS,
    BODY_SIGNALS,
    LEG_SIGNALS,
    MEMORY_SIGNALS,
    MODEL_SIGNALS,
    SPATIAL_SIGNALS,
    list_units,
)
from cmacexp.metrics.body import BODY_METRICS
from cmacexp.metrics.metric import CONTRACT, CYCLE, LEG, Metric, describe
from cmacexp.metrics.registry import METRICS
from cmacexp.metrics.tracking import SPATIAL

DOCS = Path(__file__).parents[2] / "docs"
LEGS, ROBOT = "`metrics.parquet`", "`metrics.parquet` of a robot"
COLUMNS = {
    LEGS: {"cycle": CYCLE, "leg": LEG, **METRICS},
    ROBOT: SPATIAL,
    "`body_metrics.parquet`": {"cycle": CYCLE, **BODY_METRICS},
}
SIGNALS = {
    "`trace.parquet`": LEG_SIGNALS,
    "`trace.parquet` of a robot": SPATIAL_SIGNALS,
    "`trace.parquet` with a model": MODEL_SIGNALS,
    "`body.parquet`": BODY_SIGNALS,
    "`memory.parquet`": MEMORY_SIGNALS,
}


def table_of(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(cells) + " |\n" for cells in lines)


def judgement(column):
    """How a column is pooled over the legs and which direction is better; neither for an index."""
    return (column.pooling.name or "-", column.better or "-") if isinstance(column, Metric) else ("-", "-")


def appearance(column):
    """Name, symbol and unit of a column in tables and figures."""
    shown = column.shown if isinstance(column, Metric) else None
    return f"{shown.title} {shown.symbol}".rstrip() + f", {shown.unit}" if shown else "-"


def metrics_table(columns):
    return table_of(
        ["column", "unit", "definition", "shown as", "over legs", "better", "NaN where", "source"],
        [
            [f"`{name}`", c.unit or "1", c.meaning, appearance(c), *judgement(c), c.undefined, c.source]
            for name, c in columns.items()
        ],
    )


def signals_table(signals):
    return table_of(
        ["column", "unit", "meaning", "type", "owner", "altered by", "present"],
        [
            [f"`{s.name}`", s.unit or "1", s.meaning, str(s.type), s.owner, ", ".join(s.altered_by), s.present]
            for s in signals
        ],
    )


def arrays_table():
    spatial = {signal.name for signal in SPATIAL_SIGNALS}
    return table_of(
        ["array", "columns", "third of a robot", "unit"],
        [
            [
                f"`{name}`",
                ", ".join(column for column in ARRAYS[name] if column not in spatial),
                ", ".join(column for column in ARRAYS[name] if column in spatial),
                unit,
            ]
            for name, unit in list_units().items()
        ],
    )


TABLES = {
    **{("metrics", heading): metrics_table(columns) for heading, columns in COLUMNS.items()},
    **{("signals", heading): signals_table(signals) for heading, signals in SIGNALS.items()},
    ("signals", "Arrays of components"): arrays_table(),
}
"""By the name of a page, and the heading in it."""


def table_below(text, heading):
    """The first table below a heading, with where it stands."""
    return re.compile(r"(?:^\|.*\n)+", re.MULTILINE).search(text, text.index(f"\n## {heading}\n"))


def write():
    for (page, heading), table in TABLES.items():
        text = (path := DOCS / f"{page}.md").read_text()
        old = table_below(text, heading)
        path.write_text(text[: old.start()] + table + text[old.end() :])


@pytest.mark.parametrize(("page", "heading"), TABLES)
def test_a_page_has_every_column_as_it_is_declared(page, heading):
    assert table_below((DOCS / f"{page}.md").read_text(), heading)[0] == TABLES[page, heading]


@pytest.mark.parametrize("headings", [[LEGS], [LEGS, ROBOT]], ids=["plane", "space"])
def test_the_page_speaks_of_the_columns_that_are_written(headings):
    from support.made_traces import compute, make_trace  # not where this file runs as a script

    table = compute(make_trace("TTSS", in_space=ROBOT in headings), 4)
    columns = {name: column for heading in headings for name, column in COLUMNS[heading].items()}
    assert table.column_names == list(columns)
    for name, column in columns.items():
        about = table.schema.field(name).metadata
        assert {key.decode(): text.decode() for key, text in about.items()} == describe(column)


@pytest.mark.parametrize("columns", COLUMNS.values(), ids=COLUMNS)
def test_every_source_is_listed_in_full(columns):
    listed = (DOCS / "metrics.md").read_text().split("\n## Sources\n")[1]
    for column in columns.values():
        authors = CONTRACT if column.source == CONTRACT else re.search(r"[A-Z][^:]*? \d{4}", column.source)[0]
        assert f"- **{authors}**" in listed


if __name__ == "__main__":
    write()
