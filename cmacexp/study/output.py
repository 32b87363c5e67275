"""What a study leaves: its report, and its statements as JSON."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from cmacexp.data.folder import Place
from cmacexp.report.page import Report, relative, write_report
from cmacexp.report.parts import Section
from cmacexp.study.page import QUICK_NOTICE, Evaluated, make_claims_section, make_reading_section
from cmacexp.study.statements import Found, Judged, Measured

CLAIMS = "claims.json"


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


def write_page(title: str, question: str, studies: Sequence[Evaluated], place: Place, quick: bool) -> Path:
    """Write the report of one study or of several together, and their statements.

    Args:
        title: of the page.
        question: what it asks.
        studies: whose sections follow each other.
        place: of the report.
        quick: whether the page says that it concludes nothing.
    """
    folder = place.folder
    claims = [judged for study in studies for judged in study.claims.values()]
    sections = [make_claims_section(claims, folder)] if claims else []
    sections += [Section("Quick run", [Markup(f'<p class="banner">{QUICK_NOTICE}</p>')])] if quick else []
    sections += [section for study in studies for section in study.sections]
    files = [file for study in studies for file in study.files]
    runs = {path: manifest for study in studies for path, manifest in study.runs.items()}
    files += [path / name for path, manifest in runs.items() for name in manifest["files"]]
    if not quick:
        if any(study.claims or study.findings for study in studies):
            sections.append(make_reading_section())
        statements = {study.name: _statements(study.claims, study.findings, folder) for study in studies}
        place.write_text(CLAIMS, json.dumps(statements, indent=1, ensure_ascii=False) + "\n")
        files.append(place.new / CLAIMS)
    config = {"studies": [study.name for study in studies], "quick": quick}
    hashes = {path: str(manifest["config_hash"]) for path, manifest in runs.items()}
    report = Report(title, question, sections, sorted({*files}), config, hashes)
    return write_report(report, place)
