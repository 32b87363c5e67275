"""What a page consists of, as HTML: sections of text, tables and figures, which are saved beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmacexp.data.folder import FIGURES, write_atomically
from cmacexp.metrics.text import find_numeric
from cmacexp.report.svg_panels import extract_panels

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure


SVG = "svg"


@dataclass(frozen=True)
class Table:
    """Rows under named columns; numbers are formatted, with units in the names of their columns."""

    columns: Sequence[str]
    """Names, whose units follow a comma or a line break."""
    rows: Sequence[Sequence[str]]
    caption: str = ""
    cards: bool = False
    """Whether each row is a card of its own on a narrow screen; else the table scrolls sideways there."""

    @property
    def numeric(self) -> frozenset[int]:
        """The columns that hold numbers alone, which are aligned to the right."""
        return find_numeric(self.rows)


@dataclass(frozen=True)
class Drawing:
    """A figure, the name of its files, and its caption."""

    name: str
    figure: "Figure"
    caption: str
    title: str = ""
    """E.g. ``Fig. 10``, if it is one of the paper's."""


@dataclass(frozen=True)
class Folded:
    """Parts that a reader opens."""

    title: str
    parts: "Sequence[PageElement]"


PageElement = str | Table | Drawing | Folded
"""A string is a paragraph, or HTML if it is a ``markupsafe.Markup``."""


@dataclass(frozen=True)
class Section:
    """A section of a report."""

    title: str
    parts: Sequence[PageElement]

    @property
    def anchor(self) -> str:
        """Its anchor in the page."""
        return "".join(c if c.isalnum() else "-" for c in self.title.lower())


class Renderer:
    """Turns parts into HTML by the templates beside this file, and saves figures in the folder of the report."""

    def __init__(self, folder: Path):
        from jinja2 import Environment, FileSystemLoader

        self.folder = folder
        self.files: list[Path] = []
        loader = FileSystemLoader(Path(__file__).parent)
        self.environment = Environment(loader=loader, autoescape=True, trim_blocks=True)
        self.environment.globals.update(save=self._save)

    def render_part(self, part: PageElement) -> str:
        """A part as HTML."""
        template: Any = self.environment.get_template("parts.html").module
        return f"{template.show(part).strip()}\n"

    def render_page(self, **values: Any) -> str:
        """A whole page, from the values that its template names."""
        return self.environment.get_template("page.html").render(values)

    def _save(self, drawing: Drawing) -> "Markup":
        """Save a figure; its panels for the page."""
        from markupsafe import Markup

        (self.folder / FIGURES).mkdir(parents=True, exist_ok=True)
        if engine := drawing.figure.get_layout_engine():
            engine.execute(drawing.figure)  # for which savefig would draw the whole figure once more
            drawing.figure.set_layout_engine(None)
        path = self.folder / FIGURES / f"{drawing.name}.{SVG}"
        with write_atomically(path) as temporary:
            drawing.figure.savefig(temporary, format=SVG, metadata={"Date": None})
        self.files.append(path)
        return Markup(extract_panels(drawing.figure, path.read_text(encoding="utf-8")))
