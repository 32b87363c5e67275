"""Equations of pages as MathML, which browsers draw themselves, and links from their numbers: made with the site."""

import html
import re
from typing import Any

from latex2mathml.converter import convert

EQUATION = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', flags=re.DOTALL)
"""As pymdownx.arithmatex marks them."""
CITED = re.compile(r"\beq\.\s+\d+(?:(?:, | and | to |-)\d+)*")
NOT_TEXT = re.compile(r"(<a\b.*?</a>|<code\b.*?</code>|<pre\b.*?</pre>|<h\d.*?</h\d>|<[^>]+>)", flags=re.DOTALL)
"""Tags, and what is not to hold a link."""
PAGE = "equations.html"


def render(match: re.Match[str]) -> str:
    """The MathML of one equation; a ``div`` stands on a line of its own."""
    display = "block" if match[1] == "div" else "inline"
    return f'<{match[1]} class="equation">{convert(html.unescape(match[2]), display=display)}</{match[1]}>'


def link_numbers(text: str, page: str) -> str:
    """Text with a link to ``page`` on each number after ``eq.``, e.g. on all three of ``eq. 9, 11 and 13``."""
    return CITED.sub(lambda cited: re.sub(r"\d+", rf'<a href="{page}#eq-\g<0>">\g<0></a>', cited[0]), text)


def on_page_content(content: str, page: Any, **_: Any) -> str:
    """Called by mkdocs with the HTML of a page."""
    if page.url != PAGE:
        target, parts = "../" * page.url.count("/") + PAGE, NOT_TEXT.split(content)
        content = "".join(part if number % 2 else link_numbers(part, target) for number, part in enumerate(parts))
    return EQUATION.sub(render, content)
