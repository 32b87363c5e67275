"""Tables of the measured statements, and the pages of the studies, from ``docs/results.json``."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined, UndefinedError

from cmacexp.addons.study.page import build_evidence
from cmacexp.addons.study.results import LAST_CYCLES
from cmacexp.addons.study.study_file import StudyFile
from cmacexp.config.compose import compose_config
from cmacexp.config.load import to_plain
from cmacexp.data.tables import read_table
from cmacexp.metrics.registry import format_number
from cmacexp.report.page import find_insertions
from cmacexp.study import Claim, DataFrame, Finding
from docs.markdown import format_table
from pipelines.benchmark import log_track, summary
from pipelines.benchmark.benchmark import BENCHMARK
from pipelines.benchmark.log_track import NAME as LOG_TRACK
from pipelines.groups import GROUPS, PIPELINES, all_studies, every_study
from pipelines.results import (
    NOT_MEASURED,
    SCORES,
    PublishedResults,
    count_outcomes,
    declared,
    find_entry,
    sentence_of,
)

PAGES = PIPELINES / "pages"
"""Folder of the generated pages of the studies."""
TABLES = {BENCHMARK: BENCHMARK, LOG_TRACK: log_track.SCORES}
"""Table of the scores of a study."""
COLUMNS = ("measured", "value", "95 % interval", "n", "limit", "verdict")
LIMIT = COLUMNS.index("limit")
Statement = Claim | Finding


def title_statement(statement: Statement, entry: Any) -> str:
    """Return the words of a statement; a finding with wordings by verdict gives that of its verdict."""
    if isinstance(statement, Claim):
        return f"“{statement.words}” ({statement.where})"
    if statement.yes and entry:
        return sentence_of(statement, entry)
    return statement.says or statement.yes or statement.criteria[0].quantity


def list_rows(statement: Statement, entry: Any) -> Iterator[tuple[str, ...]]:
    """Yield a row of ``COLUMNS`` for each criterion of a statement."""
    if not entry:
        yield (NOT_MEASURED, *("" for _ in COLUMNS[1:]))
        return
    for quantity, rows in build_evidence(statement.criteria, entry).items():
        for row in rows:
            case = f"{quantity}: {row['case']}" if row["case"] else quantity
            value = f"{row['value']} ({row['reason']})" if row["reason"] else row["value"]
            limit = f"{row['limit']} (opposite: {row['opposite']})" if row["opposite"] else row["limit"]
            yield case, value, row["interval"], row["size"], limit, row["verdict"]


def describe_verdict(statement: Statement, entry: Any) -> str:
    """Return the words of a statement and its verdict, in bold."""
    return f"**{entry['verdict'] if entry else NOT_MEASURED}**: {title_statement(statement, entry)}"


def tabulate_statements(names: Sequence[str], results: PublishedResults) -> str:
    """Tabulate statements, named ``STUDY.STATEMENT``; findings without the criteria that have no limit."""
    rows = []
    for name in names:
        study, _, key = name.strip().partition(".")
        statement = declared()[study][key]
        entry = find_entry(study, key, results.statements)
        words = describe_verdict(statement, entry)
        measured = list(list_rows(statement, entry))
        is_claim = isinstance(statement, Claim)
        chosen = [row for row in measured if is_claim or row[LIMIT]] or measured
        rows += [("" if index else words, *row) for index, row in enumerate(chosen)]
    return format_table(("statement", *COLUMNS), rows)


def tabulate_claims(results: PublishedResults) -> str:
    """Tabulate the claims of the paper in its order, with a table for each study."""
    order = {name: index for index, name in enumerate(GROUPS["paper"].studies)}
    files = sorted(all_studies(), key=lambda file: order.get(file.name, len(order)))
    return "\n\n".join(
        f"### [{file.study.title}]({link_page(file.name)})\n\n"
        + tabulate_statements([f"{file.name}.{name}" for name in file.study.claims], results)
        for file in files
        if file.study.claims
    )


def link_page(study: str) -> str:
    """Return the address of the page of a study, relative to ``docs``."""
    return f"../pipelines/pages/{study}.md"


def list_studies(results: PublishedResults) -> str:
    """Tabulate all studies: question, and the number of statements by verdict."""
    rows = []
    for file in every_study():
        entries = [find_entry(file.name, name, results.statements) for name in file.study.statements]
        counts = count_outcomes([entry["verdict"] if entry else NOT_MEASURED for entry in entries])
        rows.append((f"[{file.study.title}]({link_page(file.name)})", file.study.question, counts))
    return format_table(("study", "question", "statements"), rows)


def describe_run(name: str, results: PublishedResults) -> str:
    """Describe the last full run of a study: date, numbers of runs and seeds."""
    if name not in results.studies:
        return "It has never been run in full."
    study = results.studies[name]
    return (
        f"Last run in full on {study['date']} with version {study['version']}: {study['runs']} runs, "
        f"{study['seeds']} seeds. `python -m pipelines status` shows whether its code has changed since."
    )


def format_statement(statement: Statement, entry: Any) -> str:
    """Format a statement with its verdict, and the table of what was measured."""
    return f"{describe_verdict(statement, entry)}\n\n{format_table(COLUMNS, list_rows(statement, entry))}"


def find_setting(file: StudyFile, key: str, **labels: Any) -> Any:
    """Return a config field of the first declared run with these labels."""
    requests = file.study.runs(False)
    request = next(request for request in requests if labels.items() <= request.labels.items())
    value: Any = to_plain(compose_config(request.overrides))
    for name in key.split("."):
        value = value[name]
    return value


def render_text(file: StudyFile, results: PublishedResults) -> Iterator[str]:
    """Yield the paragraphs of a study's text with its stored statements.

    Left out are figures, tables and paragraphs with values that only the report of a full run computes.
    """

    def finalize(value: Any) -> Any:
        return format_number(value) if isinstance(value, float) else value

    def insert_statement(name: str) -> str:
        return format_statement(file.study.statements[name], find_entry(file.name, name, results.statements))

    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=finalize)
    names = {
        "finding": insert_statement,
        "claim": insert_statement,
        "figure": lambda *_, caller=None: "",
        "table": lambda *_: "",
        "last_cycles": LAST_CYCLES,
        "setting": lambda key, **labels: find_setting(file, key, **labels),
    }
    for paragraph in file.page.read_text(encoding="utf-8").split("\n\n"):
        try:
            yield environment.from_string(paragraph).render(names).strip()
        except UndefinedError:
            continue


def drop_empty_sections(paragraphs: Sequence[str]) -> Iterator[str]:
    """Yield the paragraphs without headings that nothing follows."""
    for paragraph, after in zip(paragraphs, [*paragraphs[1:], "#"], strict=True):
        if not (paragraph.startswith("#") and after.startswith("#")):
            yield paragraph


def format_page(file: StudyFile, results: PublishedResults) -> str:
    """Format the page of a study: question, command, text, statements with what was measured."""
    study = file.study
    command = f"{BENCHMARK} --log LOG --robot go2" if file.name == LOG_TRACK else file.name
    head = (
        f"# {study.title}",
        study.question,
        f"`python -m pipelines.{command}` repeats it and writes a report with figures and tables. "
        f"{describe_run(file.name, results)}",
        "Figures and tables are left out here. [All studies](../../docs/add-a-study.md#the-studies), "
        "[how to read the values](../../docs/add-a-study.md#how-to-read-the-values).",
    )
    if file.name in SCORES:  # the text of the benchmark loops over what a full run computes
        statements = [f"{file.name}.{name}" for name in study.statements]
        scores = SCORES[file.name].read_text(encoding="utf-8").strip()
        return "\n\n".join(
            [*head, "## Statements", tabulate_statements(statements, results), "## Scores", scores, ""]
        )
    text = [paragraph for paragraph in render_text(file, results) if paragraph]
    inserted = {name for _, name, _ in find_insertions(file.page, file.page.read_text(encoding="utf-8"))}
    if claims := [name for name in study.claims if name not in inserted]:
        text += ["## Claims of the paper", tabulate_statements([f"{file.name}.{name}" for name in claims], results)]
    return "\n\n".join([*head, *drop_empty_sections(text), ""])


def format_frame(frame: DataFrame) -> str:
    """Format a table of a study as Markdown."""
    return format_table(list(frame), frame.itertuples(index=False))


def format_scores(frame: DataFrame) -> str:
    """Format ranking, absolute errors and the main results of each machine from the table of the benchmark."""
    parts = [
        ("Ranking: place, mean score of the completed runs, failures", summary.table_ranking(frame), ""),
        ("Absolute errors at the end, medians over the worlds", summary.table_absolute(frame), ""),
        *(
            (name, summary.table_scores(frame, name), summary.describe_order(frame, name))
            for name in frame["machine"].unique()
        ),
    ]
    return "\n".join(f"**{title}**\n\n{format_frame(table)}\n\n{text}\n" for title, table, text in parts)


def write_scores(folder: Path) -> None:
    """Write the scores of full studies below ``folder``: of the benchmark and of its log track."""
    for study, table in TABLES.items():
        if (path := folder / study / f"{table}.parquet").is_file():
            frame = read_table(path, texts=True).to_pandas()
            text = format_scores(frame) if study == BENCHMARK else format_frame(log_track.tabulate(frame))
            SCORES[study].write_text(f"{text}\n", encoding="utf-8")


def write_pages(results: PublishedResults) -> None:
    """Write the pages of all studies."""
    for file in every_study():
        (PAGES / f"{file.name}.md").write_text(format_page(file, results), encoding="utf-8")
