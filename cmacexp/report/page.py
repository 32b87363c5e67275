"""A report: sections of text, tables and figures as one self-contained HTML file, with its figures beside it.

A figure stands on the page in pieces, cut from its file: its legends and each of its panels. A narrow screen then
shows one panel in a row, and print can break a figure between two rows. A page may be written in Markdown with Jinja:
values, figures and tables are inserted, each heading begins a section.
"""

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
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
"""Instead of signs that form HTML, links, pictures, emphasis, lists and the like in Markdown."""
POINTS = 72.0
"""Points in an inch; the unit of an SVG."""
PAD = 3.0
"""Around a piece of a figure, points."""
REPORT = "report"
"""The folder of its report in that of a run."""
HOW_TO_REPORT = "python -m cmacexp.report FOLDER makes the page of one run."


@dataclass(frozen=True)
class Table:
    """Rows under named columns; numbers are formatted, with units in the names of their columns."""

    columns: Sequence[str]
    """Names, whose units follow a comma or a line break."""
    rows: Sequence[Sequence[str]]
    caption: str = ""
    cards: bool = False
    """Whether each row is a card of its own on a narrow screen; else the table scrolls sideways there."""
    folded: str = ""
    """The title under which a reader opens it; empty: it is open."""


@dataclass(frozen=True)
class Drawing:
    """A figure, the name of its file, and its caption."""

    name: str
    figure: Figure
    caption: str
    title: str = ""
    """E.g. ``Fig. 10``, if it is one of the paper's."""


PageElement = str | Table | Drawing
"""A string is a paragraph, or HTML if it is a ``markupsafe.Markup``."""


@dataclass(frozen=True)
class Section:
    """A section of a page."""

    title: str
    parts: Sequence[PageElement]

    @property
    def anchor(self) -> str:
        """Its anchor in the page."""
        return "".join(c if c.isalnum() else "-" for c in self.title.lower())


class Renderer:
    """Renders elements as HTML by the templates beside this file, and saves figures in the folder of a page."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.environment = Environment(
            loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True
        )
        self.environment.globals.update(save=self._save, find_numeric=find_numeric)

    def render_part(self, part: PageElement) -> Markup:
        """Render an element as HTML without an empty line, which would end it in Markdown."""
        template: Any = self.environment.get_template("parts.html").module
        return Markup(re.sub(r"\n\s*\n", "\n", f"{template.show(part).strip()}\n"))

    def _save(self, drawing: Drawing) -> Markup:
        """Save a figure; returns its pieces for the page."""
        (self.folder / FIGURES).mkdir(parents=True, exist_ok=True)
        if engine := drawing.figure.get_layout_engine():
            engine.execute(drawing.figure)  # for which savefig would draw the whole figure once more
            drawing.figure.set_layout_engine(None)
        path = self.folder / FIGURES / f"{drawing.name}.{SVG}"
        drawing.figure.savefig(path, format=SVG, metadata={"Date": None})
        return Markup(cut_figure(drawing.figure, path.read_text(encoding="utf-8")))


def _find_panels(figure: Figure) -> list[Array]:
    """Extent (2, 2) of each panel, display units, as wide as its column and as high as its row.

    A figure with axes outside its grid, such as a bar of colours beside a map, is one panel.
    """
    specs = [spec for axes in figure.axes if (spec := axes.get_subplotspec()) is not None]
    if len(specs) < len(figure.axes):
        return [np.array([[0.0, 0.0], figure.bbox.max])]
    boxes = np.array([np.asarray(axes.get_tightbbox()) for axes in figure.axes])
    columns = np.array([spec.colspan.start for spec in specs])
    rows = np.array([spec.rowspan.start for spec in specs])
    found = []
    for spec, column, row in zip(specs, columns, rows, strict=True):
        left, right = boxes[columns == column, 0, 0].min(), boxes[columns == column, 1, 0].max()
        bottom, top = boxes[rows == row, 0, 1].min(), boxes[rows == row, 1, 1].max()
        ratios = np.asarray(spec.get_gridspec().get_width_ratios(), dtype=float)
        least = 0.96 * figure.bbox.width * ratios[column] / ratios.sum()
        found.append(np.array([[left, bottom], [max(right, left + least), top]]))
    return found


def cut_figure(figure: Figure, drawn: str) -> str:
    """The pieces of a drawn figure as HTML; ``drawn`` is its SVG. Names of groups, which a page repeats, go."""
    plain = re.sub(r"\s*<!--.*?-->", "", drawn, flags=re.DOTALL)  # a blank line would end HTML in Markdown
    texts: dict[str, list[str]] = {"axes": [], "legend": []}
    for found in GROUPS.finditer(plain):
        texts[found["kind"]].append(re.sub(r'<g id="[^"]*"', "<g", found[0]))
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
    """The request; stored in the manifest."""
    runs: Mapping[Path, str] = field(default_factory=dict)
    """The hash of the config of every run in it, by folder."""


def relative(path: Path, folder: Path) -> str:
    """``path`` relative to ``folder``."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def find_page(run: Path, folder: Path) -> str:
    """Return the address of the page of a run in another report, relative to its folder; empty if there is none."""
    page = run / REPORT / HTML
    return f"./{quote(relative(page, folder))}" if page.is_file() else ""


def write_report(report: Report, where: Path | ResultWriter) -> Path:
    """Write a report and its figures in place of an earlier one; returns its page.

    ``where`` is a folder, or one that is being written. Raises BadInput if it holds something else, and OSError if it
    cannot be written, with an earlier report as it was.
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
            "runs": {relative(path, where.folder): of_config for path, of_config in report.runs.items()},
            "files": {name: sha256(where.part / name) for name in where.list_files()},
        },
    )
    return where.folder / HTML


def escape_markdown(value: object) -> Markup:
    """Escape a text for a page of Markdown: it stays text, in one line, and can form code spans but no HTML.

    What is ``Markup`` already, as a table or a figure is, stays as it is.
    """
    if isinstance(value, Markup):
        return value
    line, escaped, end = re.sub(r"\s+", " ", str(value)), "", 0
    for span in CODE_SPAN.finditer(line):
        escaped += line[end : span.start()].translate(ENTITIES) + span[0]
        end = span.end()
    return Markup(escaped + line[end:].translate(ENTITIES))


def render_markdown(
    page: str,
    template: Path,
    title: str,
    renderer: Renderer,
    figures: Mapping[str, Callable[[], Figure]],
    tables: Mapping[str, Callable[[], DataFrame]],
    values: Mapping[str, Any],
) -> list[Section]:
    """The sections of a ``page`` of Markdown with Jinja, the text of ``template``.

    What comes before the first heading stands under ``title``.

    ``{% call figure("name", "Fig. 7") %}caption{% endcall %}`` inserts a figure, ``{{ table("name", "caption") }}`` a
    table, which are called then; ``{{ name }}`` a value; numbers get three digits. Raises BadInput if the template
    inserts a value that is not given.
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
    """What the ``page`` of a template inserts by a name that it spells out: function, name, line; raises BadInput."""
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
    if value is None or type(value).__name__ == "NAType":  # of pandas
        return "-"
    return format_number(float(value)) if isinstance(value, float) else str(value)


def _split_sections(markdown: str, title: str) -> Iterator[Section]:
    """A section for every heading of the second level; what comes before the first stands under the study's title."""
    from markdown_it import MarkdownIt

    converter = MarkdownIt("commonmark").enable("table")
    for index, part in enumerate(re.split(r"^## ", markdown, flags=re.MULTILINE)):
        heading, _, text = (title, "", part) if index == 0 else part.partition("\n")
        if text.strip():
            plain = Markup(heading.strip()).unescape() if index else title
            yield Section(plain, [Markup(converter.render(text))])
