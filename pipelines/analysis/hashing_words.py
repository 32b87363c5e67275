"""Text of the study of hashing: tables, captions, advice and a claim of the paper."""

from collections.abc import Mapping, Sequence

import pandas as pd

from cmacexp.report.page import Claim, Table, Text
from pipelines.analysis.hashing_found import AS_GOOD, Memory, enough, free, hashed, worse
from pipelines.analysis.measured import size_of
from pipelines.shared.runs import Runs

Rules = Mapping[str, Sequence[Memory]]


def _learns(memory: Memory) -> bool:
    return memory.ended == 0


def table(rules: Rules) -> Table:
    """Every memory under every rule."""
    rows = [
        [
            rule,
            f"{memory.words}{', no collision' if memory.visited else ''}",
            f"{memory.room:.2g}",
            f"{memory.rate:.0%}",
            str(memory.learnt()),
            *(str(memory.errors(side)) for side in ("x", "y")),
            f"{memory.ended} of {len(memory.sizes)}",
        ]
        for rule, memories in rules.items()
        for memory in memories
    ]
    columns = [
        "rule",
        "words of a leg",
        "rows a cell",
        "collide",
        "cycles to a tenth",
        "x, mm",
        "y, mm",
        "ended early",
    ]
    return Table(columns, rows, "Mean over seeds (95 % confidence interval); errors are of the last ten cycles")


def caption(rules: Rules, machine: str) -> str:
    """Of the figure of one machine."""
    memories = next(iter(rules.values()))
    small = hashed(memories)[0]
    return (
        f"{machine[:1].upper()}{machine[1:]}: with {small.words} words {small.rate:.0%} of the visited cells share a "
        "row. Bars: 95 % confidence interval over seeds of the hash. Dotted: without collisions."
    )


def _of_rule(rule: str, memories: Sequence[Memory]) -> str:
    good = enough(memories, lambda m: worse(m, memories) <= AS_GOOD)
    lives = enough(memories, _learns)
    best = free(memories)
    summary = f"With {rule}, errors without any collision end at {best.errors('x')} / {best.errors('y')} mm in x / y"
    if good is None:
        return f"{summary}, and no hashed memory comes within {AS_GOOD:g} times of it."
    summary += (
        f"; from {good.room:.2g} rows a visited cell on ({size_of(good.memory)}, {good.rate:.0%} collide) hashing "
        f"costs no more than {AS_GOOD:g} times of it"
    )
    small = hashed(memories)[0]
    if lives is None or lives is good:
        return f"{summary}. Below that some runs diverge or fall."
    if lives is small:
        return (
            f"{summary}; even {small.words} words, where {small.rate:.0%} collide, complete every run, and end at "
            + (f"{small.errors('x')} / {small.errors('y')} mm.")
        )
    return f"{summary}; below {lives.words} words some runs diverge or fall."


def advice(rules: Rules) -> list[Text]:
    """What collisions cost under each rule, and how much memory to take."""
    rooms = [good.room for m in rules.values() if (good := enough(m, lambda one, m=m: worse(one, m) <= AS_GOOD))]
    needed = size_of(free(next(iter(rules.values()))).memory)
    hashing = f"hash with {max(rooms):.2g} rows for each visited cell, or " if rooms else ""
    return [
        *(Text(_of_rule(rule, memories)) for rule, memories in rules.items()),
        Text(
            f"Advice: on a planned path {hashing}give every visited cell its own row (cmac.addressing=visited): "
            f"{needed} a leg are enough for that, no seed plays a part, and it costs time once, at the start."
        ),
    ]


def cost(measured: pd.DataFrame) -> Text:
    """What the hash costs, from nanoseconds a sample by ``way``."""
    took = measured.set_index("way")["time"]
    return Text(
        f"The hash costs {took['hashed'] - took['neither']:.0f} ns a sample on the machine that wrote this "
        f"({took['hashed']:.0f} ns against {took['neither']:.0f} ns for the address alone), and looking up the rows "
        f"of visited cells {took['visited'] - took['neither']:.0f} ns. A run pays it once for each sample of the "
        "cycle, since the plan fixes every address."
    )


def claim(rules: Rules, runs: Runs, behind: Sequence[str]) -> Claim:
    """Of robustness to collisions, here with intervals and over long runs."""
    summaries, verdicts = [], []
    for rule, memories in rules.items():
        crowded = [memory for memory in hashed(memories) if memory.rate >= 0.5]
        good = [worse(memory, memories) <= AS_GOOD for memory in crowded]
        lives = [memory.ended == 0 for memory in crowded]
        summaries.append(
            f"{rule}: {sum(good)} of {len(crowded)} such memories as good, {sum(lives)} complete all runs"
        )
        verdicts.append("reproduced" if all(good) else "reproduced in part" if any(lives) else "contradicted")
    verdict = verdicts[0] if len(set(verdicts)) == 1 else "reproduced in part"
    return Claim(
        "CMAC learning is robust to collisions",
        "section 4",
        f"Where at least half of the visited cells collide (criterion: at most {AS_GOOD:g} times the errors without "
        f"collisions): {'; '.join(summaries)}",
        verdict,
        runs.links(*behind),
    )
