"""The generated blocks of the README: what studies found, in the words of ``readme_blocks``, and the first run."""

import re
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import cmacexp
from pipelines.quotes import Quotable, fill, fill_quotes, find_block

BLOCKS = Path(__file__).with_name("readme_blocks")
"""A file of Markdown with quotes for each block of its name."""
FENCE = re.compile(r"(?<=```text\n).*?(?=^```$)", flags=re.DOTALL | re.MULTILINE)
"""What a command printed, in a block."""
FIRST_RUN = "first-run"


def print_first_run() -> str:
    """The table that the README's first run prints at its end."""
    with TemporaryDirectory() as folder:
        return str(cmacexp.run(["scenario=one_leg"], Path(folder) / "run")).partition("\n")[2]


def renew_readme(text: str, statements: Quotable) -> str:
    """The README with its blocks made anew."""
    for block in sorted(BLOCKS.glob("*.md")):
        text = fill(text, block.stem, partial(fill_quotes, block.read_text(encoding="utf-8"), statements))
    first = find_block(text, FIRST_RUN)
    return text.replace(first, FENCE.sub(lambda _: f"{print_first_run()}\n", first))
