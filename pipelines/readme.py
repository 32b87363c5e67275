"""The generated sections of the README: what studies found, in the words of ``readme_blocks``, and the first run."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import cmacexp
from pipelines.quotes import Quotable, count_claims, fill_quotes

BLOCKS = Path(__file__).with_name("readme_blocks")
"""A file of Markdown with quotes for each section of its name."""
FENCE = re.compile(r"(?<=```text\n).*?(?=^```$)", flags=re.DOTALL | re.MULTILINE)
"""What a command printed, in a section."""
FIRST_RUN = "Install and run"
COMMAND = re.compile(r"-m cmacexp (.*)$", flags=re.MULTILINE)


def print_first_run(section: str) -> str:
    """The table that the first run of a section prints at its end."""
    with TemporaryDirectory() as folder:
        return str(cmacexp.run(COMMAND.findall(section)[0].split(), Path(folder) / "run")).partition("\n")[2]


def find_section(text: str, heading: str) -> str:
    """What stands below a heading of the README, up to the next one."""
    return text.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]


def make_section(path: Path, statements: Quotable) -> str:
    """A section with its quotes filled in."""
    text = fill_quotes(path.read_text(encoding="utf-8"), statements)
    return text.replace("{{ count }}", count_claims(statements))


def renew_readme(text: str, statements: Quotable) -> str:
    """The README with its sections made anew."""
    for path in sorted(BLOCKS.glob("*.md")):
        text = text.replace(find_section(text, path.stem), make_section(path, statements))
    first = find_section(text, FIRST_RUN)
    return text.replace(first, FENCE.sub(lambda _: f"{print_first_run(first)}\n", first))
