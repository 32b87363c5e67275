"""The documentation of the signals shows every column as the table of signals declares it.

After a change of a signal, renew its tables with ``python tests/commands/test_signals_doc.py`` and read the diff.
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

PAGE = Path(__file__).parents[2] / "docs" / "signals.md"
FILES = {
    "`trace.parquet`": LEG_SIGNALS,
    "`trace.parquet` of a robot": SPATIAL_SIGNALS,
    "`trace.parquet` with a model": MODEL_SIGNALS,
    "`body.parquet`": BODY_SIGNALS,
    "`memory.parquet`": MEMORY_SIGNALS,
}


def table_of(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(cells) + " |\n" for cells in lines)


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
    **{heading: signals_table(signals) for heading, signals in FILES.items()},
    "Arrays of components": arrays_table(),
}


def table_below(text, heading):
    """The first table below a heading, with where it stands."""
    return re.compile(r"(?:^\|.*\n)+", re.MULTILINE).search(text, text.index(f"\n## {heading}\n"))


def write():
    for heading, table in TABLES.items():
        text = PAGE.read_text()
        old = table_below(text, heading)
        PAGE.write_text(text[: old.start()] + table + text[old.end() :])


@pytest.mark.parametrize("heading", TABLES)
def test_the_page_shows_every_signal(heading):
    assert table_below(PAGE.read_text(), heading)[0] == TABLES[heading]


if __name__ == "__main__":
    write()
