"""Tables of metrics and signals in the documentation, from the declaration of every column in the code.

A page has ``{{ declared }}`` below the heading of a table; mkdocs replaces it when it builds the site, so an addition
needs no edit of the page.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from cmacexp.data import signals
from cmacexp.metrics.body import BODY_METRICS, ESTIMATE_METRICS
from cmacexp.metrics.leg import SPATIAL
from cmacexp.metrics.metric import describe
from cmacexp.metrics.registry import LEG_METRICS

DECLARED = re.compile(r"^## (.+)$|^\{\{ declared \}\}$", re.MULTILINE)
"""A heading, or the mark that its table replaces."""
COLUMNS = {
    "`metrics.parquet`": {"cycle": None, "leg": None, **LEG_METRICS},
    "`metrics.parquet` of a robot": SPATIAL,
    "`body_metrics.parquet`": {"cycle": None, **BODY_METRICS, **ESTIMATE_METRICS},
}
SIGNALS = {
    "`trace.parquet`": signals.LEG_SIGNALS,
    "`trace.parquet` of a robot": signals.SPATIAL_SIGNALS,
    "`trace.parquet` with a model": signals.MODEL_SIGNALS,
    "`body.parquet`": signals.BODY_SIGNALS,
    "`body.parquet` of a real robot": signals.LIVE_SIGNALS,
    "`memory.parquet`": signals.MEMORY_SIGNALS,
}


def table_of(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Format a table as Markdown."""
    return "".join("| " + " | ".join(cells) + " |\n" for cells in [head, ["---"] * len(head), *rows])


def describe_display(column: Any) -> tuple[str, str, str]:
    """Return title, symbol and unit of a metric in tables and figures, its pooling, and the better direction."""
    if column is None:
        return "-", "-", "-"
    label = column.shown
    name = f"{label.title} {label.symbol}".rstrip() + f", {label.unit}" if label else "-"
    return name, column.pooling.name or "-", column.better or "-"


def metrics_table(columns: Mapping[str, Any]) -> str:
    """Format the table of all metrics of a file."""
    return table_of(
        ["column", "unit", "definition", "shown as", "over legs", "better", "NaN where", "source"],
        [
            [
                f"`{name}`",
                text["unit"] or "1",
                text["meaning"],
                *describe_display(c),
                text["undefined"],
                text["source"],
            ]
            for name, c in columns.items()
            for text in [describe(name, c)]
        ],
    )


def signals_table(columns: Iterable[Any]) -> str:
    """Format the table of all signals of a file."""
    return table_of(
        ["column", "unit", "meaning", "type", "owner", "altered by", "present"],
        [
            [f"`{s.name}`", s.unit or "1", s.meaning, str(s.type), s.owner, ", ".join(s.altered_by), s.present]
            for s in columns
        ],
    )


def arrays_table() -> str:
    """Format the table of the arrays that components exchange, and of the columns that form each of them."""
    spatial = {signal.name for signal in signals.SPATIAL_SIGNALS}
    rows = [
        (
            name,
            *(", ".join(c for c in signals.ARRAYS[name] if (c in spatial) == third) for third in (False, True)),
            unit,
        )
        for name, unit in signals.list_array_units().items()
    ]
    return table_of(
        ["array", "columns", "third of a robot", "unit"], [(f"`{name}`", *cells) for name, *cells in rows]
    )


TABLES = {
    **{("files", heading): metrics_table(columns) for heading, columns in COLUMNS.items()},
    **{("files", heading): signals_table(columns) for heading, columns in SIGNALS.items()},
    ("files", "Arrays of components"): arrays_table(),
}
"""Tables by the name of a page and the heading in it."""


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Fill in the tables of a page; mkdocs calls this for every page.

    Raises:
        KeyError: no table is declared for the heading above a mark.
    """
    name = page.file.src_uri.removesuffix(".md")
    heading = ""

    def fill(match: re.Match[str]) -> str:
        nonlocal heading
        heading = match[1] or heading
        return match[0] if match[1] else TABLES[name, heading].rstrip()

    return DECLARED.sub(fill, markdown)
