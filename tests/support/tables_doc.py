"""The tables of metrics and signals in the documentation, as the code declares every column.

After a change of a declaration, renew them with ``python tests/support/tables_doc.py`` and read the diff.
"""

import re
from pathlib import Path

from cmacexp.data import signals
from cmacexp.metrics.body import BODY_METRICS
from cmacexp.metrics.metric import CYCLE, LEG, Metric
from cmacexp.metrics.registry import METRICS
from cmacexp.metrics.tracking import SPATIAL

DOCS = Path(__file__).parents[2] / "docs"
COLUMNS = {
    "`metrics.parquet`": {"cycle": CYCLE, "leg": LEG, **METRICS},
    "`metrics.parquet` of a robot": SPATIAL,
    "`body_metrics.parquet`": {"cycle": CYCLE, **BODY_METRICS},
}
SIGNALS = {
    "`trace.parquet`": signals.LEG_SIGNALS,
    "`trace.parquet` of a robot": signals.SPATIAL_SIGNALS,
    "`trace.parquet` with a model": signals.MODEL_SIGNALS,
    "`body.parquet`": signals.BODY_SIGNALS,
    "`memory.parquet`": signals.MEMORY_SIGNALS,
}


def table_of(head, rows):
    return "".join("| " + " | ".join(cells) + " |\n" for cells in [head, ["---"] * len(head), *rows])


def shown_as(column):
    """Name, symbol and unit of a metric in tables and figures, its pooling, and which direction is better."""
    if not isinstance(column, Metric):
        return "-", "-", "-"
    shown = column.shown
    name = f"{shown.title} {shown.symbol}".rstrip() + f", {shown.unit}" if shown else "-"
    return name, column.pooling.name or "-", column.better or "-"


def metrics_table(columns):
    return table_of(
        ["column", "unit", "definition", "shown as", "over legs", "better", "NaN where", "source"],
        [[f"`{name}`", c.unit or "1", c.meaning, *shown_as(c), c.undefined, c.source] for name, c in columns.items()],
    )


def signals_table(columns):
    return table_of(
        ["column", "unit", "meaning", "type", "owner", "altered by", "present"],
        [
            [f"`{s.name}`", s.unit or "1", s.meaning, str(s.type), s.owner, ", ".join(s.altered_by), s.present]
            for s in columns
        ],
    )


def arrays_table():
    spatial = {signal.name for signal in signals.SPATIAL_SIGNALS}
    rows = [
        (
            name,
            *(", ".join(c for c in signals.ARRAYS[name] if (c in spatial) == third) for third in (False, True)),
            unit,
        )
        for name, unit in signals.list_units().items()
    ]
    return table_of(
        ["array", "columns", "third of a robot", "unit"], [(f"`{name}`", *cells) for name, *cells in rows]
    )


TABLES = {
    **{("metrics", heading): metrics_table(columns) for heading, columns in COLUMNS.items()},
    **{("signals", heading): signals_table(columns) for heading, columns in SIGNALS.items()},
    ("signals", "Arrays of components"): arrays_table(),
}
"""By the name of a page, and the heading in it."""


def find_table(page, heading):
    """The text of a page, and the first table below a heading in it."""
    text = (DOCS / f"{page}.md").read_text()
    return text, re.compile(r"(?:^\|.*\n)+", re.MULTILINE).search(text, text.index(f"\n## {heading}\n"))


if __name__ == "__main__":
    for (page, heading), table in TABLES.items():
        text, old = find_table(page, heading)
        (DOCS / f"{page}.md").write_text(text[: old.start()] + table + text[old.end() :])
