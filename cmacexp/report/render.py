"""Parts of a page as HTML; figures are saved beside it and stand in it."""

import base64
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmacexp.data.folder import FIGURES, write_atomically
from cmacexp.report.parts import Drawing, Part

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SVG = "svg"
COLOUR_BAR = "<colorbar>"
"""Label that matplotlib gives to the axes of a colour bar."""


def ignore(text: str) -> None:
    """Used where nobody watches the progress."""


class Renderer:
    """Turns parts into HTML by the templates beside this file.

    Args:
        folder: of the report, where figures are saved.
        say: called with what is done next.
    """

    def __init__(self, folder: Path, say: Callable[[str], None] = ignore):
        from jinja2 import Environment, FileSystemLoader

        self.folder, self.say = folder, say
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
        if engine := drawing.figure.get_layout_engine():
            engine.execute(drawing.figure)  # for which savefig would draw the whole figure once more
            drawing.figure.set_layout_engine(None)
        path = self.folder / FIGURES / f"{drawing.name}.{SVG}"
        with write_atomically(path) as temporary:
            drawing.figure.savefig(temporary, format=SVG, metadata={"Date": None})
        self.files.append(path)
        return "data:image/svg+xml;base64," + base64.b64encode(path.read_bytes()).decode()


def describe(figure: "Figure") -> str:
    """What a figure shows, in words, for readers who do not see it: panels with their axes, names in legends.

    >>> from cmacexp.report.figures import Panel, Series, draw
    >>> describe(draw([Panel("foot", "time, s", "depth, mm", [Series("a", [0], [1]), Series("b", [0], [2])])]))
    'foot: depth, mm over time, s. Legend: a; b.'
    """
    panels = [_describe_axes(axes) for axes in figure.axes if axes.get_label() != COLOUR_BAR and axes.axison]
    legends = [*figure.legends, *(own for axes in figure.axes if (own := axes.get_legend()))]
    names = dict.fromkeys(text.get_text() for legend in legends for text in legend.get_texts())
    count = f"{len(panels)} panels. " if len(panels) > 1 else ""
    return count + "; ".join(filter(None, panels)) + "." + (f" Legend: {'; '.join(names)}." if names else "")


def _describe_axes(axes: "Axes") -> str:
    title = axes.get_title(loc="left") or axes.get_title()
    x, y = axes.get_xlabel(), axes.get_ylabel()
    plane = f"{y} over {x}" if x and y else x or y
    return ": ".join(filter(None, (title, plane))).replace("\n", " ")
