"""Tables of metrics and signals in the documentation, from the declaration of every column in the code."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from cmacexp.data import signals
from cmacexp.metrics.body import BODY_METRICS, ESTIMATE_METRICS
from cmacexp.metrics.leg import SPATIAL
from cmacexp.metrics.metric import describe
from cmacexp.metrics.registry import LEG_METRICS
from docs.markdown import format_table


def describe_display(column: Any) -> tuple[str, str, str]:
    """Return title, symbol and unit of a metric in tables and figures, its pooling, and the better direction."""
    if column is None:
        return "-", "-", "-"
    label = column.shown
    name = f"{label.title} {label.symbol}".rstrip() + f", {label.unit}" if label else "-"
    return name, column.pooling.name or "-", column.better or "-"


def metrics_table(columns: Mapping[str, Any]) -> str:
    """Format the table of all metrics of a file."""
    return format_table(
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
    return format_table(
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
    return format_table(
        ["array", "columns", "third of a robot", "unit"], [(f"`{name}`", *cells) for name, *cells in rows]
    )


TABLES: Mapping[str, Callable[[], str]] = {
    "metrics": lambda: metrics_table({"cycle": None, "leg": None, **LEG_METRICS}),
    "metrics of a robot": lambda: metrics_table(SPATIAL),
    "body_metrics": lambda: metrics_table({"cycle": None, **BODY_METRICS, **ESTIMATE_METRICS}),
    "trace": lambda: signals_table(signals.LEG_SIGNALS),
    "trace of a robot": lambda: signals_table(signals.SPATIAL_SIGNALS),
    "trace with a model": lambda: signals_table(signals.MODEL_SIGNALS),
    "body": lambda: signals_table(signals.BODY_SIGNALS),
    "body of a real robot": lambda: signals_table(signals.LIVE_SIGNALS),
    "memory": lambda: signals_table(signals.MEMORY_SIGNALS),
    "arrays": arrays_table,
}
"""Functions that make the tables of files.md, by name."""
