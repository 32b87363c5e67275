"""Pages of the studies and the benchmark, generated with the site: their statements with results, and figures.

A new study needs no edit of this file. Figures are those of a full run below outputs/studies, if there is one.
"""

import re
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from cmacexp.addons.study.command import FOLDER
from cmacexp.addons.study.page import build_evidence, format_html
from cmacexp.addons.study.statements import NO, UNCLEAR, VERDICTS, YES
from cmacexp.addons.study.study_file import StudyFile
from cmacexp.data.own_files import FIGURES, HTML
from cmacexp.study import Claim, Finding
from pipelines.benchmark.benchmark import BENCHMARK
from pipelines.benchmark.log_track import NAME as LOG_TRACK
from pipelines.groups import GROUPS, all_studies, every_study
from pipelines.results import (
    DOCS,
    NOT_MEASURED,
    SCORES,
    Quotable,
    count_claims,
    fill_quotes,
    find_entry,
    read_results,
    sentence_of,
)

ORDER = (*VERDICTS, YES, NO, UNCLEAR, NOT_MEASURED)
LIST, CLAIMS, COUNT = "{{ studies() }}", "{{ claims() }}", "{{ count() }}"
"""Marks for the list of studies, the list of the paper's claims, and their number by verdict."""
OUTPUTS = DOCS.parent / FOLDER
FIGURE = re.compile(r'<figure id="(\w+)">(?:<h3>(.*?)</h3>)?.*?<figcaption>(.*?)</figcaption>', re.DOTALL)
"""A figure of a report: name, title and caption."""


def statements_of(file: StudyFile, statements: Mapping[str, Claim | Finding], results: Quotable) -> str:
    """Format each claim or finding of a study with its verdict, followed by the table of its measured values."""
    text = ""
    for name, statement in statements.items():
        entry = find_entry(file.name, name, results)
        if isinstance(statement, Claim):
            words = f"{statement.words} ({statement.where})"
            said = f"**{entry['verdict']}**: {words}" if entry else words
        else:
            said = sentence_of(statement, entry) if entry else f"“{statement.says or name}”"
        table = format_html(build_evidence(statement.criteria, entry)) if entry else ""
        text += f"\n{'' if entry else f'*{NOT_MEASURED.capitalize()}*: '}{said}\n\n{table}\n"
    return text


def figures_of(name: str) -> list[tuple[Path, str]]:
    """Return the figure files of the last full run of a study, each with its section of the page."""
    report = OUTPUTS / name / HTML
    figures = FIGURE.findall(report.read_text(encoding="utf-8")) if report.is_file() else []
    text = "\n{}![{}](figures/{}-{}.svg)\n\n{}\n"
    return [
        (
            OUTPUTS / name / FIGURES / f"{figure}.svg",
            text.format(f"**{title}**\n\n" if title else "", figure.replace("_", " "), name, figure, caption.strip()),
        )
        for figure, title, caption in figures
    ]


def describe_run(name: str) -> str:
    """Describe the last full run of a study: date, numbers of runs and seeds, and the state of its code."""
    results = read_results()
    state = results.find_state(name)
    if name not in results.studies:
        return "It has never been run in full.\n"
    study = results.studies[name]
    extent = f"{study['runs']} runs, {study['seeds']} seeds"
    return f"Last run in full on {state.date} ({extent}). Its code is {state.state}.\n"


def page_of(file: StudyFile, results: Quotable) -> str:
    """Format the page of a study."""
    study = file.study
    figures = "".join(text for _, text in figures_of(file.name))
    command = f"{BENCHMARK} --log LOG --robot go2" if file.name == LOG_TRACK else file.name
    text = f"# {study.title}\n\n{study.question}\n\n`python -m pipelines.{command}` answers it again. "
    text += describe_run(file.name)
    if study.claims:
        text += f"\n## Claims of the paper\n{statements_of(file, study.claims, results)}"
    if study.findings:
        text += f"\n## Findings\n{statements_of(file, study.findings, results)}"
    if scores := SCORES.get(file.name):
        text += f"\n## Scores\n\n{scores.read_text(encoding='utf-8')}"
    return text + (f"\n## Figures\n{figures}" if figures else "")


def describe_outcomes(file: StudyFile, results: Quotable) -> str:
    """Count the statements of a study by verdict."""
    names = [*file.study.claims, *file.study.findings]
    entries = [find_entry(file.name, name, results) for name in names]
    verdicts = [entry["verdict"] if entry else NOT_MEASURED for entry in entries]
    return ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in sorted({*verdicts}, key=ORDER.index))


def list_of(results: Quotable) -> str:
    """Format the list of all studies, a line each."""
    cells = [
        (f"[{file.study.title}](studies/{file.name}.md)", file.study.question, describe_outcomes(file, results))
        for file in every_study()
    ]
    return "\n".join(["| study | question | statements |", "|---|---|---|", *(f"| {' | '.join(c)} |" for c in cells)])


def claims_of_paper(results: Quotable) -> str:
    """Format the claims of the paper in its order, a line each: verdict, measured values, link to the evidence."""
    order = {name: index for index, name in enumerate(GROUPS["paper"].studies)}
    lines = ["| claim | verdict | measured |", "|---|---|---|"]
    for file in sorted(all_studies(), key=lambda file: order.get(file.name, len(order))):
        if file.study.claims:
            lines.append(f"| **[{file.study.title}](studies/{file.name}.md)** | | |")
        for name, claim in file.study.claims.items():
            entry = find_entry(file.name, name, results)
            pairs = zip(claim.criteria, entry["values"], strict=True) if entry else ()
            values = [
                (quantity, ", ".join(f"{criterion.case} {value}".strip() for criterion, value in group))
                for quantity, group in groupby(pairs, key=lambda pair: pair[0].quantity)
            ]
            measured = "; ".join(f"{quantity}: **{value}**" for quantity, value in values)
            verdict = entry["verdict"] if entry else NOT_MEASURED
            lines.append(f"| {claim.words} ({claim.where}) | {verdict} | {measured} |")
    return "\n".join(lines)


def on_config(config: Any) -> Any:
    """Add the pages of studies at the end of the navigation's results; mkdocs calls this once."""
    (results,) = (group["Results"] for group in config.nav if "Results" in group)
    results.append({"Studies": [f"studies/{file.name}.md" for file in every_study()]})
    return config


def on_files(files: Any, config: Any) -> Any:
    """Generate the pages of studies and their figures; mkdocs calls this once."""
    from mkdocs.structure.files import File

    results = read_results().statements
    for study in every_study():
        files.append(File.generated(config, f"studies/{study.name}.md", content=page_of(study, results)))
        for path, _ in figures_of(study.name):
            name = f"studies/figures/{study.name}-{path.name}"
            files.append(File.generated(config, name, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any = None, **_: Any) -> str:
    """Fill in quotes and lists, and link names of studies in brackets; mkdocs calls this for every page."""
    results = read_results().statements
    names = "|".join(file.name for file in every_study())
    text = fill_quotes(markdown, results).replace(LIST, list_of(results)).replace(CLAIMS, claims_of_paper(results))
    text = text.replace(COUNT, f"**{count_claims(results)}**")
    return re.sub(rf"\(`({names})`\)", r"([`\1`](studies/\1.md))", text)
