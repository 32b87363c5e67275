"""The generated blocks of the README: templates whose quotes are filled in from the studies, and the first run."""

import re
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import cmacexp
from cmacexp.report.terminal import print_summary
from pipelines.quotes import Quotable, fill, fill_quotes, find_block

FENCE = re.compile(r"(?<=```text\n).*?(?=^```$)", flags=re.DOTALL | re.MULTILINE)
"""What a command printed, in a block."""
FIRST_RUN = "first-run"
_BUILT = "moving_robots.as_built"


def _cell(study: str, ratio: int, value: int) -> str:
    return f'{{{{ quote("{study}", {value}) }}}} ({{{{ quote("{study}", {ratio}) }}}})'


def _row(name: str, study: str, walks: int) -> str:
    """Errors of one feedforward, absolute and over those with feedback only: positions, then forces."""
    errors = " | ".join(_cell(study, ratio, value) for ratio, value in zip(range(4), (5, 7, 9, 11), strict=True))
    return f"| {name} | {_walks(walks)} | {errors} |\n"


def _walks(first: int) -> str:
    return " / ".join(f'{{{{ size("moving_robots.built_walks", {index}) }}}}' for index in (first, first + 1))


GO2 = f"""
| feedforward | walks completed, soft / rigid | foot error, soft | foot error, rigid | force error, soft | force error, rigid |
|---|--:|--:|--:|--:|--:|
| feedback only | {_walks(2)} | {" | ".join(f'{{{{ quote("{_BUILT}", {index}) }}}}' for index in (4, 6, 8, 10))} |
{_row("nominal model", "moving_robots.by_model", 4)}{_row("CMAC, guarded", _BUILT, 0)}
"""
PAPER = """
- “CMAC provides the major part” of the torque: {{ verdict("one_leg_learning.major_part") }},
  {{ quote("one_leg_learning.major_part") }} in cycle 5 on one leg.
- “Position errors are virtually eliminated” after 12 s: {{ verdict("one_leg_learning.errors_vanish") }}.
  {{ quote("one_leg_learning.errors_vanish") }} and {{ quote("one_leg_learning.errors_vanish", 1) }} of the errors in x
  and y remain.
- “The learning law is convergent”: {{ verdict("one_leg_learning.law_converges") }}. As published it trains the network one
  sample too late; over many cycles the leg diverges.
"""
TEMPLATES: Mapping[str, str] = {"go2": GO2, "paper": PAPER}


def print_first_run() -> str:
    """What the README's first run prints at its end."""
    with TemporaryDirectory() as folder:
        run = cmacexp.run(["scenario=one_leg"], Path(folder) / "run")
        return str(run).partition("\n")[2]


def renew_readme(text: str, statements: Quotable) -> str:
    """The README with its blocks made anew."""
    for name, template in TEMPLATES.items():
        text = fill(text, name, lambda template=template: fill_quotes(template, statements))
    first = find_block(text, FIRST_RUN)
    return text.replace(first, FENCE.sub(lambda _: f"{print_first_run()}\n", first))
