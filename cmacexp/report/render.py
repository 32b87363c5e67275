"""Parts of a page as HTML; figures are saved beside it and stand in it."""

import base64
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cmacexp.data.folder import FIGURES, write_atomically
from cmacexp.report.alt_text import describe
from cmacexp.report.parts import Drawing, Part

PNG, SVG = "png", "svg"


def ignore(text: str) -> None:
    """Used where nobody watches the progress."""


class Renderer:
    """Turns parts into HTML by the templates beside this file.

    Args:
        folder: of the report, where figures are saved.
        png: whether figures are saved as PNG too, not as SVG alone.
        say: called with what is done next.
    """

    def __init__(self, folder: Path, png: bool = True, say: Callable[[str], None] = ignore):
        from jinja2 import Environment, FileSystemLoader

        self.folder, self.kinds, self.say = folder, (PNG, SVG) if png else (SVG,), say
        self.files: list[Path] = []
        """Figures that were saved."""
        loader = FileSystemLoader(Path(__file__).parent)
        self.environment = Environment(loader=loader, autoescape=True, trim_blocks=True)
        self.environment.globals.update(save=self._save, describe=describe)

    def render_part(self, part: Part) -> str:
        """A part as HTML."""
        template: Any = self.environment.get_template("parts.html").module
        return f"{template.show(part).strip()}\n"

    def render_page(self, **values: Any) -> str:
        """A whole page, from the values that its template names."""
        return self.environment.get_template("page.html").render(values)

    def _save(self, drawing: Drawing) -> str:
        """Save a figure; its address for the page."""
        self.say(f"drawing {drawing.name}")
        (self.folder / FIGURES).mkdir(parents=True, exist_ok=True)
        for kind in self.kinds:
            path = self.folder / FIGURES / f"{drawing.name}.{kind}"
            with write_atomically(path) as temporary:
                metadata = {"Date": None} if kind == SVG else {"Software": None}
                drawing.figure.savefig(temporary, format=kind, metadata=metadata)
            drawing.figure.set_layout_engine(None)  # computed for the first format, kept for the second
            self.files.append(path)
        return "data:image/svg+xml;base64," + base64.b64encode(self.files[-1].read_bytes()).decode()
