"""The page of a study: its Markdown with values, figures, tables, findings and claims; and its files beside it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Any

import pyarrow as pa
from markupsafe import Markup

from cmacexp.addons.study.interval import FEW
from cmacexp.addons.study.provenance import PROVENANCE
from cmacexp.addons.study.results import LAST_CYCLES, Results
from cmacexp.addons.study.statements import (
    INFINITE,
    MEASURED,
    REPRODUCED,
    VERDICTS,
    Claim,
    Criterion,
    CriterionResult,
    StatementResult,
)
from cmacexp.addons.study.study_file import StudyFile
from cmacexp.config.fields import listed
from cmacexp.data.folder import ResultWriter
from cmacexp.data.manifest import Manifest
from cmacexp.data.tables import write_table
from cmacexp.errors import require
from cmacexp.report.page import (
    HOW_TO_REPORT,
    Renderer,
    Report,
    Section,
    escape_markdown,
    find_insertions,
    find_page,
    make_relative,
    render_markdown,
    write_report,
)
from cmacexp.terminal.messages import GAP, TEXT_WIDTH

QUICK_NOTICE = (
    "Quick run: this page checks the machinery and concludes nothing. It shows no verdicts and no findings."
)
RESULTS = "results.parquet"
READING = """<p>The table below a statement gives what was measured: the value, its 95 % interval, the size n of the
sample, and the limits that decide: where the statement holds, and where its opposite does. n is the number of
completed runs that the value rests on, or “n of N” if others of the N failed or have nothing to be compared with:
failures are never part of a value, but no statement holds for a run that failed. The interval of a proportion is
Wilson's. That of fewer than {few} values that differ is Student's t of their mean, of positive ratios of their
logarithms (the value is the geometric mean); that of more a percentile bootstrap of their interquartile mean. A value
that no seed and no case changes is marked “deterministic”, which says nothing of modelling errors.</p>"""
CLAIMS = "claims.json"


Evidence = Mapping[str, Sequence[Mapping[str, str]]]
"""The cases of each quantity, and of each what was measured, as readers see it: ``case``, ``value``, ``reason`` of an
infinite value, ``interval``, ``size``, ``limit``, ``opposite``, ``verdict``."""


def build_evidence(criteria: Sequence[Criterion], measured: Mapping[str, Any]) -> Evidence:
    """The evidence of a statement, of what was ``MEASURED`` for each criterion."""
    found: dict[str, list[Mapping[str, str]]] = {}
    for criterion, value, interval, size, verdict in zip(
        criteria, *(measured[name] for name in MEASURED), strict=True
    ):
        reason = criterion.infinite if value == INFINITE else ""
        holds, fails = (criterion.format_limit(each) if each else "" for each in (criterion.holds, criterion.fails))
        row = {"case": criterion.case, "value": value, "reason": reason, "interval": interval, "size": size}
        row |= {"limit": holds, "opposite": fails, "verdict": verdict if holds else ""}
        found.setdefault(criterion.quantity, []).append(row)
    return found


def evidence_of(judged: StatementResult) -> Evidence:
    """The evidence of a statement that was judged."""
    return build_evidence(judged.statement.criteria, judged.columns)


def count_verdicts(verdicts: Sequence[str]) -> str:
    """How many claims have each verdict, as a sentence."""
    others = [f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS if verdict in {*verdicts} - {REPRODUCED}]
    return ", ".join([f"{verdicts.count(REPRODUCED)} of {len(verdicts)} claims are reproduced", *others]) + "."


def load_template(name: str) -> Any:
    """Load a template beside this file."""
    from jinja2 import Environment, FileSystemLoader

    loader = FileSystemLoader(Path(__file__).parent)
    return Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True).get_template(name)


def format_html(evidence: Evidence) -> str:
    """The table as HTML without an empty line, which would end it in Markdown."""
    return str(load_template("statements.html").module.evidence(evidence))


def format_text(statement: str, evidence: Evidence | None = None) -> str:
    """A statement and its evidence in lines of ``TEXT_WIDTH``; limits of the opposite are left out."""
    lines, table = wrap(statement, TEXT_WIDTH, subsequent_indent="  "), evidence or {}
    columns = ("case", "value", "interval", "limit", "verdict")
    cells = [[row[column] for column in columns] for rows in table.values() for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for quantity, rows in table.items():
        lines += wrap(quantity, TEXT_WIDTH, initial_indent="  ", subsequent_indent="  ")
        for row in rows:
            padded = [cell.ljust(width) for cell, width in zip(cells.pop(0), widths, strict=True) if width]
            lines += wrap((" " * GAP).join(padded), TEXT_WIDTH, initial_indent="    ", subsequent_indent="      ")
            lines += [f"      {row['value']}: {row['reason']}"] if row["reason"] else []
    return "\n".join(lines)


@dataclass(frozen=True)
class Evaluated:
    """A study whose runs are complete: its statements judged, its values and tables computed."""

    name: str
    statements: Mapping[str, StatementResult]
    """Claims, then findings."""
    sections: Sequence[Section]
    runs: Mapping[Path, Manifest]
    """The manifest of each run, by folder."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """What its values depend on, see :func:`cmacexp.addons.study.provenance.make_provenance`."""


def check_page(file: StudyFile) -> None:
    """Check, before anything is run, what the page of a study inserts by name; raises BadInput."""
    study = file.study
    declared: dict[str, Mapping[str, Any]] = {
        "figure": study.figures, "table": study.tables, "finding": study.findings, "claim": study.claims,
    }  # fmt: skip
    for kind, name, line in find_insertions(file.page, file.page.read_text(encoding="utf-8")):
        has = listed(list(declared.get(kind, ()))) or "none"
        require(
            name in declared.get(kind, [name]),
            "page",
            file.page,
            f"line {line}: the study declares no {kind} {name!r}; it has {has}",
        )


def _write_tables(results: Results, folder: Path) -> None:
    """Write the table of results, and every table that was computed."""
    frames = {f"{name}.parquet": frame for name, frame in results.computed.items()}
    if results.rows:
        frames[RESULTS] = results.table
    for name, frame in frames.items():
        write_table(pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(None), folder / name)


def evaluate(file: StudyFile, results: Results, folder: Path, quick: bool) -> Evaluated:
    """Judge the statements of a study, write its figures and tables below ``folder``, and render its page.

    Of a quick one no statement is judged.
    """
    study = file.study
    judged = {name: statement.judge(results) for name, statement in study.statements.items() if not quick}

    def show(name: str) -> str:
        own = judged.get(name)
        if own is None or isinstance(own.statement, Claim):
            return own.sentence if own else ""
        return Markup(f"{escape_markdown(own.sentence)}\n\n{format_html(evidence_of(own))}\n\n")

    sections = render_markdown(
        file.page.read_text(encoding="utf-8"),
        file.page,
        study.title,
        Renderer(folder),
        {name: partial(figure, results) for name, figure in study.figures.items()},
        {name: partial(table, results) for name, table in study.tables.items()},
        {
            **dict.fromkeys(("finding", "claim"), show),
            "last_cycles": LAST_CYCLES,
            "runs": len(results),
            "setting": lambda key, **of: results.select(of).rows[0].settings[key],
            **study.values(results),
        },
    )
    _write_tables(results, folder)
    return Evaluated(file.name, judged, sections, {run.folder: run.manifest for run in results.runs})


def make_claims_section(claims: Sequence[StatementResult], folder: Path) -> Section:
    """The section of a report in ``folder`` with all claims, and what their verdicts mean."""
    runs = [sorted({Path(run) for each in judged.measured for run in each.runs}) for judged in claims]
    pages = [[(run.name, find_page(run, folder)) for run in own] for own in runs]
    page = load_template("claims.html").render(
        claims=list(zip(claims, map(evidence_of, claims), pages, strict=True)),
        verdicts=VERDICTS,
        summary=count_verdicts([judged.verdict for judged in claims]),
        place=", ".join(sorted({str(run.parent) for own in runs for run in own})),
        how_to_report=HOW_TO_REPORT,
    )
    return Section("The claims", [Markup(page)])


def _entry(measured: CriterionResult, folder: Path) -> dict[str, Any]:
    criterion, interval = measured.criterion, measured.interval
    limits = {"holds": criterion.holds, "fails": criterion.fails}
    return {
        "quantity": criterion.quantity, "case": criterion.case, "value": interval.value, "low": interval.low,
        "high": interval.high, "count": interval.count, "size": interval.size, "method": interval.method,
        "failed": interval.failed, "unpaired": interval.unpaired,
        **{name: [limit.low, limit.high] for name, limit in limits.items() if limit},
        "verdict": measured.verdict, "shown": measured.value, "spread": measured.spread,
        "runs": [make_relative(Path(run), folder) for run in measured.runs],
    }  # fmt: skip


def _statement(name: str, judged: StatementResult, folder: Path) -> dict[str, Any]:
    own: dict[str, Any] = {"kind": "finding", "statement": judged.sentence}
    if isinstance(judged.statement, Claim):
        own = {"kind": "claim", "statement": judged.statement.words, "where": judged.statement.where}
    criteria = [_entry(each, folder) for each in judged.measured]
    return {"name": name, **own, "verdict": judged.verdict, "criteria": criteria}


def write_page(title: str, question: str, studies: Sequence[Evaluated], place: ResultWriter, quick: bool) -> Path:
    """Write the report of one study or of several together, and their statements; a quick one concludes nothing."""
    statements = [judged for study in studies for judged in study.statements.values()]
    claims = [judged for judged in statements if isinstance(judged.statement, Claim)]
    sections = [
        *([make_claims_section(claims, place.folder)] if claims else []),
        *([Section("Quick run", [Markup(f'<p class="banner">{QUICK_NOTICE}</p>')])] if quick else []),
        *(section for study in studies for section in study.sections),
        *([Section("How to read the values", [Markup(READING.format(few=FEW))])] if statements and not quick else []),
    ]
    if not quick:
        judged = {s.name: [_statement(*each, place.folder) for each in s.statements.items()] for s in studies}
        for name, entries in ((CLAIMS, judged), (PROVENANCE, {s.name: s.provenance for s in studies})):
            place.write_text(name, json.dumps(entries, indent=1, ensure_ascii=False) + "\n")
    config = {"studies": [study.name for study in studies], "quick": quick}
    hashes = {path: str(run["config_hash"]) for study in studies for path, run in study.runs.items()}
    return write_report(Report(title, question, sections, config, hashes), place)
