"""Evidence: what was measured for a statement, as a small table; and counts of verdicts."""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

from cmacexp.study.statements import INFINITE, OUTCOMES, REPRODUCED, VERDICTS, ClaimResult, Criterion, FindingResult
from cmacexp.terminal.tables import GAP, TEXT_WIDTH


class EvidenceRow(NamedTuple):
    """What was measured for one criterion, as readers see it; ``reason`` of an infinite value; empty: not known."""

    case: str
    value: str
    reason: str
    interval: str
    size: str
    limit: str
    opposite: str
    verdict: str


Evidence = Mapping[str, Sequence[EvidenceRow]]
"""The cases of each quantity."""


def build_evidence(criteria: Sequence[Criterion], measured: Mapping[str, Sequence[Any]]) -> Evidence:
    """The evidence of a statement; of each criterion ``values``, and if known ``intervals, counts, verdicts``."""
    found: dict[str, list[EvidenceRow]] = {}
    for index, criterion in enumerate(criteria):
        known = {name: str(column[index]) for name, column in measured.items() if column[index] is not None}
        value, interval, size, verdict = (
            known.get(name, "") for name in ("values", "intervals", "counts", "verdicts")
        )
        reason = criterion.infinite if value == INFINITE else ""
        holds, fails = (criterion.format_limit(each) if each else "" for each in (criterion.holds, criterion.fails))
        row = EvidenceRow(criterion.case, value, reason, interval, size, holds, fails, verdict if holds else "")
        found.setdefault(criterion.quantity, []).append(row)
    return found


def evidence_of(judged: ClaimResult | FindingResult) -> Evidence:
    """The evidence of a statement that was judged."""
    words = OUTCOMES if isinstance(judged, FindingResult) else {}
    columns: dict[str, list[Any]] = {
        "values": [each.value for each in judged.measured],
        "intervals": [each.spread for each in judged.measured],
        "counts": [each.interval.size for each in judged.measured],
        "verdicts": [words.get(each.verdict, each.verdict) for each in judged.measured],
    }
    return build_evidence([each.criterion for each in judged.measured], columns)


def count_verdicts(verdicts: Sequence[str]) -> str:
    """How many claims have each verdict, as a sentence."""
    others = [f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS if verdict in {*verdicts} - {REPRODUCED}]
    return ", ".join([f"{verdicts.count(REPRODUCED)} of {len(verdicts)} claims are reproduced", *others]) + "."


@cache
def template(name: str) -> Any:
    """A template beside this file."""
    from jinja2 import Environment, FileSystemLoader

    loader = FileSystemLoader(Path(__file__).parent)
    return Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True).get_template(name)


def format_html(evidence: Evidence) -> str:
    """The table as HTML without an empty line, which would end it in Markdown."""
    return str(template("statements.html").module.evidence(evidence))


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
