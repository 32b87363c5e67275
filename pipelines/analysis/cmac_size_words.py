"""Text of the study of CMAC sizes: advice, tables, captions and claims."""

from collections.abc import Sequence

import numpy as np

from cmacexp.report.page import Claim, Table, Text
from pipelines.analysis.cmac_size_verdicts import (
    ALIKE,
    AS_GOOD,
    CROWDED,
    INPUTS,
    LAYERS,
    LITTLE,
    MEMORY,
    NOTICEABLE,
    RANGE,
    SHOWN,
    Size,
    alike,
    by_memory,
    crowded,
    differing,
    enough_memory,
    enough_room,
    median_worsening,
    paper_size,
    verdict_of_little,
    verdict_of_rate,
    verdict_of_robustness,
)
from pipelines.analysis.cmac_size_verdicts import ELEMENTS as RESOLUTION
from pipelines.analysis.measured import digits, short, size_of
from pipelines.shared.runs import Runs


def shown_cycles(sizes: Sequence[Size]) -> list[int]:
    """The cycles whose errors are shown, as far as they were run."""
    return [cycle for cycle in SHOWN if cycle in paper_size(sizes).x]


def _errors(size: Size, cycle: int) -> str:
    return f"{digits(size.x[cycle])} / {digits(size.y[cycle])}" if cycle in size.x else "-"


def _values(size: Size, cycles: Sequence[int], last: str) -> list[str]:
    memory = [str(size.rows_used), size_of(size.bytes_needed), f"{size.rate:.1%}"]
    return [*(_errors(size, cycle) for cycle in cycles), last, f"{size.share:.0%}", *memory]


def tables(sizes: Sequence[Size]) -> list[Table]:
    """Every size but other seeds: errors by cycle, force or tilt, use of memory; one thing changed, then two."""
    cycles, walk = shown_cycles(sizes), np.isfinite(paper_size(sizes).tilt)
    single, double = [], []
    for size in sizes:
        values = _values(size, cycles, digits(size.tilt) if walk else f"{size.force_error:.2%}")
        if set(size.changed) == {LAYERS, MEMORY}:
            double.append([str(size.layers), size_of(size.memory), *values])
        elif len(size.changed) <= 1:
            name = " ".join(f"{key.removeprefix('cmac.')}={short(value)}" for key, value in size.changed.items())
            single.append([name or "nothing", *values])
    columns = [*(f"cycle {cycle}" for cycle in cycles), "tilt, mrad" if walk else "force error"]
    columns += ["share", "rows", "room", "collide"]
    caption = (
        f"cycle: transfer error of the foot in x / y, mm. share: the CMAC's of the torque in cycle {cycles[-1]}. "
        f"rows: of memory that the path uses. room: that each visited cell{' of one leg' if walk else ''} would "
        "need for a row of its own. collide: visited cells that share a row."
    )
    both = [Table(["layers", "memory", *columns], double, "Layers and memory changed together")] if double else []
    return [Table(["changed", *columns], single, caption), *both]


def _best(sizes: Sequence[Size], cycle: int) -> Size:
    """The one with the least product of errors in ``cycle``."""
    return min((s for s in sizes if cycle in s.x), key=lambda s: s.x[cycle] * s.y[cycle])


def advice(sizes: Sequence[Size]) -> list[Text]:
    """What to choose, in plain words."""
    paper, (first, *_, last) = paper_size(sizes), [*shown_cycles(sizes), shown_cycles(sizes)[-1]]
    widths, inputs = differing(sizes, RESOLUTION, RANGE), differing(sizes, INPUTS)
    soon, late, few = _best(widths, first), _best(widths, last), _best(inputs, first)
    layers = sorted(s.layers for s in differing(sizes, LAYERS) if alike(s, paper))
    enough = enough_memory(sizes)
    return [
        Text(
            f"Width of a cell, over the planned span of its input: {paper.width:.2f} in the paper's size "
            f"({_errors(paper, first)} mm in x / y in cycle {first}, {_errors(paper, last)} in cycle {last}). "
            f"Fastest is {soon.width:.2f} ({_errors(soon, first)} mm in cycle {first}), best in cycle {last} is "
            f"{late.width:.2f} ({_errors(late, last)} mm). More resolution elements and a narrower range do the "
            "same: both make cells narrower, and narrow cells learn each sample for themselves."
        ),
        Text(
            f"Layers: with {layers[0]} to {layers[-1]} the errors of every cycle shown stay within {ALIKE:g} times "
            f"those of {paper.layers}; each layer visits some {paper.cells / paper.layers:.0f} cells of its own. "
            f"Inputs: {short(few.changed.get(INPUTS, 'all six'))} learn fastest "
            f"({_errors(few, first)} mm in cycle {first}): on one fixed path fewer inputs are enough."
        ),
        Text(
            f"Memory: {size_of(enough)} do as well as {size_of(paper.memory)} (errors of cycle {last} within "
            f"{AS_GOOD:g} times), because the path visits {paper.cells} cells only, which would fill "
            f"{size_of(paper.bytes_needed)}. Advice: take cells some {soon.width:.1g} of the planned span wide, "
            f"{layers[0]} to {paper.layers} layers, and {enough_room(sizes):.2g} rows of memory for each cell that "
            "the path visits: with fewer layers a collision weighs more."
        ),
    ]


def claims(sizes: Sequence[Size], runs: Runs) -> list[Claim]:
    """The paper's claims about memory, and the verdicts."""
    paper, groups, enough = paper_size(sizes), crowded(sizes), enough_memory(sizes)
    collisions = "; ".join(
        f"{size_of(memory)}: {np.median([s.rate for s in groups[memory]]):.0%} collide, errors "
        f"{median_worsening(groups[memory], paper):.1f} times"
        for memory in sorted({max(groups, default=0), enough, min(groups, default=0)} & set(groups), reverse=True)
    )
    at_enough = by_memory(sizes)[enough][0]
    behind = [s.name for group in groups.values() for s in group]
    return [
        Claim(
            "By choosing proper generalisation size and memory the rate of collision stays below a noticeable level",
            "section 4",
            f"{paper.layers} layers in {size_of(paper.memory)}: {paper.rate:.1%} of the {paper.cells} visited cells "
            f"collide (criterion: below {NOTICEABLE:.0%})",
            verdict_of_rate(sizes),
            runs.links(paper.name),
        ),
        Claim(
            "CMAC learning is robust to collisions",
            "section 4",
            f"Against the paper's size, cycle {max(paper.x)}: {collisions or 'no memory is crowded'} (criterion: at "
            f"most {AS_GOOD:g} times wherever over {CROWDED:.0%} collide; median over seeds of the hash)",
            verdict_of_robustness(sizes),
            runs.links(paper.name, *behind[:3]),
        ),
        Claim(
            "A complex system is handled with little hardware (a board with 1 MB)",
            "sections 5, 6.3",
            f"{paper.rows_used / paper.rows:.1%} of the {size_of(paper.memory)} are touched; {size_of(enough)} do "
            f"as well (criterion: at most {LITTLE:.0%} of the board)",
            verdict_of_little(sizes),
            runs.links(paper.name, at_enough.name),
        ),
    ]


def captions(sizes: Sequence[Size]) -> tuple[str, str]:
    """Of the figures of accuracy and of collisions."""
    paper, cycle = paper_size(sizes), shown_cycles(sizes)[0]
    wide, narrow = (pick(differing(sizes, RESOLUTION, RANGE), key=lambda s: s.width) for pick in (max, min))
    seen = [s.x[cycle] for s in differing(sizes, LAYERS)]
    accuracy = (
        f"Cells decide, layers hardly: in cycle {cycle} the error in x is {digits(wide.x[cycle])} mm with the widest "
        f"cells and {digits(narrow.x[cycle])} mm with the narrowest, but {digits(min(seen))} to {digits(max(seen))} "
        "mm over all layers. Dotted: the paper's size. Hollow: the range is changed, not the resolution elements."
    )
    small = min(by_memory(sizes).items())
    collisions = (
        f"From {enough_room(sizes):.2g} rows of memory for each visited cell up, errors stay within {AS_GOOD:g} "
        f"times those of the paper's size, with any number of layers; with {size_of(small[0])} they are "
        f"{median_worsening(small[1], paper):.1f} times as large. Dotted: the paper's memory; one row a cell. Marks "
        "of a kind above each other: other seeds of the hash."
    )
    return accuracy, collisions
