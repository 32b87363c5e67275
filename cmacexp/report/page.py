"""A report: sections of text, tables and figures as one self-contained HTML file, with its figures beside it.

The page contains a figure in pieces, cut from its file: its legends and each of its panels. A narrow screen then
shows one panel per row, and a printed page can break a figure between two rows. A page may be written in Markdown
with Jinja: values, figures and tables are inserted, and each heading of the second level begins a section.
"""

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from itertools import zip_longest
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateSyntaxError, UndefinedError, nodes
from markupsafe import Markup

from cmacexp.config.fields import listed
from cmacexp.data import manifest as manifests
from cmacexp.data.files import sha256
from cmacexp.data.folder import OUT_KEY, ResultWriter, new_result
from cmacexp.data.own_files import FIGURES, HTML
from cmacexp.data.version import __version__
from cmacexp.errors import BadInput
from cmacexp.metrics.registry import find_numeric, format_number
from cmacexp.typing import Array, DataFrame, Figure, Status

SVG = "svg"
GROUPS = re.compile(r'^  <g id="(?P<kind>axes|legend)_\d+">\n.*?^  </g>\n', re.DOTALL | re.MULTILINE)
DEFINITIONS = re.compile(r"^ <defs>.*?^ </defs>\n", re.DOTALL | re.MULTILINE)
CODE_SPAN = re.compile(r"((?<!`)(?P<ticks>`+)(?!`).*?(?<!`)(?P=ticks)(?!`))", re.DOTALL)
ENTITIES = {ord(sign): f"&#{ord(sign)};" for sign in "&<>\"'[]()*_|~#!`\\-+=."}
"""HTML entities of the characters that form HTML, links, pictures, emphasis, lists and the like in Markdown."""
POINTS = 72.0
"""Points per inch; a point is the unit of an SVG."""
PAD = 3.0
"""Margin around a piece of a figure, points."""
REPORT = "report"
"""Name of the folder of a report within the folder of a run."""
HOW_TO_REPORT = "python -m cmacexp.report FOLDER makes the page of one run."


@dataclass(frozen=True)
class Table:
    """Rows under named columns; numbers are formatted, with units in the names of their columns."""

    columns: Sequence[str]
    """Names, with the unit after a comma or a line break."""
    rows: Sequence[Sequence[str]]
    caption: str = ""
    cards: bool = False
    """True if a narrow screen shows each row as a card; else the table scrolls sideways there."""
    folded: str = ""
    """Title of the folded table, which a reader can open; empty: the table is always open."""


@dataclass(frozen=True)
class Drawing:
    """A figure, with the name of its file and its caption."""

    name: str
    figure: Figure
    caption: str
    title: str = ""
    """Number of the figure that it repeats from the paper, e.g. ``Fig. 10``."""


PageElement = str | Table | Drawing
"""An element of a section; a string is a paragraph, or HTML if it is a ``markupsafe.Markup``."""


@dataclass(frozen=True)
class Section:
    """A section of a page: its title and elements."""

    title: str
    parts: Sequence[PageElement]

    @property
    def anchor(self) -> str:
        """Anchor of the section in the page."""
        return "".join(c if c.isalnum() else "-" for c in self.title.lower())


class Renderer:
    """Renderer of page elements to HTML with the templates beside this file; saves figures in the page's folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.environment = Environment(
            loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True
        )
        self.environment.globals.update(save=self._save, find_numeric=find_numeric)

    def render_part(self, element: PageElement) -> Markup:
        """Render an element as HTML without empty lines, at which Markdown would end it."""
        template: Any = self.environment.get_template("parts.html").module
        return Markup(re.sub(r"\n\s*\n", "\n", f"{template.show(element).strip()}\n"))

    def _save(self, drawing: Drawing) -> Markup:
        """Save a figure as SVG; return its pieces for the page."""
        (self.folder / FIGURES).mkdir(parents=True, exist_ok=True)
        if engine := drawing.figure.get_layout_engine():
            engine.execute(drawing.figure)  # else savefig draws the figure once more for it
            drawing.figure.set_layout_engine(None)
        path = self.folder / FIGURES / f"{drawing.name}.{SVG}"
        drawing.figure.savefig(path, format=SVG, metadata={"Date": None})
        return Markup(cut_figure(drawing.figure, path.read_text(encoding="utf-8")))


def _find_panels(figure: Figure) -> list[Array]:
    """Return the extent (2, 2) of each panel in pixels, [[left, bottom], [right, top]].

    A panel is as wide as its column and as high as its row. A figure with axes outside its grid, such as a colour bar
    beside a map, is one panel.
    """
    specs = [spec for axes in figure.axes if (spec := axes.get_subplotspec()) is not None]
    if len(specs) < len(figure.axes):
        return [np.array([[0.0, 0.0], figure.bbox.max])]
    boxes = np.array([np.asarray(axes.get_tightbbox()) for axes in figure.axes])
    columns = np.array([spec.colspan.start for spec in specs])
    rows = np.array([spec.rowspan.start for spec in specs])
    panels = []
    for spec, column, row in zip(specs, columns, rows, strict=True):
        left, right = boxes[columns == column, 0, 0].min(), boxes[columns == column, 1, 0].max()
        bottom, top = boxes[rows == row, 0, 1].min(), boxes[rows == row, 1, 1].max()
        ratios = np.asarray(spec.get_gridspec().get_width_ratios(), dtype=float)
        least = 0.96 * figure.bbox.width * ratios[column] / ratios.sum()
        panels.append(np.array([[left, bottom], [max(right, left + least), top]]))
    return panels


def cut_figure(figure: Figure, drawn: str) -> str:
    """Cut a figure into its legends and panels, as HTML.

    ``drawn`` is the SVG of the figure. The ids of its groups are removed, since they would not be unique on a page.
    """
    plain = re.sub(r"\s*<!--.*?-->", "", drawn, flags=re.DOTALL)  # a blank line would end HTML in Markdown
    texts: dict[str, list[str]] = {"axes": [], "legend": []}
    for group in GROUPS.finditer(plain):
        texts[group["kind"]].append(re.sub(r'<g id="[^"]*"', "<g", group[0]))
    boxes = [legend.get_window_extent().get_points() for legend in figure.legends]
    pieces = [(box, "legend", text) for box, text in zip(boxes, texts["legend"], strict=True)]
    panels = _find_panels(figure)
    drawn_in = texts["axes"] if len(panels) == len(texts["axes"]) else ["".join(texts["axes"])]
    pieces += [(box, "panel", text) for box, text in zip(panels, drawn_in, strict=True)]
    definitions = "".join(DEFINITIONS.findall(plain))
    width, height = figure.get_size_inches() * POINTS
    columns = {round(box[0, 0]): np.ptp(box[:, 0]) * POINTS / figure.dpi + 2.0 * PAD for box in panels}
    percent = 100.0 / max(width, 1.01 * sum(columns.values()))  # all columns fit into a row
    drawings = []
    for box, kind, text in pieces:
        (left, bottom), (right, top) = box * POINTS / figure.dpi + [[-PAD], [PAD]]
        view = f"{left:.1f} {height - top:.1f} {right - left:.1f} {top - bottom:.1f}"
        share = min(percent * (right - left), 100.0)
        drawings.append(f'<svg class="{kind}" style="--width:{share:.1f}" viewBox="{view}">{definitions}{text}</svg>')
        definitions = ""
    return "\n".join(drawings)


@dataclass(frozen=True)
class Report:
    """The content of one page."""

    title: str
    summary: str
    sections: Sequence[Section]
    config: dict[str, Any] = field(default_factory=dict)
    """The request for this report, which its manifest stores."""
    runs: Mapping[Path, str] = field(default_factory=dict)
    """Config hash of every run in the report, by the folder of the run."""


def make_relative(path: Path, folder: Path) -> str:
    """Return ``path`` relative to ``folder``, with slashes."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def find_page(run: Path, folder: Path) -> str:
    """Return the address of the page of a run in another report, relative to its folder; empty if there is none."""
    page = run / REPORT / HTML
    return f"./{quote(make_relative(page, folder))}" if page.is_file() else ""


def write_report(report: Report, where: Path | ResultWriter) -> Path:
    """Write a report and its figures, replacing an earlier report; return the path of its page.

    ``where`` is a folder, or the writer of a folder. Raises BadInput if the folder contains anything but a report,
    and OSError if it cannot be written; an earlier report then stays unchanged.
    """
    if isinstance(where, Path):
        with new_result(where, OUT_KEY, manifests.REPORT) as writer:
            return write_report(report, writer)
    renderer = Renderer(where.part)
    commit = manifests.read_environment().git_commit
    origin = f"Written on {date.today()} by cmacexp {__version__}" + (f", commit {commit[:10]}." if commit else ".")
    where.write_text(HTML, renderer.environment.get_template("page.html").render(report=report, origin=origin))
    manifests.write(
        where.part,
        {
            "kind": manifests.REPORT,
            "status": Status.COMPLETED,
            "config": report.config,
            "versions": manifests.read_environment().versions,
            "runs": {make_relative(path, where.folder): of_config for path, of_config in report.runs.items()},
            "files": {name: sha256(where.part / name) for name in where.list_files()},
        },
    )
    return where.folder / HTML


def escape_markdown(value: object) -> Markup:
    """Escape a text for a page of Markdown, in one line; it may contain code spans, but no HTML.

    ``Markup``, such as a table or a figure, is returned unchanged.
    """
    if isinstance(value, Markup):
        return value
    texts_and_spans = CODE_SPAN.split(re.sub(r"\s+", " ", str(value)))  # text, code span, its backquotes, text, ...
    pieces = zip_longest(texts_and_spans[::3], texts_and_spans[1::3], fillvalue="")
    return Markup("".join(text.translate(ENTITIES) + span for text, span in pieces))


def render_markdown(
    page: str,
    template: Path,
    title: str,
    renderer: Renderer,
    figures: Mapping[str, Callable[[], Figure]],
    tables: Mapping[str, Callable[[], DataFrame]],
    values: Mapping[str, Any],
) -> list[Section]:
    """Render a page of Markdown with Jinja into its sections.

    ``{% call figure("name", "Fig. 7") %}caption{% endcall %}`` inserts a figure, ``{{ table("name", "caption") }}`` a
    table, ``{{ name }}`` a value; numbers get three digits.

    Args:
        page: the text of ``template``.
        template: file of the page, for error messages.
        title: title of the text before the first heading.
        renderer: renderer of the figures and tables.
        figures: functions that make the figures, by name; called when the page inserts them.
        tables: functions that make the tables, by name; called when the page inserts them.
        values: values that the page may insert, by name.

    Raises:
        BadInput: the page inserts a value that does not exist.
    """

    def insert_figure(name: str, title: str = "", caller: Callable[[], str] | None = None) -> str:
        caption = caller().strip() if caller else ""
        return renderer.render_part(Drawing(name, figures[name](), caption, title))

    def insert_table(name: str, caption: str = "") -> str:
        frame = tables[name]()
        rows = [[_format_cell(value) for value in row] for row in frame.itertuples(index=False)]
        return renderer.render_part(Table([str(column) for column in frame], rows, caption))

    names = {"figure": insert_figure, "table": insert_table, "number": format_number, **values}

    def finalize(value: Any) -> Any:
        return format_number(value) if isinstance(value, float) else escape_markdown(value)

    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=finalize, autoescape=True
    )
    try:
        text = environment.from_string(page).render(names)
    except UndefinedError as error:
        raise BadInput("page", template, f"{error.message}; it may use {listed(list(names))}") from error
    return list(_split_sections(text, title))


def find_insertions(template: Path, page: str) -> list[tuple[str, str, int]]:
    """List the insertions of a page by literal name, as (function, name, line).

    ``page`` is the text of ``template``. Raises BadInput if its syntax is wrong.
    """
    try:
        tree = Environment().parse(page)
    except TemplateSyntaxError as error:
        raise BadInput("page", template, f"line {error.lineno}: {error.message}") from error
    return [
        (call.node.name, call.args[0].value, call.lineno)
        for call in tree.find_all(nodes.Call)
        if isinstance(call.node, nodes.Name) and call.args and isinstance(call.args[0], nodes.Const)
    ]


def _format_cell(value: Any) -> str:
    if value is None or type(value).__name__ == "NAType":  # the missing value of pandas
        return "-"
    return format_number(float(value)) if isinstance(value, float) else str(value)


def _split_sections(markdown: str, title: str) -> Iterator[Section]:
    """Yield a section per heading of the second level; the text before the first one gets the ``title``."""
    from markdown_it import MarkdownIt

    converter = MarkdownIt("commonmark").enable("table")
    for index, section in enumerate(re.split(r"^## ", markdown, flags=re.MULTILINE)):
        heading, _, text = (title, "", section) if index == 0 else section.partition("\n")
        if text.strip():
            plain = Markup(heading.strip()).unescape() if index else title
            yield Section(plain, [Markup(converter.render(text))])
