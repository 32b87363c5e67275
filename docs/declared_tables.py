"""The tables of metrics and signals in the documentation, as the code declares every column.

A page holds ``{{ declared }}`` below the heading of a table; mkdocs fills it when it builds the site, so an addition
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
"""A heading, or the place of its table."""
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
    """A table of Markdown."""
    return "".join("| " + " | ".join(cells) + " |\n" for cells in [head, ["---"] * len(head), *rows])


def shown_as(column: Any) -> tuple[str, str, str]:
    """Name, symbol and unit of a metric in tables and figures, its pooling, and which direction is better."""
    if column is None:
        return "-", "-", "-"
    shown = column.shown
    name = f"{shown.title} {shown.symbol}".rstrip() + f", {shown.unit}" if shown else "-"
    return name, column.pooling.name or "-", column.better or "-"


def metrics_table(columns: Mapping[str, Any]) -> str:
    """Every metric of a file."""
    return table_of(
        ["column", "unit", "definition", "shown as", "over legs", "better", "NaN where", "source"],
        [
            [f"`{name}`", known["unit"] or "1", known["meaning"], *shown_as(c), known["undefined"], known["source"]]
            for name, c in columns.items()
            for known in [describe(name, c)]
        ],
    )


def signals_table(columns: Iterable[Any]) -> str:
    """Every signal of a file."""
    return table_of(
        ["column", "unit", "meaning", "type", "owner", "altered by", "present"],
        [
            [f"`{s.name}`", s.unit or "1", s.meaning, str(s.type), s.owner, ", ".join(s.altered_by), s.present]
            for s in columns
        ],
    )


def arrays_table() -> str:
    """Which columns become an array that components get."""
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
"""By the name of a page, and the heading in it."""


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Fill a page; mkdocs calls this for every page.

    Raises:
        KeyError: no table is declared for the heading above a place.
    """
    name, heading = page.file.src_uri.removesuffix(".md"), ""

    def fill(found: re.Match[str]) -> str:
        nonlocal heading
        heading = found[1] or heading
        return found[0] if found[1] else TABLES[name, heading].rstrip()

    return DECLARED.sub(fill, markdown)
