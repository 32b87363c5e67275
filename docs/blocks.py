"""Generated blocks of the pages, between two comments that a reader does not see.

``<!-- generated: KIND ARGUMENTS -->`` begins a block, ``<!-- end -->`` ends it; ``python -m pipelines --write-docs``
replaces what stands between them. ``KINDS`` lists the kinds. The text of a ``template`` is a file of
``docs/templates``, in which quotes of results are filled in.
"""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import cmacexp
from cmacexp.errors import require_name
from docs import api_tables, config_tables, declared_tables, study_tables
from docs.markdown import format_table
from pipelines.benchmark.log_track import NAME as LOG_TRACK
from pipelines.results import DOCS, PAGES, SCORES, PublishedResults, count_claims, fill_quotes

BLOCK = re.compile(r"(<!-- generated: (\w+)(?: ([^\n]*))? -->\n).*?(<!-- end -->)", flags=re.DOTALL)
FIRST_RUN = ("transfer_rmse_x", "transfer_rmse_y", "force_rmse")
"""Metrics of the table of a first run."""
LOG_METHODS = {
    "identified from earlier strokes": "plant identified from earlier strokes",
    "model and CMAC over phase": "nominal model and CMAC over phase",
    "stroke before": "repeating the stroke before",
    "CMAC over phase": "CMAC over phase",
    "model": "nominal model",
    "CMAC over angles and velocities": "CMAC over angles and velocities, as in the paper",
}
"""Methods of the log track in the README, with their names there."""


def fill_template(name: str, results: PublishedResults) -> str:
    """Fill the quotes in a template."""
    text = (DOCS / "templates" / f"{name}.txt").read_text(encoding="utf-8")
    return fill_quotes(text.replace("{{ count }}", count_claims(results.statements)), results.statements)


def tabulate_run(arguments: str, _: PublishedResults) -> str:
    """Execute a run, and tabulate errors of some cycles; ``arguments`` are overrides, then cycles."""
    overrides, _, cycles = arguments.partition(" cycles ")
    with TemporaryDirectory() as folder:
        metrics = cmacexp.run(overrides.split(), Path(folder, "run")).metrics.set_index("cycle")
    rows = []
    for cycle in map(int, cycles.split()):
        x, y, force = (float(metrics.loc[cycle, name]) for name in FIRST_RUN)
        rows.append((cycle, f"{1e3 * x:.2f}", f"{1e3 * y:.2f}", f"{force:.3f}"))
    return format_table(("cycle", "x error, mm", "y error, mm", "force error, N"), rows)


def read_ranking(_: str, results: PublishedResults) -> str:
    """Read the ranking of methods from the tables of the last full benchmark."""
    return SCORES["benchmark"].read_text(encoding="utf-8").partition("\n\n")[2].partition("\n\n")[0]


def tabulate_log(_: str, results: PublishedResults) -> str:
    """Tabulate the torque that some methods leave on the log of a real robot."""
    rows = [line.strip("| ").split(" | ") for line in SCORES[LOG_TRACK].read_text(encoding="utf-8").splitlines()]
    left = {row[0]: row[1] for row in rows}
    return format_table(
        ("method", "torque left, % [95 % interval]"), [(LOG_METHODS[name], left[name]) for name in LOG_METHODS]
    )


KINDS: Mapping[str, Callable[[str, PublishedResults], str]] = {
    "api": lambda _, results: api_tables.format_api(),
    "claims": lambda _, results: study_tables.tabulate_claims(results),
    "columns": lambda name, results: declared_tables.TABLES[name](),
    "count": lambda _, results: f"**{count_claims(results.statements)}**",
    "fields": lambda _, results: config_tables.format_fields(),
    "ranking": read_ranking,
    "log": tabulate_log,
    "results": lambda names, results: study_tables.tabulate_statements(names.split(";"), results),
    "run": tabulate_run,
    "studies": lambda _, results: study_tables.list_studies(results),
    "template": fill_template,
}
"""Functions that make a block from its arguments and the results of the studies, by kind."""


def renew_blocks(text: str, results: PublishedResults) -> str:
    """Replace the generated blocks of a page.

    Raises:
        BadInput: there is no such kind of block.
    """

    def renew(match: re.Match[str]) -> str:
        begin, kind, arguments, end = match.groups(default="")
        require_name("block", kind, KINDS)
        return f"{begin}\n{KINDS[kind](arguments, results).strip()}\n\n{end}"

    return BLOCK.sub(renew, text)


def write_pages(results: PublishedResults) -> None:
    """Renew the blocks of all pages, and the pages of the studies."""
    for page in PAGES:
        page.write_text(renew_blocks(page.read_text(encoding="utf-8"), results), encoding="utf-8")
    study_tables.write_pages(results)
