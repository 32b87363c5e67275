"""Equations of pages as MathML, which browsers render without scripts, and links from numbers of equations."""

import html
import re
from typing import Any

from latex2mathml.converter import convert

EQUATION = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', flags=re.DOTALL)
"""An equation as marked by pymdownx.arithmatex."""
CITED = re.compile(r"\beq\.\s+\d+(?:(?:, | and | to |-)\d+)*")
NOT_TEXT = re.compile(r"(<a\b.*?</a>|<code\b.*?</code>|<pre\b.*?</pre>|<h\d.*?</h\d>|<[^>]+>)", flags=re.DOTALL)
"""Tags, and elements in which no link is inserted."""
PAGE = "equations.html"


def render(match: re.Match[str]) -> str:
    """Convert one equation to MathML; a ``div`` becomes a displayed equation, a ``span`` an inline one."""
    display = "block" if match[1] == "div" else "inline"
    return f'<{match[1]} class="equation">{convert(html.unescape(match[2]), display=display)}</{match[1]}>'


def link_numbers(text: str, page: str) -> str:
    """Link each number after ``eq.`` to ``page``, e.g. all three of ``eq. 9, 11 and 13``."""
    return CITED.sub(lambda cited: re.sub(r"\d+", rf'<a href="{page}#eq-\g<0>">\g<0></a>', cited[0]), text)


def on_page_content(content: str, page: Any, **_: Any) -> str:
    """Render the equations in the HTML of a page, and link their numbers; mkdocs calls this for every page."""
    if page.url != PAGE:
        target = "../" * page.url.count("/") + PAGE
        parts = enumerate(NOT_TEXT.split(content))
        content = "".join(text if number % 2 else link_numbers(text, target) for number, text in parts)
    return EQUATION.sub(render, content)
