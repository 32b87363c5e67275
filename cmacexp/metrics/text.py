"""Numbers and settings as text, for tables, pages and messages."""

import math
import re
from collections.abc import Sequence
from typing import Any

DIGITS = 3
NUMBER = re.compile(r"([-+]?(\d[\d.]*(e[-+]?\d+|-\d+)?|infinite)( .*)?|-|undefined)?")
"""A cell that is a number or a range, with its unit or a remark, or says that there is none."""


def format_number(value: float, unit: str = "", digits: int = DIGITS) -> str:
    """A number with so many significant digits, without exponents where they can be avoided, and its unit.

    >>> format_number(0.123456), format_number(12345.6, "N"), format_number(-5e-7), format_number(float("nan"))
    ('0.123', '12300 N', '-5e-07', 'undefined')
    >>> format_number(3), format_number(float("inf"))
    ('3', 'infinite')
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if math.isnan(value):
        return "undefined"
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    short = f"{value:.{digits}g}"
    if isinstance(value, int):
        text = str(value)
    elif "e" in short and 1.0 <= abs(value) < 1e6:
        text = f"{float(short):.0f}"
    else:
        text = short
    return f"{text} {unit}".rstrip()


def format_cell(value: float, decimals: int = 3) -> str:
    """A number in a column of a table, with so many decimals if it is small; a dash where it is undefined.

    >>> format_cell(0.12345), format_cell(123.45), format_cell(float("nan"))
    ('0.123', '123.5', '-')
    """
    if math.isnan(value):
        return "-"
    size = abs(value)
    return f"{value:.{decimals}f}" if size < 10 else f"{value:.1f}" if size < 1e5 else f"{value:.2e}"


def format_setting(value: Any) -> str:
    """A value of a config as it is typed on the command line: short numbers, a shipped class by its name.

    >>> [format_setting(value) for value in (None, True, 1 / 3, [1, 2], "cmacexp.plants.analytic.Analytic")]
    ['null', 'true', '0.333333', '[1, 2]', 'Analytic']
    """
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    text = f"[{', '.join(map(format_setting, value))}]" if isinstance(value, list) else str(value)
    return text.rpartition(".")[2] if text.startswith("cmacexp.") else text


def find_numeric(rows: Sequence[Sequence[str]]) -> frozenset[int]:
    """The columns of a table that hold numbers only, which are aligned to the right."""
    columns = zip(*rows, strict=True)
    return frozenset(i for i, cells in enumerate(columns) if all(NUMBER.fullmatch(cell) for cell in cells))
