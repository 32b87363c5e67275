"""Labels on the cells of tables, so that site.css can show each row as a card on a narrow screen."""

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
    """Label the cells of a row with the names of their columns, except the first cell, which is the card's title.

    If all other cells are empty, the first cell is a heading of the rows below it, and spans the table.
    """
    first, *cells = row.split("<td")
    if all(EMPTY.match(f"<td{cell}") for cell in cells[1:]):
        return f'{first}<td colspan="{len(names)}"{cells[0]}</tr>'
    labels = ("" if not index or not name else f' data-label="{name}"' for index, name in enumerate(names))
    return first + "".join(f"<td{label}{cell}" for label, cell in zip(labels, cells, strict=True))


def label_table(match: re.Match[str]) -> str:
    """Mark a table of at least FEWEST_COLUMNS columns for site.css as cards; leave any other table unchanged."""
    names = [re.sub(r"<[^>]+>", "", head).strip().replace('"', "&quot;") for head in HEAD.findall(match[0])]
    if len(names) < FEWEST_COLUMNS:
        return match[0]
    rows = ROW.sub(lambda row: label_row(row[0], names) if "<td" in row[0] else row[0], match[0])
    return rows.replace("<table>", '<table data-cards="">', 1)


def on_page_content(content: str, **_: Any) -> str:
    """Label the tables in the HTML of a page; mkdocs calls this for every page."""
    return TABLE.sub(label_table, content)
