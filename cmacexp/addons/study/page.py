"""The page of a study, Markdown with values, figures, tables, findings and claims; and the files beside it."""

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
Wilson's. That of fewer than {few} positive values is Student's t of their logarithms (the value is the geometric
mean), of values of both signs Student's t of their mean; that of more a percentile bootstrap of their interquartile
mean. Of conditions that were chosen by hand, “(min, max)”, the median, the smallest and the largest value
are given. A value
that no seed and no case changes is marked “deterministic”, which says nothing of modelling errors.</p>"""
CLAIMS = "claims.json"


Evidence = Mapping[str, Sequence[Mapping[str, str]]]
"""Measured cases of each quantity, as texts for readers: ``case``, ``value``, ``reason`` of an infinite value,
``interval``, ``size``, ``limit``, ``opposite``, ``verdict``."""


def build_evidence(criteria: Sequence[Criterion], measured: Mapping[str, Any]) -> Evidence:
    """Build the evidence of a statement from the columns ``MEASURED``, with one entry per criterion."""
    evidence: dict[str, list[Mapping[str, str]]] = {}
    for criterion, value, interval, size, verdict in zip(
        criteria, *(measured[name] for name in MEASURED), strict=True
    ):
        reason = criterion.infinite if value == INFINITE else ""
        holds, fails = (
            criterion.format_limit(limit) if limit else "" for limit in (criterion.holds, criterion.fails)
        )
        row = {
            "case": criterion.case, "value": value, "reason": reason, "interval": interval, "size": size,
            "limit": holds, "opposite": fails, "verdict": verdict if holds else "",
        }  # fmt: skip
        evidence.setdefault(criterion.quantity, []).append(row)
    return evidence


def evidence_of(judged: StatementResult) -> Evidence:
    """Build the evidence of a judged statement."""
    return build_evidence(judged.statement.criteria, judged.columns)


def count_verdicts(verdicts: Sequence[str]) -> str:
    """Return a sentence with the number of claims of each verdict."""
    rest = [f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS if verdict in {*verdicts} - {REPRODUCED}]
    return ", ".join([f"{verdicts.count(REPRODUCED)} of {len(verdicts)} claims are reproduced", *rest]) + "."


def load_template(name: str) -> Any:
    """Load a Jinja template from the folder of this file."""
    from jinja2 import Environment, FileSystemLoader

    loader = FileSystemLoader(Path(__file__).parent)
    return Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True).get_template(name)


def format_html(evidence: Evidence) -> str:
    """Format evidence as an HTML table without empty lines, which would end it in Markdown."""
    return str(load_template("statements.html").module.evidence(evidence))


def format_text(statement: str, evidence: Evidence | None = None) -> str:
    """Format a statement and its evidence as text of width ``TEXT_WIDTH``, without the limits of the opposite."""
    lines = wrap(statement, TEXT_WIDTH, subsequent_indent="  ")
    table = evidence or {}
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
    """A study with complete runs: judged statements and the rendered sections of its page."""

    name: str
    statements: Mapping[str, StatementResult]
    """Claims, then findings, by name."""
    sections: Sequence[Section]
    runs: Mapping[Path, Manifest]
    """The manifest of each run, by folder."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """Origin of its values, see :func:`cmacexp.addons.study.provenance.make_provenance`."""


def check_page(file: StudyFile) -> None:
    """Check that everything the page of a study inserts by name is declared; needs no runs.

    Raises:
        BadInput: the page inserts a figure, table, finding or claim that the study does not declare.
    """
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
    """Write the table of results and every computed table as Parquet."""
    frames = {f"{name}.parquet": frame for name, frame in results.computed.items()}
    if results.rows:
        frames[RESULTS] = results.table
    for name, frame in frames.items():
        write_table(pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(None), folder / name)


def evaluate(file: StudyFile, results: Results, folder: Path, quick: bool) -> Evaluated:
    """Judge the statements of a study, write its figures and tables below ``folder``, and render its page.

    No statement of a quick study is judged.
    """
    study = file.study
    judged = {name: statement.judge(results) for name, statement in study.statements.items() if not quick}

    def show(name: str) -> str:
        result = judged.get(name)
        if result is None or isinstance(result.statement, Claim):
            return result.sentence if result else ""
        return Markup(f"{escape_markdown(result.sentence)}\n\n{format_html(evidence_of(result))}\n\n")

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
    """Make the section of a report in ``folder`` with all claims and the meaning of their verdicts."""
    runs = [sorted({Path(run) for result in judged.measured for run in result.runs}) for judged in claims]
    pages = [[(run.name, find_page(run, folder)) for run in runs_of_claim] for runs_of_claim in runs]
    page = load_template("claims.html").render(
        claims=list(zip(claims, map(evidence_of, claims), pages, strict=True)),
        verdicts=VERDICTS,
        summary=count_verdicts([judged.verdict for judged in claims]),
        run_folder=", ".join(sorted({str(run.parent) for runs_of_claim in runs for run in runs_of_claim})),
        how_to_report=HOW_TO_REPORT,
    )
    return Section("The claims", [Markup(page)])


def _describe_criterion(measured: CriterionResult, folder: Path) -> dict[str, Any]:
    criterion = measured.criterion
    interval = measured.interval
    limits = {"holds": criterion.holds, "fails": criterion.fails}
    return {
        "quantity": criterion.quantity, "case": criterion.case, "value": interval.value, "low": interval.low,
        "high": interval.high, "count": interval.count, "size": interval.size, "method": interval.method,
        "failed": interval.failed, "unpaired": interval.unpaired,
        **{name: [limit.low, limit.high] for name, limit in limits.items() if limit},
        "verdict": measured.verdict, "shown": measured.value, "spread": measured.spread,
        "runs": [make_relative(Path(run), folder) for run in measured.runs],
    }  # fmt: skip


def _describe_statement(name: str, judged: StatementResult, folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = {"kind": "finding", "statement": judged.sentence}
    if isinstance(judged.statement, Claim):
        content = {"kind": "claim", "statement": judged.statement.words, "where": judged.statement.where}
    criteria = [_describe_criterion(result, folder) for result in judged.measured]
    return {"name": name, **content, "verdict": judged.verdict, "criteria": criteria}


def write_page(title: str, question: str, studies: Sequence[Evaluated], writer: ResultWriter, quick: bool) -> Path:
    """Write the report of one study or several; unless it is quick, also its statements and provenance as JSON."""
    statements = [judged for study in studies for judged in study.statements.values()]
    claims = [judged for judged in statements if isinstance(judged.statement, Claim)]
    sections = [
        *([make_claims_section(claims, writer.folder)] if claims else []),
        *([Section("Quick run", [Markup(f'<p class="banner">{QUICK_NOTICE}</p>')])] if quick else []),
        *(section for study in studies for section in study.sections),
        *([Section("How to read the values", [Markup(READING.format(few=FEW))])] if statements and not quick else []),
    ]
    if not quick:
        judged = {
            study.name: [
                _describe_statement(name, result, writer.folder) for name, result in study.statements.items()
            ]
            for study in studies
        }
        for name, entries in ((CLAIMS, judged), (PROVENANCE, {study.name: study.provenance for study in studies})):
            writer.write_text(name, json.dumps(entries, indent=1, ensure_ascii=False) + "\n")
    config = {"studies": [study.name for study in studies], "quick": quick}
    hashes = {path: str(run["config_hash"]) for study in studies for path, run in study.runs.items()}
    return write_report(Report(title, question, sections, config, hashes), writer)
