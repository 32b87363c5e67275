"""README and documentation, in the order of the site, and the blocks of code in them."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from support.command import ROOT

FENCE = re.compile(r'^```(\w*)(?: title="(.*?)")?\n(.*?)^```$', flags=re.DOTALL | re.MULTILINE)


NOTES: dict[str, dict[str, dict[str, Any]]] = tomllib.loads(Path(__file__).with_name("blocks.toml").read_text())
"""What is different in tests, by page and first line of a block."""


class Block(NamedTuple):
    """A block of code, as it stands in a page."""

    page: str
    notes: dict[str, Any]
    """What is different in the tests, as blocks.toml says."""
    language: str
    title: str
    """The file that the block is; empty: none."""
    code: str


def _leaves(node: object) -> Iterator[str]:
    for value in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from _leaves(value)
    if isinstance(node, str):
        yield node


PAGES: dict[str, Path] = {
    "README.md": ROOT / "README.md",
    **{
        name: path
        for name in _leaves(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"])
        if (path := ROOT / "docs" / name).is_file()
    },
}


def blocks(page: str) -> list[Block]:
    """All blocks of a page."""
    found = FENCE.findall(PAGES[page].read_text())
    notes = NOTES.get(page, {})
    return [Block(page, notes.get(code.partition("\n")[0], {}), *rest, code) for *rest, code in found]
