"""Labels on the cells of tables, so that site.css can show a row as a card where the screen is narrow."""

import re
from collections.abc import Sequence
from typing import Any

TABLE = re.compile(r"<table>.*?</table>", flags=re.DOTALL)
ROW = re.compile(r"<tr>.*?</tr>", flags=re.DOTALL)
HEAD = re.compile(r"<th\b[^>]*>(.*?)</th>", flags=re.DOTALL)
EMPTY = re.compile(r"<td\b[^>]*></td>")
FEWEST_COLUMNS = 3
"""Tables with fewer columns fit a narrow screen."""


def label_row(row: str, names: Sequence[str]) -> str:
    """A row whose cells carry the names of their columns, all but the first, which heads the card.

    A first cell alone stands for the rows below it, and is as wide as the table.
    """
    first, *cells = row.split("<td")
    if all(EMPTY.match(f"<td{cell}") for cell in cells[1:]):
        return f'{first}<td colspan="{len(names)}"{cells[0]}</tr>'
    labels = ("" if not index or not name else f' data-label="{name}"' for index, name in enumerate(names))
    return first + "".join(f"<td{label}{cell}" for label, cell in zip(labels, cells, strict=True))


def label_table(match: re.Match[str]) -> str:
    """A table of several columns as one that site.css may show as cards; any other as it is."""
    names = [re.sub(r"<[^>]+>", "", head).strip().replace('"', "&quot;") for head in HEAD.findall(match[0])]
    if len(names) < FEWEST_COLUMNS:
        return match[0]
    rows = ROW.sub(lambda row: label_row(row[0], names) if "<td" in row[0] else row[0], match[0])
    return rows.replace("<table>", '<table data-cards="">', 1)


def on_page_content(content: str, **_: Any) -> str:
    """Called by mkdocs with the HTML of a page."""
    return TABLE.sub(label_table, content)
