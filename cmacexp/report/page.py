"""A report: sections of text, tables and figures as one self-contained HTML file."""

import base64
import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256, write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HTML, FIGURES = "report.html", "figures"


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar = "text"
    text: str


@dataclass(frozen=True)
class Table:
    """Rows under named columns; numbers are formatted, with units in the names of their columns."""

    kind: ClassVar = "table"
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    text_columns: int = 1
    """Number of columns, from the left, that hold text and are left-aligned."""


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


Part = Text | Table | Drawing | Image | Html


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


def draw(section: Section, folder: Path) -> tuple[Section, list[Path]]:
    """Save the figures of a section as PNG and SVG below ``folder``; the section with images, and the files."""
    parts: list[Part] = []
    files: list[Path] = []
    for part in section.parts:
        if isinstance(part, Drawing):
            source, saved = save_figure(part.name, part.figure, folder)
            part = Image(part.name, source, part.caption, part.title)
            files += saved
        parts.append(part)
    return replace(section, parts=parts), files


def save_figure(name: str, figure: "Figure", report: Path) -> tuple[str, list[Path]]:
    """Save a figure as PNG and SVG below the folder of a report; its address for the page, and the files."""
    folder = report / FIGURES
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for kind, metadata in (("png", {"Software": None}), ("svg", {"Date": None})):
        path = folder / f"{name}.{kind}"
        with write_atomically(path) as temporary:
            figure.savefig(temporary, format=kind, metadata=metadata)
        figure.set_layout_engine(None)  # computed for the first format, kept for the second
        files.append(path)
    return "data:image/svg+xml;base64," + base64.b64encode(files[-1].read_bytes()).decode(), files


def relative(path: Path, folder: Path) -> str:
    """``path`` relative to ``folder``."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def write_report(report: Report, folder: Path, key: str | None = None) -> Path:
    """Write a report and its figures; the manifest last, with the hash of every file and of its inputs.

    Args:
        report: its content.
        folder: created if missing.
        key: of the code and the inputs behind it, which shows later whether it is up to date; None: of the request.

    Returns:
        The HTML file.
    """
    from jinja2 import Environment, FileSystemLoader

    folder.mkdir(parents=True, exist_ok=True)
    (folder / manifests.NAME).unlink(missing_ok=True)
    drawn = [draw(section, folder) for section in report.sections]
    written = [file for _, files in drawn for file in files]
    environment = Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True)
    page = environment.get_template("page.html").render(report=report, sections=[section for section, _ in drawn])
    with write_atomically(folder / HTML) as temporary:
        temporary.write_text(page)
    written.append(folder / HTML)
    manifests.write(
        folder,
        {
            "kind": manifests.REPORT,
            "status": "completed",
            "config": report.config,
            "key": key or hashlib.sha256(repr((report.title, report.config)).encode()).hexdigest(),
            "versions": manifests.versions(),
            "runs": {relative(path, folder): of_config for path, of_config in report.runs.items()},
            "files": {relative(path, folder): sha256(path) for path in [*written, *report.inputs]},
        },
    )
    return folder / HTML
