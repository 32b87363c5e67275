"""Equations of pages as MathML, which browsers draw themselves: made when the site is built, without a script."""

import html
import re
from typing import Any

from latex2mathml.converter import convert

EQUATION = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', flags=re.DOTALL)
"""As pymdownx.arithmatex marks them."""


def render(match: re.Match[str]) -> str:
    """The MathML of one equation; a ``div`` stands on a line of its own."""
    display = "block" if match[1] == "div" else "inline"
    return f'<{match[1]} class="equation">{convert(html.unescape(match[2]), display=display)}</{match[1]}>'


def on_page_content(content: str, **_: Any) -> str:
    """Called by mkdocs with the HTML of a page."""
    return EQUATION.sub(render, content)
