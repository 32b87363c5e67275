"""The page of results: how many mutants each room has, and why those live that live."""

import tomllib
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

from benchmarks.mutants.mutations import Mutant
from benchmarks.mutants.trial import FIGURES_ONLY, INVALID, KILLED, SURVIVED

EXPLAINED = Path(__file__).with_name("explained.toml")
UNEXPLAINED = "not explained"


def read_reasons() -> dict[tuple[str, str, str, str], str]:
    """Why mutants survive, by path, line, old and new text."""
    entries = tomllib.loads(EXPLAINED.read_text()).get("survivor", [])
    return {(entry["path"], entry["line"], entry["old"], entry["new"]): entry["why"] for entry in entries}


def in_room(path: str) -> str:
    """The room of a file."""
    return path.split("/")[1]


def code(text: str) -> str:
    """Text as code in a cell of a table."""
    return "`" + " ".join(text.split()).replace("|", "\\|") + "`"


def format_rooms(entries: list[dict[str, Any]]) -> list[str]:
    """The table of rooms."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for entry in entries:
        count = counts[in_room(entry["mutant"][0])]
        count[entry["result"]] += 1
        count["first"] += entry["result"] in (KILLED, FIGURES_ONLY) and entry["tier"] == "first"
    counts["all"] = sum(counts.values(), Counter())
    lines = [
        "| room | mutants | killed by the first tier, % | killed by CI, % | by recorded figures alone | survived |",
        "|---|---|---|---|---|---|",
    ]
    for room, count in counts.items():
        killed = count[KILLED] + count[FIGURES_ONLY]
        tried = killed + count[SURVIVED]
        shares = [f"{100.0 * number / tried:.1f}" for number in (count["first"], killed)]
        lines.append(f"| {room} | {tried} | {' | '.join(shares)} | {count[FIGURES_ONLY]} | {count[SURVIVED]} |")
    return lines


def format_survivors(entries: list[dict[str, Any]]) -> list[str]:
    """The table of survivors."""
    reasons = read_reasons()
    lines = ["| file | line | instead of | mutant | why it survives |", "|---|---|---|---|---|"]
    for mutant in sorted(Mutant(*entry["mutant"]) for entry in entries if entry["result"] == SURVIVED):
        why = reasons.get((mutant.path, mutant.context, mutant.old, mutant.new), UNEXPLAINED)
        cells = (mutant.path.removeprefix("cmacexp/"), code(mutant.context), code(mutant.old), code(mutant.new), why)
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def write_page(page: Path, entries: list[dict[str, Any]], total: int, seed: int) -> None:
    """Write the results of ``entries``, a sample of ``total`` mutants drawn with ``seed``, into the file ``page``."""
    valid = [entry for entry in entries if entry["result"] != INVALID]
    rooms, survivors = format_rooms(sorted(valid, key=lambda e: in_room(e["mutant"][0]))), format_survivors(valid)
    head = (
        f"{len(valid)} of {total} mutants, drawn with seed {seed}; {len(entries) - len(valid)} more that cannot be "
        "imported do not count."
    )
    page.write_text("\n".join([head, "", *rooms, "", "### Survivors", "", *survivors, ""]))
