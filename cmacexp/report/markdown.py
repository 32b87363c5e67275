"""Pages written in Markdown with Jinja: values, figures and tables are inserted, each heading begins a section."""

import html
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmacexp.config.fields import listed
from cmacexp.errors import BadInput
from cmacexp.report.alt_text import describe
from cmacexp.report.numbers import format_number
from cmacexp.report.page import Html, Section, save_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class MarkdownPage:
    """A template, and what it may insert.

    ``{% call figure("name", "Fig. 7") %}caption{% endcall %}`` inserts a figure, ``{{ table("name", "caption") }}`` a
    table, ``{{ name }}`` a value; numbers get three digits.

    Args:
        template: file of Markdown with Jinja.
        folder: of the report, where figures are saved.
        figures: called when they are inserted.
        tables: likewise.
        values: further names of the template.
        png: whether figures are saved as PNG too, not as SVG alone.
    """

    def __init__(
        self,
        template: Path,
        folder: Path,
        figures: "Mapping[str, Callable[[], Figure]]",
        tables: "Mapping[str, Callable[[], pd.DataFrame]]",
        values: Mapping[str, Any],
        png: bool = True,
    ):
        self.template, self.folder, self.figures, self.tables = template, folder, figures, tables
        self.png = png
        self.values = {"figure": self._figure, "table": self._table, "number": format_number, **values}
        self.files: list[Path] = []
        """Figures that were saved."""

    def render(self, title: str) -> list[Section]:
        """The sections; what comes before the first heading stands under ``title``.

        Raises:
            BadInput: the template inserts a value that is not given.
        """
        from jinja2 import Environment, StrictUndefined, UndefinedError

        environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=_finalize)
        try:
            text = environment.from_string(self.template.read_text(encoding="utf-8")).render(self.values)
        except UndefinedError as error:
            raise BadInput(
                "page", self.template, f"{error.message}; it may use {listed(list(self.values))}"
            ) from error
        return _sections(text, title)

    def _figure(self, name: str, title: str = "", caller: Callable[[], str] | None = None) -> str:
        """A figure with its caption."""
        figure = self.figures[name]()
        source, files = save_figure(name, figure, self.folder, self.png)
        self.files += files
        caption = caller().strip() if caller else ""
        head = f"<h3>{html.escape(title)}</h3>" if title else ""
        image = f'<div class="scroll"><img src="{source}" alt="{html.escape(describe(figure))}"></div>'
        shown = f"{image}<figcaption>{caption}</figcaption>"
        return f'<figure id="{name}">{head}{shown}</figure>\n'

    def _table(self, name: str, caption: str = "") -> str:
        return _table(self.tables[name](), caption)


def find_insertions(template: Path) -> list[tuple[str, str, int]]:
    """What a template inserts by a name that it spells out: the function, the name and the line.

    Raises:
        BadInput: the template has a syntax error.
    """
    from jinja2 import Environment, TemplateSyntaxError, nodes

    try:
        tree = Environment().parse(template.read_text(encoding="utf-8"))
    except TemplateSyntaxError as error:
        raise BadInput("page", template, f"line {error.lineno}: {error.message}") from error
    return [
        (call.node.name, call.args[0].value, call.lineno)
        for call in tree.find_all(nodes.Call)
        if isinstance(call.node, nodes.Name) and call.args and isinstance(call.args[0], nodes.Const)
    ]


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
