"""A report: sections of text, tables and figures as one self-contained HTML file."""

import base64
import hashlib
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256
from cmacexp.data.folder import FIGURES, HTML, OUT_KEY, Place, replacing
from cmacexp.report.alt_text import describe

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPORT = "report"
"""The folder of its report in that of a run."""
PNG, SVG = "png", "svg"
HOW_TO_REPORT = "python -m cmacexp.report FOLDER makes the page of one run."


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar = "text"
    text: str


@dataclass(frozen=True)
class Link:
    """A cell of a table that leads to another page."""

    text: str
    address: str


@dataclass(frozen=True)
class Table:
    """Rows under named columns; numbers are formatted, with units in the names of their columns."""

    kind: ClassVar = "table"
    columns: Sequence[str]
    rows: "Sequence[Sequence[str | Link]]"
    caption: str = ""
    text_columns: int = 1
    """Number of columns, from the left, that hold text and are left-aligned."""
    cards: bool = False
    """Whether each row is a card of its own on a narrow screen; else the table scrolls sideways there."""
    marked: Collection[int] = ()
    """Numbers of rows that stand out."""


@dataclass(frozen=True)
class Html:
    """Part of a page that is HTML already."""

    kind: ClassVar = "html"
    html: str


@dataclass(frozen=True)
class Drawing:
    """A figure, the name of its files, and its caption."""

    name: str
    figure: "Figure"
    caption: str
    title: str = ""
    """E.g. ``Fig. 10``, if it is one of the paper's."""


@dataclass(frozen=True)
class Image:
    """A drawing that has been saved."""

    kind: ClassVar = "image"
    name: str
    source: str
    """Address of its data."""
    caption: str
    title: str
    alt: str
    """What it shows, for those who do not see it."""


@dataclass(frozen=True)
class Folded:
    """Parts that a reader opens."""

    kind: ClassVar = "folded"
    title: str
    parts: "Sequence[Part]"


Part = Text | Table | Drawing | Image | Html | Folded


@dataclass(frozen=True)
class Section:
    """A section of a report."""

    title: str
    parts: Sequence[Part]

    @property
    def anchor(self) -> str:
        """Its anchor in the page."""
        return "".join(c if c.isalnum() else "-" for c in self.title.lower())


@dataclass(frozen=True)
class Report:
    """The content of one page."""

    title: str
    summary: str
    sections: Sequence[Section]
    inputs: Sequence[Path]
    """Every file that its numbers are computed from."""
    config: dict[str, Any] = field(default_factory=dict)
    """The request; stored in the manifest."""
    runs: Mapping[Path, str] = field(default_factory=dict)
    """The hash of the config of every run in it, by folder."""


def draw(section: Section, folder: Path, say: Callable[[str], None]) -> tuple[Section, list[Path]]:
    """Save the figures of a section below ``folder``; the section with images, and the files.

    Args:
        section: not changed.
        folder: of the report.
        say: called with what is done next.
    """
    parts: list[Part] = []
    files: list[Path] = []
    for part in section.parts:
        if isinstance(part, Drawing):
            say(f"drawing {part.name}")
            source, saved = save_figure(part.name, part.figure, folder)
            part = Image(part.name, source, part.caption, part.title, describe(part.figure))
            files += saved
        parts.append(part)
    return replace(section, parts=parts), files


def save_figure(name: str, figure: "Figure", report: Path, png: bool = True) -> tuple[str, list[Path]]:
    """Save a figure as SVG, and as PNG unless that is not wanted, below the folder of a report.

    Returns:
        Its address for the page, and the files.
    """
    folder = report / FIGURES
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for kind, metadata in (*([(PNG, {"Software": None})] if png else []), (SVG, {"Date": None})):
        path = folder / f"{name}.{kind}"
        figure.savefig(path, format=kind, metadata=metadata)
        figure.set_layout_engine(None)  # computed for the first format, kept for the second
        files.append(path)
    return "data:image/svg+xml;base64," + base64.b64encode(files[-1].read_bytes()).decode(), files


def relative(path: Path, folder: Path) -> str:
    """``path`` relative to ``folder``."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def _name_in(place: Place, path: Path) -> str:
    """The name of a file in the manifest of a report: of a new one where it will be, relative to the report."""
    full, new = path.resolve(), place.new.resolve()
    return full.relative_to(new).as_posix() if full.is_relative_to(new) else relative(path, place.folder)


def find_page(run: Path, folder: Path) -> str:
    """The page of a run relative to the folder of another report; empty if there is none yet."""
    page = run / REPORT / HTML
    return relative(page, folder) if page.is_file() else ""


def _ignore(text: str) -> None:
    """Nobody watches."""


def _describe_origin() -> str:
    """When and by what a page is written."""
    commit = manifests.git_commit()
    version = f"cmacexp {manifests.versions()['cmacexp']}" + (f", commit {commit[:10]}" if commit else "")
    return f"Written on {date.today().isoformat()} by {version}."


def write_report(report: Report, folder: Path, key: str | None = None, say: Callable[[str], None] = _ignore) -> Path:
    """Write a report and its figures in place of an earlier one.

    Args:
        report: its content.
        folder: created if missing.
        key: of the code and the inputs behind it, which shows later whether it is up to date; None: of the request.
        say: called with what is done next.

    Returns:
        The HTML file.

    Raises:
        BadInput: the folder is in use, or holds something else.
        OSError: it cannot be written; an earlier report in it is as it was.
    """
    with replacing(folder, OUT_KEY, manifests.REPORT) as place:
        return write_report_in(place, report, key, say)


def write_report_in(
    place: Place, report: Report, key: str | None = None, say: Callable[[str], None] = _ignore
) -> Path:
    """:func:`write_report` where the folder is locked already; the manifest has the hash of every file and input.

    Args:
        place: of the report; inputs that are below ``place.new`` move with it.
        report: as in :func:`write_report`.
        key: likewise.
        say: likewise.

    Returns:
        The HTML file.
    """
    from jinja2 import Environment, FileSystemLoader

    drawn = [draw(section, place.new, say) for section in report.sections]
    written = [file for _, files in drawn for file in files]
    environment = Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True)
    page = environment.get_template("page.html").render(
        report=report, sections=[section for section, _ in drawn], origin=_describe_origin()
    )
    place.write_text(HTML, page)
    written.append(place.new / HTML)
    place.commit(
        {
            "kind": manifests.REPORT,
            "status": "completed",
            "config": report.config,
            "key": key or hashlib.sha256(repr((report.title, report.config)).encode()).hexdigest(),
            "versions": manifests.versions(),
            "runs": {relative(path, place.folder): of_config for path, of_config in report.runs.items()},
            "files": {_name_in(place, path): sha256(path) for path in [*written, *report.inputs]},
        }
    )
    return place.folder / HTML
