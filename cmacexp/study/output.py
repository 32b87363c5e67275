"""What a study leaves: its report, the table of results, and its statements as JSON."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
from markupsafe import Markup

from cmacexp.data.folder import Place
from cmacexp.data.parquet import write_table
from cmacexp.report.page import Report, relative, write_report
from cmacexp.report.parts import Section
from cmacexp.study.page import QUICK_NOTICE, Evaluated, make_claims_section, make_reading_section
from cmacexp.study.results import Results
from cmacexp.study.statements import Found, Judged, Measured

RESULTS, CLAIMS = "results.parquet", "claims.json"


def write_results(results: Results, folder: Path) -> list[Path]:
    """Write the table of results, and every table that was computed; returns the files."""
    frames = {f"{name}.parquet": frame for name, frame in results.computed.items()}
    if results.rows:
        frames[RESULTS] = results.table
    for name, frame in frames.items():
        table = pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(None)
        write_table(table, folder / name)
    return [folder / name for name in frames]


def _entry(measured: Measured, folder: Path) -> dict[str, Any]:
    criterion, interval = measured.criterion, measured.interval
    limits = {
        name: [limit.low, limit.high]
        for name, limit in (("holds", criterion.holds), ("fails", criterion.fails))
        if limit
    }
    return {
        "quantity": criterion.quantity, "value": interval.value, "low": interval.low, "high": interval.high,
        "count": interval.count, "method": interval.method, **limits, "shown": measured.value,
        "runs": [relative(Path(run), folder) for run in measured.runs],
    }  # fmt: skip


def _statements(claims: Mapping[str, Judged], findings: Mapping[str, Found], folder: Path) -> list[dict[str, Any]]:
    judged = [
        {"name": name, "kind": "claim", "statement": each.claim.words, "where": each.claim.where,
         "verdict": each.verdict, "criteria": [_entry(m, folder) for m in each.measured]}
        for name, each in claims.items()
    ]  # fmt: skip
    found = [
        {"name": name, "kind": "finding", "statement": each.sentence, "verdict": each.outcome,
         "criteria": [_entry(m, folder) for m in each.measured]}
        for name, each in findings.items()
    ]  # fmt: skip
    return judged + found


def write_page(
    title: str, question: str, studies: Sequence[Evaluated], inputs: Sequence[Path], runs: Mapping[Path, str],
    place: Place, key: str, quick: bool,
) -> Path:  # fmt: skip
    """Write the report of one study or of several together, and their statements.

    Args:
        title: of the page.
        question: what it asks.
        studies: whose sections follow each other.
        inputs: files that its numbers are computed from.
        runs: hash of the config of each run, by folder.
        place: of the report.
        key: see :func:`cmacexp.study.state.state_key`.
        quick: whether the page says that it concludes nothing.
    """
    folder = place.folder
    claims = [judged for study in studies for judged in study.claims.values()]
    sections = [make_claims_section(claims, folder)] if claims else []
    sections += [Section("Quick run", [Markup(f'<p class="banner">{QUICK_NOTICE}</p>')])] if quick else []
    sections += [section for study in studies for section in study.sections]
    files = [file for study in studies for file in study.files]
    if not quick:
        if any(study.claims or study.findings for study in studies):
            sections.append(make_reading_section())
        statements = {study.name: _statements(study.claims, study.findings, folder) for study in studies}
        place.write_text(CLAIMS, json.dumps(statements, indent=1, ensure_ascii=False) + "\n")
        files.append(place.new / CLAIMS)
    config = {"studies": [study.name for study in studies], "quick": quick}
    report = Report(title, question, sections, sorted({*files, *inputs}), config, runs)
    return write_report(report, place, key)
