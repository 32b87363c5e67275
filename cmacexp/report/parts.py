"""What a page consists of: sections of text, tables and figures."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMBER = re.compile(r"([-+]?(\d[\d.]*(e[-+]?\d+|-\d+)?|infinite)( .*)?|-|undefined)?")
"""A cell that is a number or a range, with its unit or a remark, or says that there is none."""


@dataclass(frozen=True)
class Table:
    """Rows under named columns; numbers are formatted, with units in the names of their columns."""

    columns: Sequence[str]
    """Names, whose units follow a comma or a line break."""
    rows: Sequence[Sequence[str]]
    caption: str = ""
    cards: bool = False
    """Whether each row is a card of its own on a narrow screen; else the table scrolls sideways there."""
    marked: Collection[int] = ()
    """Numbers of rows that stand out."""

    @property
    def numeric(self) -> frozenset[int]:
        """The columns that hold numbers alone, which are aligned to the right."""
        columns = zip(*self.rows, strict=True)
        return frozenset(i for i, cells in enumerate(columns) if all(NUMBER.fullmatch(cell) for cell in cells))


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
    parts: "Sequence[Part]"


Part = str | Table | Drawing | Folded
"""A string is a paragraph, or HTML if it is a ``markupsafe.Markup``."""


@dataclass(frozen=True)
class Section:
    """A section of a report."""

    title: str
    parts: Sequence[Part]

    @property
    def anchor(self) -> str:
        """Its anchor in the page."""
        return "".join(c if c.isalnum() else "-" for c in self.title.lower())
