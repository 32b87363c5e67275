"""Tables in Markdown."""

from collections.abc import Iterable, Sequence


def format_cell(text: object) -> str:
    """Format the text of a cell in one line, without characters that would end the cell."""
    return " ".join(str(text).replace("|", "\\|").split())


def format_table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Format a table as Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(format_cell, cells)) + " |" for cells in lines)
