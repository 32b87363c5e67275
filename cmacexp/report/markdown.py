"""Pages written in Markdown with Jinja: values, figures and tables are inserted, each heading begins a section."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined, TemplateSyntaxError, UndefinedError, nodes
from markupsafe import Markup

from cmacexp.config.fields import listed
from cmacexp.errors import BadInput
from cmacexp.metrics.text import format_number
from cmacexp.report.page import Drawing, Renderer, Section, Table
from cmacexp.typing import DataFrame, Figure


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
        caption = Markup(caller().strip() if caller else "")
        return renderer.render_part(Drawing(name, figures[name](), caption, title))

    def insert_table(name: str, caption: str = "") -> str:
        frame = tables[name]()
        rows = [[_format_cell(value) for value in row] for row in frame.itertuples(index=False)]
        return renderer.render_part(Table([str(column) for column in frame], rows, caption))

    names = {"figure": insert_figure, "table": insert_table, "number": format_number, **values}
    finalize = lambda value: format_number(value) if isinstance(value, float) else value  # noqa: E731
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=finalize)
    try:
        text = environment.from_string(page).render(names)
    except UndefinedError as error:
        raise BadInput("page", template, f"{error.message}; it may use {listed(list(names))}") from error
    return _sections(text, title)


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


def _sections(markdown: str, title: str) -> list[Section]:
    """A section for every heading of the second level; what comes before the first stands under the study's title."""
    from markdown_it import MarkdownIt

    converter = MarkdownIt("commonmark").enable("table")
    found = []
    for index, part in enumerate(re.split(r"^## ", markdown, flags=re.MULTILINE)):
        heading, _, text = (title, "", part) if index == 0 else part.partition("\n")
        if text.strip():
            found.append(Section(heading.strip(), [Markup(converter.render(text))]))
    return found
