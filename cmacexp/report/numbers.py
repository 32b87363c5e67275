"""Numbers as readers see them."""

import math

DIGITS = 3


def format_number(value: float, unit: str = "") -> str:
    """A number with three significant digits, without exponents where they can be avoided, and its unit.

    >>> format_number(0.123456), format_number(12345.6, "N"), format_number(-5e-7), format_number(float("nan"))
    ('0.123', '12300 N', '-5e-07', 'undefined')
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if math.isnan(value):
        return "undefined"
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    short = f"{value:.{DIGITS}g}"
    if isinstance(value, int):
        text = str(value)
    elif "e" in short and 1.0 <= abs(value) < 1e6:
        text = f"{float(short):.0f}"
    else:
        text = short
    return f"{text} {unit}".rstrip()
