"""A report: sections of text, tables and figures as one self-contained HTML file."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any

from cmacexp.data import manifest as manifests
from cmacexp.data.folder import HTML, OUT_KEY, ResultWriter, new_result
from cmacexp.data.version import __version__
from cmacexp.report.page_elements import Renderer, Section
from cmacexp.typing import Status

REPORT = "report"
"""The folder of its report in that of a run."""
HOW_TO_REPORT = "python -m cmacexp.report FOLDER makes the page of one run."


@dataclass(frozen=True)
class Report:
    """The content of one page."""

    title: str
    summary: str
    sections: Sequence[Section]
    config: dict[str, Any] = field(default_factory=dict)
    """The request; stored in the manifest."""
    runs: Mapping[Path, str] = field(default_factory=dict)
    """The hash of the config of every run in it, by folder."""


def relative(path: Path, folder: Path) -> str:
    """``path`` relative to ``folder``."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def find_page(run: Path, folder: Path) -> str:
    """The page of a run relative to the folder of another report; empty if there is none yet."""
    page = run / REPORT / HTML
    return relative(page, folder) if page.is_file() else ""


def write_report(report: Report, where: Path | ResultWriter) -> Path:
    """Write a report and its figures in place of an earlier one; returns its page.

    ``where`` is a folder, or one that is being written. Raises BadInput if it holds something else, and OSError if it
    cannot be written, with an earlier report as it was.
    """
    if isinstance(where, Path):
        with new_result(where, OUT_KEY, manifests.REPORT) as writer:
            return write_report(report, writer)
    renderer = Renderer(where.part)
    commit = manifests.git_commit()
    origin = f"Written on {date.today()} by cmacexp {__version__}" + (f", commit {commit[:10]}." if commit else ".")
    where.write_text(HTML, renderer.render_page(report=report, origin=origin))
    manifests.write(
        where.part,
        {
            "kind": manifests.REPORT,
            "status": Status.COMPLETED,
            "config": report.config,
            "versions": manifests.versions(),
            "runs": {relative(path, where.folder): of_config for path, of_config in report.runs.items()},
            "files": {},
        },
    )
    return where.folder / HTML
