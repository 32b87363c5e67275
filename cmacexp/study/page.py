"""The page of a study: its Markdown with values, figures, tables, findings and claims inserted."""

import html
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmacexp.report.numbers import format_number
from cmacexp.report.page import Html, Section, relative, save_figure
from cmacexp.study.results import LAST_CYCLES, Results
from cmacexp.study.statements import VERDICTS, Found, Judged
from cmacexp.study.study import StudyFile

if TYPE_CHECKING:
    import pandas as pd

QUICK = "Quick run: this page checks the machinery and concludes nothing. It shows no verdicts and no findings."


@dataclass(frozen=True)
class Evaluated:
    """A study whose runs are complete: its statements judged, its values and tables computed."""

    name: str
    title: str
    claims: Mapping[str, Judged]
    findings: Mapping[str, Found]
    sections: Sequence[Section]
    files: Sequence[Path]
    """Everything that was written for the page."""


def evaluate(file: StudyFile, results: Results, folder: Path, quick: bool) -> Evaluated:
    """Judge the statements of a study, draw its figures below ``folder``, and render its page."""
    study = file.study
    claims = {} if quick else {name: claim.judge(results) for name, claim in study.claims.items()}
    findings = {} if quick else {name: finding.judge(results) for name, finding in study.findings.items()}
    inserts = _Inserts(file, results, folder, claims, findings, quick)
    sections = _sections(inserts.render(), study.title)
    if claims:
        sections.insert(0, Section(f"{study.title}: claims", [Html(_claims_table(list(claims.values()), folder))]))
    return Evaluated(file.name, study.title, claims, findings, sections, inserts.files)


class _Inserts:
    """What a template may insert, by name."""

    def __init__(
        self,
        file: StudyFile,
        results: Results,
        folder: Path,
        claims: Mapping[str, Judged],
        findings: Mapping[str, Found],
        quick: bool,
    ):
        self.file, self.results, self.folder, self.quick = file, results, folder, quick
        self.claims, self.findings = claims, findings
        self.files: list[Path] = []

    def render(self) -> str:
        """The Markdown of the page."""
        from jinja2 import Environment, StrictUndefined

        environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=_finalize)
        given: dict[str, Any] = {
            "figure": self._figure, "table": self._table, "finding": self._finding, "claim": self._claim,
            "number": format_number, "last_cycles": LAST_CYCLES, "runs": len(self.results),
        }  # fmt: skip
        values = self.file.study.values(self.results)
        return environment.from_string(self.file.page.read_text()).render({**given, **values})

    def _figure(self, name: str, title: str = "", caller: Callable[[], str] | None = None) -> str:
        """``{% call figure("name", "Fig. 7") %}caption{% endcall %}``; the caption describes it to screen readers."""
        source, files = save_figure(
            f"{self.file.name}_{name}", self.file.study.figures[name](self.results), self.folder
        )
        self.files += files
        caption = caller().strip() if caller else ""
        alt = html.escape(re.sub(r"\s+", " ", caption) or title or name)
        head = f"<h3>{html.escape(title)}</h3>" if title else ""
        return (
            f'<figure id="{name}">{head}<img src="{source}" alt="{alt}"><figcaption>{caption}</figcaption></figure>\n'
        )

    def _table(self, name: str, caption: str = "") -> str:
        return _table(self.file.study.tables[name](self.results), caption)

    def _finding(self, name: str) -> str:
        if self.quick:
            return ""
        found = self.findings[name]
        evidence = "; ".join(f"{each.criterion.quantity}: {each.evidence}" for each in found.measured)
        return f'{found.sentence} <span class="evidence">[{evidence}]</span>'

    def _claim(self, name: str) -> str:
        if self.quick:
            return ""
        judged = self.claims[name]
        return f"“{judged.claim.words}” ({judged.claim.where}): {judged.verdict}."


def _finalize(value: Any) -> Any:
    """Numbers in one format."""
    return format_number(value) if isinstance(value, float) else value


def _cell(value: Any) -> str:
    import pandas as pd

    if value is None or value is pd.NA:
        return "-"
    return format_number(float(value)) if isinstance(value, float) else html.escape(str(value))


def _table(frame: "pd.DataFrame", caption: str) -> str:
    """A table of HTML; columns of numbers are aligned to the right."""
    kinds = ["number" if frame[name].dtype.kind in "fi" else "" for name in frame]
    head = "".join(
        f'<th class="{kind}">{html.escape(str(name))}</th>' for name, kind in zip(frame, kinds, strict=True)
    )
    body = "".join(
        "<tr>" + "".join(f'<td class="{kind}">{_cell(v)}</td>' for v, kind in zip(row, kinds, strict=True)) + "</tr>"
        for row in frame.itertuples(index=False)
    )
    top = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    return f'<div class="scroll"><table>{top}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>\n'


def _claims_table(claims: Sequence[Judged], folder: Path) -> str:
    from jinja2 import Environment, FileSystemLoader

    environment = Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True)
    links = [
        sorted({relative(Path(run), folder) for each in judged.measured for run in each.runs}) for judged in claims
    ]
    return environment.get_template("claims.html").render(
        claims=list(zip(claims, links, strict=True)), verdicts=VERDICTS
    )


def _sections(markdown: str, title: str) -> list[Section]:
    """A section for every heading of the second level; what comes before the first stands under the study's title."""
    from markdown_it import MarkdownIt

    converter = MarkdownIt("commonmark").enable("table")
    found = []
    for index, part in enumerate(re.split(r"^## ", markdown, flags=re.MULTILINE)):
        heading, _, text = (title, "", part) if index == 0 else part.partition("\n")
        if text.strip():
            found.append(Section(heading.strip(), [Html(converter.render(text))]))
    return found
