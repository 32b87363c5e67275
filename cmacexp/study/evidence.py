"""Evidence: what was measured for a statement, as a small table; and counts of verdicts."""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

from cmacexp.report.terminal_tables import GAP, TEXT_WIDTH
from cmacexp.study.statements import INFINITE, OUTCOMES, REPRODUCED, VERDICTS, Criterion, Found, Judged

if TYPE_CHECKING:
    from jinja2 import Environment


class Row(NamedTuple):
    """What was measured for one criterion, as readers see it; empty: not known."""

    case: str
    value: str
    reason: str
    """Of an infinite value."""
    interval: str
    size: str
    limit: str
    opposite: str
    verdict: str


Evidence = Mapping[str, Sequence[Row]]
"""The cases of each quantity."""


def gather(criteria: Sequence[Criterion], measured: Mapping[str, Sequence[Any]]) -> Evidence:
    """The evidence of a statement.

    Args:
        criteria: of the statement.
        measured: ``values``, and if known ``intervals``, ``counts`` and ``verdicts``, of each criterion.
    """
    found: dict[str, list[Row]] = {}
    for index, criterion in enumerate(criteria):
        known = {name: column[index] for name, column in measured.items() if column[index] is not None}
        row = Row(
            criterion.case,
            known["values"],
            criterion.infinite if known["values"] == INFINITE else "",
            known.get("intervals", ""),
            str(known.get("counts", "")),
            criterion.format_limit(criterion.holds),
            criterion.format_limit(criterion.fails) if criterion.fails else "",
            known.get("verdicts", ""),
        )
        found.setdefault(criterion.quantity, []).append(row)
    return found


def evidence_of(judged: Judged | Found) -> Evidence:
    """The evidence of a statement that was judged."""
    words = OUTCOMES if isinstance(judged, Found) else {}
    columns: dict[str, list[Any]] = {
        "values": [each.value for each in judged.measured],
        "intervals": [each.spread for each in judged.measured],
        "counts": [each.interval.count for each in judged.measured],
        "verdicts": [words.get(each.verdict, each.verdict) for each in judged.measured],
    }
    return gather([each.criterion for each in judged.measured], columns)


def count_verdicts(verdicts: Sequence[str]) -> str:
    """How many claims have each verdict, as a sentence."""
    counts = {verdict: verdicts.count(verdict) for verdict in VERDICTS}
    others = [f"{count} {verdict}" for verdict, count in counts.items() if count and verdict != REPRODUCED]
    return ", ".join([f"{counts[REPRODUCED]} of {len(verdicts)} claims are reproduced", *others]) + "."


@cache
def templates() -> "Environment":
    """Those of statements."""
    from jinja2 import Environment, FileSystemLoader

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.globals.update(verdicts=VERDICTS)
    return environment


def format_html(evidence: Evidence) -> str:
    """The table as HTML without an empty line, which would end it in Markdown."""
    module: Any = templates().get_template("statements.html").module
    return "\n".join(line for line in module.evidence(evidence).splitlines() if line.strip())


def format_text(statement: str, evidence: Evidence | None = None) -> str:
    """A statement and its evidence in lines of ``TEXT_WIDTH``; limits of the opposite are left out."""
    lines, table = wrap(statement, TEXT_WIDTH, subsequent_indent="  "), evidence or {}
    cells = [(row.case, row.value, row.interval, row.limit, row.verdict) for rows in table.values() for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for quantity, rows in table.items():
        lines += wrap(quantity, TEXT_WIDTH, initial_indent="  ", subsequent_indent="  ")
        for row in rows:
            padded = [cell.ljust(width) for cell, width in zip(cells.pop(0), widths, strict=True) if width]
            lines += wrap((" " * GAP).join(padded), TEXT_WIDTH, initial_indent="    ", subsequent_indent="      ")
            lines += [f"      {row.value}: {row.reason}"] if row.reason else []
    return "\n".join(lines)
